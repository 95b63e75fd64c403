// From a texel to the scalar that is classified: u is 0..1 over the range of the tables, .y says how
// much of the footprint is valid (0: nothing, transparent).
uniform vec2 table_map;  // u = table_map.x * texel + table_map.y
vec2 scalar_of(vec4 t) {
#ifdef COLOR
    return vec2(dot(t.rgb, vec3(0.2126, 0.7152, 0.0722)) * table_map.x + table_map.y, 1.0);
#elif defined(VALIDITY)
    return vec2(t.x / max(t.y, 1e-6) * table_map.x + table_map.y, t.y > 1e-4 ? 1.0 : 0.0);
#else
    return vec2(t.x * table_map.x + table_map.y, 1.0);
#endif
}
