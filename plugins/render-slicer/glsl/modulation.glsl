// Extinction times smoothstep of the gradient's magnitude.
uniform vec2 modulation_range;  // lo, 1/(hi-lo), in the units of world_gradient
float modulation(vec3 g) {
    float t = clamp((length(g) - modulation_range.x) * modulation_range.y, 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}
