// For maximum intensity and isosurfaces: the value itself.
#ifdef COLOR
struct Sample { vec2 scalar; vec4 texel; };
Sample observe(vec3 p) {
    vec4 t = reconstruct(p);
    return Sample(scalar_of(t), clamp(t, 0.0, 1.0));
}
#else
struct Sample { vec2 scalar; };
Sample observe(vec3 p) { return Sample(scalar_of(reconstruct(p))); }
#endif
