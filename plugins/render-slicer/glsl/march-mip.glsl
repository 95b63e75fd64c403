// The largest value along the ray; its opacity is that of the reference length.
float largest = -1.0, largest_at = 0.0;
#ifdef COLOR
vec4 largest_texel = vec4(0.0);
#endif
bool finished() { return false; }
void look(float m) {
    Sample s = observe(ray_at(m));
    bool larger = s.scalar.x > largest && s.scalar.y > 0.0;
    largest = larger ? s.scalar.x : largest;
    largest_at = larger ? m : largest_at;
#ifdef COLOR
    largest_texel = larger ? s.texel : largest_texel;
#endif
    samples += 1.0;
}
void march(float k, float end) {
    look(on_ray(k));
    do {
        k += PLANE_STEP;
        look(on_ray(k));
    } while (k < end);
}
vec4 picture() {
    if (largest <= -1.0) return vec4(0.0);
    VISIT(largest_at);
    vec3 p = ray_at(largest_at);
#ifdef GRADIENT
    vec3 g = world_gradient(p);
#endif
#ifdef TRANSFER_2D
    vec4 e = emission_of(largest, length(g));
#else
    vec4 e = emission_at(largest);
#endif
#ifdef COLOR
    e.a *= largest_texel.a;
    e.rgb = largest_texel.rgb * e.a;
#endif
#ifdef MODULATION
    e *= modulation(g);
#endif
    vec3 c = e.rgb / max(e.a, 1e-37);
#ifdef SHADING
    c = shade(c, g, p);
#endif
    float alpha = 1.0 - exp2(-1.44269504 * e.a);
    return vec4(c, 1.0) * alpha;
}
