// Value linear along the ray from front to back: the table holds the exact optical depth of a slab
// and its mean colour times that depth. Bilinear between its nodes; since the back of one slab is the
// front of the next, what a peak narrower than a bin loses in one it gains in the other.
uniform sampler2D slab_table;
uniform vec2 slab_map;  // u to texture coordinate
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
vec4 slab(Sample f, Sample b) {
    vec2 u = vec2(f.scalar.x, b.scalar.x);
#ifdef VALIDITY
    // Where one end is invalid the slab is half as thick and has the other's value.
    u = mix(u.yx, u, vec2(f.scalar.y, b.scalar.y));
#endif
    vec4 e = texture(slab_table, clamp(u, 0.0, 1.0) * slab_map.x + slab_map.y);
#ifdef VALIDITY
    e *= 0.5 * (f.scalar.y + b.scalar.y);
#endif
#ifdef COLOR
    vec4 own = 0.5 * (f.texel + b.texel);
    e.a *= own.a;
    e.rgb = own.rgb * e.a;
#endif
    return e;
}
