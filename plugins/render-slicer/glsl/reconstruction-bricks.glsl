// The open page's brick at a point in index coordinates. Towards coarser neighbours the parent's samples
// are mixed in, by shares that are trilinear between the corners: both sides of a face between levels
// then show the coarser samples.
vec4 reconstruct(vec3 p) {
    vec3 local = p - page_first;
    vec4 own = brick_reconstruct(local * page_scale);
#ifdef BLENDED
    // A loop of one turn or none: a branch would cost both of its sides.
    for (float turn = 0.0; turn < page_blends; turn += 1.0) {
        vec3 own_at = slot_at;
        slot_at = parent_at;
        vec4 coarse = brick_reconstruct(local * parent_scale + parent_from);
        slot_at = own_at;
        vec3 f = clamp(local * page_scale / brick_size, 0.0, 1.0);
        vec4 z = mix(blend_below, blend_above, f.z);
        vec2 y = mix(z.xy, z.zw, f.y);
        own = mix(own, coarse, mix(y.x, y.y, f.x));
    }
#endif
    return own;
}
