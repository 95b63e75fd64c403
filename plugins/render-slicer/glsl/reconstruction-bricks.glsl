vec4 reconstruct(vec3 p) { return brick_at(p); }
