// Gradients computed once at the voxels, interpolated like the values. Per index step, in texel units.
uniform float gradient_scale;
vec3 gradient(vec3 p) { return gradient_reconstruct(p).xyz * gradient_scale; }
