// The first crossing of the isovalue, refined by bisection. Only blocks that hold the isovalue come
// here, so there is time for a finer look than from plane to plane, between which a ray may enter and
// leave the surface.
uniform float iso_level;  // u
uniform vec3 iso_color;
const float kPart = 0.25;  // of the distance between two planes
float hit = -1e30;
bool finished() { return hit > -1e30; }
void march(float k, float end) {
    float m = on_ray(k);
    Sample front = observe(ray_at(m));
    do {
        k += kPart * PLANE_STEP;
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
    } while (k < end && !finished());
    if (!finished()) return;
    float lo = m, hi = hit;
    for (int i = 0; i < 12; ++i) {
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
#ifdef GRADIENT
    vec3 g = world_gradient(p);
#endif
#ifdef COLOR
    vec3 c = observe(p).texel.rgb;
#elif defined(TRANSFER_2D)
    vec4 e = emission_of(iso_level, length(g));
    vec3 c = e.a > 0.0 ? e.rgb / e.a : vec3(1.0);
#else
    vec3 c = iso_color;
#endif
#ifdef SHADING
    c = shade(c, g, p);
#endif
    return vec4(c, 1.0);
}
