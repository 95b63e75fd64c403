// The open page at a point in index coordinates. Towards coarser neighbours the parent's samples are
// mixed in, by shares that are trilinear between the corners: both sides of a face between levels then
// show the coarser samples.
vec4 TEXELS_own(vec3 p) { return TEXELS_reconstruct((p - page_first) * page_scale); }
#ifdef BLENDED
vec4 TEXELS_parent(vec3 p) {
    vec3 own_at = slot_at, own_hi = slot_hi;
    slot_at = parent_at;
    slot_hi = brick_hi;
    vec4 coarse = TEXELS_reconstruct((p - page_first) * parent_scale + parent_from);
    slot_at = own_at;
    slot_hi = own_hi;
    return coarse;
}
#else
vec4 TEXELS_parent(vec3 p) { return TEXELS_own(p); }
#endif
vec4 TEXELS_at(vec3 p) {
    vec4 own = TEXELS_own(p);
#ifdef BLENDED
    own = mix(own, TEXELS_parent(p), share_of_parent(p));
#endif
    return own;
}
