// The largest value along the ray; its opacity is that of the reference length.
uniform sampler1D emission_table;  // optical depth over the reference length
uniform float emission_bins;
float largest = -1.0;
#ifdef COLOR
vec4 largest_texel = vec4(0.0);
#endif
bool finished() { return false; }
void look(Sample s) {
#ifdef COLOR
    largest_texel = s.scalar.x > largest ? s.texel : largest_texel;
#endif
    largest = s.scalar.y > 0.0 ? max(largest, s.scalar.x) : largest;
}
void march(float k, float end) {
    look(observe(ray_at(on_ray(k))));
    while (k < end) {
        k += 1.0;
        look(observe(ray_at(on_ray(k))));
        samples += 1.0;
    }
}
vec4 picture() {
    if (largest <= -1.0) return vec4(0.0);
    vec4 e = texture(emission_table, (clamp(largest, 0.0, 1.0) * (emission_bins - 1.0) + 0.5) / emission_bins);
#ifdef COLOR
    e.a *= largest_texel.a;
    e.rgb = largest_texel.rgb * e.a;
#endif
    float alpha = 1.0 - exp2(-1.44269504 * e.a);
    return vec4(e.rgb * (alpha / max(e.a, 1e-37)), alpha);
}
