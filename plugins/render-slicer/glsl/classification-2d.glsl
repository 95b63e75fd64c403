// A transfer function over value and gradient magnitude, classified at the samples.
uniform sampler2D emission_table_2d;
uniform vec4 emission_map_2d;  // texture coordinate = map.xz * (texel, magnitude) + map.yw
struct Sample { vec4 emission; };
Sample observe(vec3 p) {
    vec4 t = reconstruct(p);
    vec2 s = scalar_of(t);
    vec2 at = vec2(s.x, length(world_gradient(p)));
    vec4 e = texture(emission_table_2d, at * emission_map_2d.xz + emission_map_2d.yw) * s.y;
#ifdef COLOR
    e.a *= clamp(t.a, 0.0, 1.0);
    e.rgb = clamp(t.rgb, 0.0, 1.0) * e.a;
#endif
    return Sample(e);
}
vec4 slab(Sample f, Sample b) { return 0.5 * (f.emission + b.emission); }
