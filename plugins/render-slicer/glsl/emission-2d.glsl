// The transfer function at a value and a gradient's magnitude.
uniform sampler2D emission_table_2d;
uniform vec4 emission_map_2d;  // texture coordinate = map.xz * (u, magnitude) + map.yw
vec4 emission_of(float u, float magnitude) {
    return texture(emission_table_2d, vec2(u, magnitude) * emission_map_2d.xz + emission_map_2d.yw);
}
