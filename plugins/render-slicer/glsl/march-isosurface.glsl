// The first crossing of the isovalue: found between two planes, refined by bisection.
uniform float iso_level;  // u
uniform vec3 iso_color;
float hit = -1e30;
bool finished() { return hit > -1e30; }
void march(float k, float end) {
    float m = on_ray(k);
    Sample front = observe(ray_at(m));
    while (k < end && !finished()) {
        k += 1.0;
        float next = on_ray(k);
        Sample back = observe(ray_at(next));
        bool crosses = (front.scalar.x < iso_level) != (back.scalar.x < iso_level) &&
                       front.scalar.y * back.scalar.y > 0.0;
        hit = crosses ? next : hit;
        samples += 1.0;
        if (!crosses) {
            front = back;
            m = next;
        }
    }
    if (!finished()) return;
    float lo = m, hi = hit;
    for (int i = 0; i < 14; ++i) {
        float mid = 0.5 * (lo + hi);
        Sample s = observe(ray_at(mid));
        bool before = (s.scalar.x < iso_level) == (front.scalar.x < iso_level);
        lo = before ? mid : lo;
        hi = before ? hi : mid;
    }
    hit = 0.5 * (lo + hi);
}
vec4 picture() {
    if (!finished()) return vec4(0.0);
    vec3 p = ray_at(hit);
#ifdef COLOR
    vec3 c = observe(p).texel.rgb;
#else
    vec3 c = iso_color;
#endif
#ifdef SHADING
    c = shade(c, world_gradient(p), p);
#endif
    return vec4(c, 1.0);
}
