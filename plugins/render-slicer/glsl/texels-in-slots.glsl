// What the texture holds of the open page, in voxels from its first one.
uniform sampler3D dense_texture;
vec4 fetch_voxel(ivec3 i) {
    return texelFetch(dense_texture, ivec3(slot_at + clamp(vec3(i), slot_lo, slot_hi)), 0);
}
vec4 sample_linear(vec3 p) { return texture(dense_texture, place_of(p)); }
