// View-aligned planes through a box of voxels, with leaps over blocks that cannot be seen.
layout(location = 0) out vec4 pixel_color;
layout(location = 1) out float pixel_samples;  // negative where opacity ended the ray

uniform vec3 box_lo, box_hi;         // index coordinates
uniform float near_plane;            // m below which nothing is drawn
uniform vec4 background;             // premultiplied
#ifdef SKIPPING
uniform isampler3D occupancy;        // n > 0: all blocks nearer than n are seen; n < 0: none of them is
uniform float block_size;
uniform ivec3 block_last;
#endif

// Where the ray is inside of [lo, hi]: from x to y, empty when x >= y.
vec2 inside(vec3 lo, vec3 hi) {
    bvec3 across = lessThan(abs(ray_step), vec3(1e-20));
    vec3 inverse = 1.0 / mix(ray_step, vec3(1.0), across);
    vec3 a = (lo - ray_point) * inverse, b = (hi - ray_point) * inverse;
    vec3 enter = min(a, b), leave = max(a, b);
    // Parallel to a pair of faces: always between them, or never.
    bvec3 between = bvec3(uvec3(greaterThanEqual(ray_point, lo)) * uvec3(lessThanEqual(ray_point, hi)));
    enter = mix(enter, mix(vec3(1e30), vec3(-1e30), between), across);
    leave = mix(leave, vec3(1e30), across);
    return vec2(max(max(enter.x, enter.y), enter.z), min(min(leave.x, leave.y), leave.z));
}

void main() {
    aim(gl_FragCoord.xy * pixel_scale);
    vec2 range = inside(box_lo, box_hi);
    float m = max(range.x, near_plane), end = range.y;
#ifdef SKIPPING
    vec3 far_side = vec3(greaterThan(ray_step, vec3(0.0)));
    bvec3 across = lessThan(abs(ray_step), vec3(1e-20));
    vec3 inverse = 1.0 / mix(ray_step, vec3(1.0), across);
    while (m < end && !finished()) {
        // Leap: while all that is near is unseen, to the last plane before it ends.
        float stop = m;
        bool seen = false;
        while (!seen && m < end) {
            ivec3 block = clamp(ivec3(floor(ray_at(m) / block_size)), ivec3(0), block_last);
            int n = texelFetch(occupancy, block, 0).r;
            float r = float(abs(n));
            vec3 corner = (vec3(block) + mix(vec3(1.0 - r), vec3(r), far_side)) * block_size;
            vec3 leave = mix((corner - ray_point) * inverse, vec3(1e30), across);
            float out_at = min(min(leave.x, leave.y), leave.z);
            float plane = floor(min(out_at, end));
            bool leap = n < 0 && (plane > m || out_at >= end);
            m = leap ? (out_at >= end ? end : plane) : m;
            seen = !leap;
            // Up to the first plane behind what is seen; at least one.
            float next = floor(m) + 1.0;
            stop = min(n > 0 ? max(ceil(out_at), next) : next, end);
        }
        m = m < end ? march(m, stop) : m;
    }
#else
    if (m < end) m = march(m, end);
#endif
    vec4 c = picture();
    pixel_color = c + (1.0 - c.a) * background;
    pixel_samples = finished() ? -samples : samples;
}
