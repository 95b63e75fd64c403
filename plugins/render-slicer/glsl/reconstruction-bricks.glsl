// The open page's brick at a point in index coordinates. Towards coarser neighbours the parent's samples
// are mixed in, by shares that are trilinear between the corners: both sides of a face between levels
// then show the coarser samples.
vec4 own_at_point(vec3 p) { return brick_reconstruct((p - page_first) * page_scale); }
#ifdef BLENDED
vec4 parent_at_point(vec3 p) {
    vec3 own_at = slot_at;
    slot_at = parent_at;
    vec4 coarse = brick_reconstruct((p - page_first) * parent_scale + parent_from);
    slot_at = own_at;
    return coarse;
}
float share_of_parent(vec3 p) {
    vec3 f = clamp((p - page_first) * page_scale / brick_size, 0.0, 1.0);
    vec4 z = mix(blend_below, blend_above, f.z);
    vec2 y = mix(z.xy, z.zw, f.y);
    return page_blends * mix(y.x, y.y, f.x);
}
#else
vec4 parent_at_point(vec3 p) { return own_at_point(p); }
float share_of_parent(vec3 p) { return 0.0; }
#endif
vec4 reconstruct(vec3 p) {
    vec4 own = own_at_point(p);
#ifdef BLENDED
    // A loop of one turn or none: a branch would cost both of its sides.
    for (float turn = 0.0; turn < page_blends; turn += 1.0) own = mix(own, parent_at_point(p), share_of_parent(p));
#endif
    return own;
}
