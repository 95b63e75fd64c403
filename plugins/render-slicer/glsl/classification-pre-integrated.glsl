// Value linear along the ray from front to back: the table holds the exact optical depth of a slab
// and its mean colour times that depth. Bilinear between its nodes; since the back of one slab is the
// front of the next, what a peak narrower than a bin loses in one it gains in the other. Where there are
// such peaks their depth is a difference of integrals, which add up to the same whatever the slices.
uniform sampler2D slab_table;
uniform vec2 slab_map;  // u to texture coordinate
#ifdef NARROW_PEAKS
uniform sampler1D depth_integral;
uniform vec2 integral_map;
const float kCancels = 1e-4;  // the difference of two values below which the table is the better
float integral_at(float u) { return texture(depth_integral, clamp(u, 0.0, 1.0) * integral_map.x + integral_map.y).r; }
#define INTEGRAL(u) , integral_at(u)
#else
#define INTEGRAL(u)
#endif
#ifdef LEVEL_TABLES
// One table a slice distance, one below the other.
uniform float table_layers;
vec2 slab_place(vec2 at) { return vec2(at.x, (at.y + page_layer) / table_layers); }
#else
vec2 slab_place(vec2 at) { return at; }
#endif
#ifdef COLOR
#define TEXEL(t) , clamp(t, 0.0, 1.0)
#else
#define TEXEL(t)
#endif
struct Sample {
    vec2 scalar;
#ifdef COLOR
    vec4 texel;
#endif
#ifdef NARROW_PEAKS
    float integral;
#endif
};
Sample observe(vec3 p) {
    vec4 t = reconstruct(p);
    vec2 u = scalar_of(t);
    return Sample(u TEXEL(t) INTEGRAL(u.x));
}
vec4 slab(Sample f, Sample b) {
    vec2 u = vec2(f.scalar.x, b.scalar.x);
#ifdef VALIDITY
    // Where one end is invalid the slab is half as thick and has the other's value.
    u = mix(u.yx, u, vec2(f.scalar.y, b.scalar.y));
#endif
    u = clamp(u, 0.0, 1.0);
    vec4 e = texture(slab_table, slab_place(u * slab_map.x + slab_map.y));
#ifdef NARROW_PEAKS
    float across = u.y - u.x;
    if (abs(across) > kCancels) e *= PLANE_STEP * (b.integral - f.integral) / across / max(e.a, 1e-30);
#endif
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
