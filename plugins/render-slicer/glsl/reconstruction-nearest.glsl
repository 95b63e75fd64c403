vec4 reconstruct(vec3 p) { return fetch_voxel(ivec3(floor(p + 0.5))); }
