// The first crossing of the isovalue, refined by bisection. A ray may also enter and leave the surface
// between two planes: where a value lies nearer to the isovalue than both its neighbours, the vertex of
// the parabola through the three is looked at too.
uniform float iso_level;  // u
uniform vec3 iso_color;
float hit = -1e30;
bool finished() { return hit > -1e30; }

// Above the isovalue or below it, and whether there is a value.
vec2 level(float m) {
    Sample s = observe(ray_at(m));
    return vec2(s.scalar.x - iso_level, s.scalar.y);
}
bool other_side(vec2 a, vec2 b) { return (a.x < 0.0) != (b.x < 0.0) && a.y * b.y > 0.0; }

void march(float k, float end) {
    // One plane more at both ends, so that the planes k and end have two neighbours.
    float m0 = 0.0, m1 = on_ray(k - 1.0), m2 = on_ray(k);
    vec2 v0 = vec2(0.0), v1 = level(m1), v2 = level(m2);
    float from = 0.0;
    while (k <= end && !finished()) {
        bool crosses = false, touches = false, some = false;
        while (k <= end && !some) {
            m0 = m1, m1 = m2, v0 = v1, v1 = v2;
            k += 1.0;
            m2 = on_ray(k);
            v2 = level(m2);
            samples += 1.0;
            crosses = other_side(v1, v2);
            touches = !crosses && !other_side(v0, v1) && v0.y * v1.y * v2.y > 0.0 &&
                      abs(v1.x) <= min(abs(v0.x), abs(v2.x)) && m0 < m1 && m1 < m2;
            some = ANY(crosses || touches);
        }
        if (touches) {
            float h1 = m1 - m0, h2 = m2 - m1;
            float s1 = (v1.x - v0.x) / h1, s2 = (v2.x - v1.x) / h2;
            float bend = s2 - s1;
            float x = bend == 0.0 ? 0.0 : -0.5 * (s1 * h2 + s2 * h1) / bend;
            float vertex = m1 + clamp(x, -h1, h2);
            from = vertex > m1 ? m1 : m0;
            hit = other_side(v1, level(vertex)) ? vertex : hit;
        }
        if (crosses) {
            from = m1;
            hit = m2;
        }
    }
    if (!finished()) return;
    float lo = from, hi = hit;
    bool below = level(lo).x < 0.0;
    for (int i = 0; i < 14; ++i) {
        float mid = 0.5 * (lo + hi);
        bool before = (level(mid).x < 0.0) == below;
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
