// Absorption alone.
float depth_sum = 0.0;
bool finished() { return depth_sum > 40.0; }
void add_slab(vec4 e, float thickness) { depth_sum += e.a * thickness; }
vec4 picture() {
    return vec4(depth_sum < 0.02 ? depth_sum * (1.0 - depth_sum * (0.5 - depth_sum * (1.0 / 6.0)))
                                 : 1.0 - exp2(depth_sum * -1.44269504));
}
