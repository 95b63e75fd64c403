// Interpolated, then classified; the trapezoid over a slab costs no more than one end of it.
struct Sample { vec4 emission; };
Sample observe(vec3 p) {
    vec4 t = reconstruct(p);
    vec2 s = scalar_of(t);
#ifdef TRANSFER_2D
    vec4 e = emission_of(s.x, length(world_gradient(p))) * s.y;
#else
    vec4 e = emission_at(s.x) * s.y;
#endif
#ifdef COLOR
    e.a *= clamp(t.a, 0.0, 1.0);
    e.rgb = clamp(t.rgb, 0.0, 1.0) * e.a;
#endif
    return Sample(e);
}
vec4 slab(Sample f, Sample b) { return 0.5 * (f.emission + b.emission); }
