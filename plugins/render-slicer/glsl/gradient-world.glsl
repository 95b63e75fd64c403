// The gradient in world axes, per smallest spacing and in texel units: free of overflow whatever the
// unit of length.
uniform mat3 gradient_to_world;
vec3 world_gradient(vec3 p) { return gradient_to_world * gradient(p); }
