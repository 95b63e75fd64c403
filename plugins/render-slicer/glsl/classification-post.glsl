// Interpolated, then classified; the trapezoid over a slab costs no more than one end of it.
uniform sampler1D emission_table;
uniform float emission_bins;
vec4 emission_at(float u) {
    return texture(emission_table, (clamp(u, 0.0, 1.0) * (emission_bins - 1.0) + 0.5) / emission_bins);
}
struct Sample { vec4 emission; };
Sample observe(vec3 p) {
    vec4 t = reconstruct(p);
    vec2 s = scalar_of(t);
    vec4 e = emission_at(s.x) * s.y;
#ifdef COLOR
    e.a *= clamp(t.a, 0.0, 1.0);
    e.rgb = clamp(t.rgb, 0.0, 1.0) * e.a;
#endif
    return Sample(e);
}
vec4 slab(Sample f, Sample b) { return 0.5 * (f.emission + b.emission); }
