// The transfer function at a value: optical depth of one slab, or of the reference length, and colour.
uniform sampler1D emission_table;
uniform float emission_bins;
vec4 emission_at(float u) {
    return texture(emission_table, (clamp(u, 0.0, 1.0) * (emission_bins - 1.0) + 0.5) / emission_bins);
}
