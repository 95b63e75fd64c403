// Gradients computed once at the voxels, interpolated like the values. Per index step, in texel units.
uniform float gradient_scale;
vec3 gradient(vec3 p) { return GRADIENT_AT(p).xyz * gradient_scale / VOXEL_STEP; }
