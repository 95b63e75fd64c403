// For sources that have no filter of their own: eight fetches.
vec4 sample_linear(vec3 p) {
    vec3 i = floor(p), f = p - i;
    ivec3 c = ivec3(i);
    vec4 r[4];
    for (int k = 0; k < 4; ++k) {
        ivec3 o = c + ivec3(0, k & 1, k >> 1);
        r[k] = mix(fetch_voxel(o), fetch_voxel(o + ivec3(1, 0, 0)), f.x);
    }
    return mix(mix(r[0], r[1], f.y), mix(r[2], r[3], f.y), f.z);
}
