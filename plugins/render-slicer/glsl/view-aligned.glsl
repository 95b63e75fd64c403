// View-aligned planes through a box of voxels, with leaps over blocks that cannot be seen.
//
// The pixels of a small square leap together, along the ray through its middle: their rays meet a
// plane within `square_reach` voxels of it, by which the blocks' ranges are wider. So neighbours run
// the same loops, which on SIMD machines is worth more than leaping each on its own.
layout(location = 0) out vec4 pixel_color;
layout(location = 1) out float pixel_samples;  // negative where opacity ended the ray

uniform vec3 box_lo, box_hi;         // index coordinates
uniform float near_plane;            // m before which nothing is drawn
uniform vec4 background;             // premultiplied
uniform float square;                // pixels on its side
uniform float square_reach;          // index units
#ifdef SKIPPING
uniform isampler3D occupancy;        // n > 0: all blocks nearer than n are seen; n < 0: none of them is
uniform vec3 block_size;
uniform ivec3 block_last;
#ifdef CEILING
uniform sampler3D ceiling;           // largest u of every block
#endif
#endif

// Where a ray is inside of [lo, hi]: from x to y, empty when x > y.
vec2 inside(vec3 point, vec3 direction, vec3 lo, vec3 hi) {
    bvec3 across = lessThan(abs(direction), vec3(1e-20));
    vec3 inverse = 1.0 / mix(direction, vec3(1.0), across);
    vec3 a = (lo - point) * inverse, b = (hi - point) * inverse;
    vec3 enter = min(a, b), leave = max(a, b);
    // Parallel to a pair of faces: always between them, or never.
    bvec3 between = bvec3(uvec3(greaterThanEqual(point, lo)) * uvec3(lessThanEqual(point, hi)));
    enter = mix(enter, mix(vec3(1e30), vec3(-1e30), between), across);
    leave = mix(leave, vec3(1e30), across);
    return vec2(max(max(enter.x, enter.y), enter.z), min(min(leave.x, leave.y), leave.z));
}

void main() {
    // The ray of the square first, then the pixel's own.
    aim((floor(gl_FragCoord.xy / square) + 0.5) * square * pixel_scale);
    vec3 point = ray_point, direction = ray_step;
    vec2 common_range = inside(point, direction, box_lo - square_reach, box_hi + square_reach);
    float k = floor(max(common_range.x, near_plane)), end = ceil(common_range.y);

    aim(gl_FragCoord.xy * pixel_scale);
    vec2 range = inside(ray_point, ray_step, box_lo, box_hi);
    ray_first = max(range.x, near_plane);
    ray_last = range.y;
    end = ray_first < ray_last ? end : k;
#ifdef SKIPPING
    bvec3 across = lessThan(abs(direction), vec3(1e-20));
    vec3 inverse = 1.0 / mix(direction, vec3(1.0), across);
    vec3 far_side = vec3(greaterThan(direction, vec3(0.0)));
    vec3 inverse_size = 1.0 / block_size;
    if (k < end) do {
        // Leap while nothing near is seen, each time to the last plane of what is known of.
        float stop = k;
        do {
            ivec3 block = clamp(ivec3((point + k * direction) * inverse_size), ivec3(0), block_last);
            int n = texelFetch(occupancy, block, 0).r;
#ifdef CEILING
            // A block of no larger value than the ray has met is as good as empty.
            if (n > 0) n = texelFetch(ceiling, block, 0).r > largest ? 1 : -1;
#endif
            float r = float(abs(n));
            vec3 corner = (vec3(block) + mix(vec3(1.0 - r), vec3(r), far_side)) * block_size;
            vec3 leave = mix((corner - point) * inverse, vec3(1e30), across);
            float out_at = min(min(min(leave.x, leave.y), leave.z), end);
            // Unseen: on to the last plane before that ends. Seen, or too near its end: the slabs up
            // to the first plane behind it, at least one.
            float next = n < 0 ? floor(out_at) : k;
            stop = next > k ? next : max(n > 0 ? ceil(out_at) : k, k + 1.0);
            k = next > k ? next : k;
        } while (k < end && stop <= k);
        if (k < end) MARCH(k, stop);
        k = stop;
    } while (k < end && !finished());
#else
    if (k < end) MARCH(k, end);
#endif
    vec4 c = picture();
    pixel_color = c + (1.0 - c.a) * background;
    pixel_samples = finished() ? -samples : samples;
}
