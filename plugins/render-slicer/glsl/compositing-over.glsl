// Emission and absorption, front to back. A slab has optical depth x at the planes' distance; its
// thickness counts the share between two planes and the slope of the ray.
vec3 colour = vec3(0.0);
float transmittance = 1.0;
uniform float saturated;  // transmittance below which nothing more is looked at

bool finished() { return transmittance <= saturated; }
void add_slab(vec4 e, float thickness) {
    float depth = e.a * thickness;
    // 1 - exp(-depth), without cancellation where it is small.
    float alpha = depth < 0.02 ? depth * (1.0 - depth * (0.5 - depth * (1.0 / 6.0)))
                               : 1.0 - exp2(depth * -1.44269504);
    colour += transmittance * (alpha / max(e.a, 1e-37)) * e.rgb;
    transmittance *= 1.0 - alpha;
}
vec4 picture() { return vec4(colour, 1.0 - transmittance); }
