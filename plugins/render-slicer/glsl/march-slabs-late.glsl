// As march-slabs, where a seen slab is dear (it needs a gradient) and most are not seen: the inner
// loop runs to the next slab that is, the outer one pays for it. On SIMD machines, where a branch
// costs both of its sides, this is what makes the unseen ones cheap; the invocations of a group stop
// together where they can vote, so that none waits for another that has more slabs to pay for.
// The inner loop asks for no more than opacity: colour is looked up once more where it is needed.
void march(float k, float end) {
    float from = 0.0, m = on_ray(k);
    Sample front, back = observe(ray_at(m));
    do {
        bool seen = false;
        do {
            k += PLANE_STEP;
            from = m;
            front = back;
            m = on_ray(k);
            back = observe(ray_at(m));
            samples += 1.0;
            seen = ANY(slab(front, back).a > 0.0);
        } while (k < end && !seen);
        vec4 e = slab(front, back);
        vec3 p = ray_at(0.5 * (from + m));
        vec3 g = world_gradient(p);
#ifdef MODULATION
        e *= modulation(g);
#endif
#ifdef SHADING
        e.rgb = shade(e.rgb / max(e.a, 1e-37), g, p) * e.a;
#endif
        add_slab(e, (m - from) * slab_length);
    } while (k < end && !finished());
}
