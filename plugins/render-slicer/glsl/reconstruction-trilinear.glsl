vec4 reconstruct(vec3 p) { return sample_linear(p); }
