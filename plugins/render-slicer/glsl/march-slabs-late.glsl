// As march-slabs, where a seen slab is dear (it needs a gradient) and most are not seen: the inner
// loop runs to the next slab that is, the outer one pays for it. On SIMD machines, where a branch
// costs both of its sides, this is what makes the unseen ones cheap; the invocations of a group stop
// together where they can vote, so that none waits for another that has more slabs to pay for.
void march(float k, float end) {
    float m = on_ray(k);
    Sample front = observe(ray_at(m));
    while (k < end && !finished()) {
        vec4 e = vec4(0.0);
        float from = m;
        bool seen = false;
        while (k < end && !seen) {
            k += 1.0;
            from = m;
            m = on_ray(k);
            Sample back = observe(ray_at(m));
            e = slab(front, back);
            samples += 1.0;
            front = back;
            seen = ANY(e.a > 0.0);
        }
        vec3 p = ray_at(0.5 * (from + m));
        vec3 g = world_gradient(p);
#ifdef MODULATION
        e *= modulation(g);
#endif
#ifdef SHADING
        e.rgb = shade(e.rgb / max(e.a, 1e-37), g, p) * e.a;
#endif
        add_slab(e, (m - from) * slab_length);
    }
}
