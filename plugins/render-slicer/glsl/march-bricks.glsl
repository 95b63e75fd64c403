// From page to page between planes k and end. Slabs are cut at the pages' faces, where both sides have
// the same value, so a ray's slabs add up to its length whatever the bricks.
//
// Planes: far enough beyond a face for a float to be on its other side. Where it is not, the ray goes on
// that far on the page it had.
float ahead_of(float m) { return m + 1e-3 + 4e-6 * abs(m); }
bool there = false;          // something is drawn on the open page
float drawn_to = -1e30;     // slices of coarse pages may be further apart than the caller's planes
void march_bricks(float k, float end) {
    float first = ray_first, last = ray_last, length_of_slab = slab_length;
    bvec3 level_with = lessThan(abs(ray_step), vec3(1e-20));
    vec3 inverse = 1.0 / mix(ray_step, vec3(1.0), level_with);
    float m = max(on_ray(k), drawn_to), leave = on_ray(end);
    if (m < leave) do {
        there = open_page(ray_at(ahead_of(m)));
        vec3 out_at = (mix(page_lo, page_hi, greaterThan(ray_step, vec3(0.0))) - ray_point) * inverse;
        out_at = mix(out_at, vec3(1e30), level_with);
        float next = max(min(min(out_at.x, out_at.y), out_at.z), ahead_of(m));
#ifdef STEPS
        // Whole slabs of the page, whichever planes the caller went from and to.
        vec3 in_at = (mix(page_hi, page_lo, greaterThan(ray_step, vec3(0.0))) - ray_point) * inverse;
        in_at = mix(in_at, vec3(-1e30), level_with);
        float entry = max(max(max(in_at.x, in_at.y), in_at.z), drawn_to);
        ray_first = first;
        ray_last = last;
        m = min(m, max(on_ray(floor(k / page_step) * page_step), entry));
        next = min(next, max(leave, on_ray(ceil(end / page_step) * page_step)));
#else
        next = min(next, leave);
#endif
        ray_first = m;
        ray_last = next;
#ifdef LEVEL_TABLES
        slab_length = length_of_slab / page_step;  // the tables are of slabs as thick as the page's
#endif
        float from = floor(m / page_step) * page_step;
        if (there) march(from, next);
        m = next;
        drawn_to = next;
    } while (m < leave && !finished());
    ray_first = first;
    ray_last = last;
    slab_length = length_of_slab;
}
