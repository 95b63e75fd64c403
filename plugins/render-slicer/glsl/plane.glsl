// A cutting plane through bricks: a fragment finds its point of the plane, opens the page there, and
// classifies what it reads.
layout(location = 0) out vec4 pixel_color;

uniform vec3 origin_0, origin_x, origin_y;   // of the ray of pixel (x, y), index coordinates
uniform vec3 along_0, along_x, along_y;      // its direction, one unit of depth long
uniform vec4 cut;                            // the plane, index coordinates
uniform float nearest;                       // depth
uniform vec3 box_lo, box_hi;                 // index coordinates
uniform float opaque;                        // 1: whatever the opacity
uniform float part;                          // 0: own and parent mixed, then classified; 1, 2: one of them, weighted
uniform float borders;                       // width of a brick's border in pixels

vec4 colour_of(vec4 texel) {
    vec2 s = scalar_of(texel);
    vec4 e = emission_at(s.x) * s.y;
#ifdef COLOR
    e.a *= clamp(texel.a, 0.0, 1.0);
    e.rgb = clamp(texel.rgb, 0.0, 1.0) * e.a;
#endif
    float alpha = mix(1.0 - exp2(-1.44269504 * e.a), s.y, opaque);
    return vec4(e.rgb / max(e.a, 1e-37), 1.0) * alpha;
}

// LaMar's colours of levels, from the finest on.
vec4 border_of(float level) {
    int l = int(level + 0.5) & 3;
    return vec4(l == 1 || l == 3, l >= 2, 0.0, 1.0);
}

void main() {
    vec2 pixel = gl_FragCoord.xy;
    vec3 o = origin_0 + pixel.x * origin_x + pixel.y * origin_y;
    vec3 d = along_0 + pixel.x * along_x + pixel.y * along_y;
    float approach = dot(cut.xyz, d);
    float t = -(dot(cut.xyz, o) + cut.w) / (abs(approach) > 1e-20 ? approach : 1e-20);
    vec3 p = o + t * d;
    vec3 footprint = max(fwidth(p), vec3(1e-6));
    const float slack = 1e-3;  // voxels: a plane in the volume's face is in the volume
    bool inside_box = all(greaterThanEqual(p, box_lo - slack)) && all(lessThanEqual(p, box_hi + slack)) &&
                      abs(approach) > 1e-20 && t >= nearest;
    p = clamp(p, box_lo, box_hi);
    // A plane in a face between bricks is drawn by the one behind it; the step is far below a voxel.
    bool there = open_page(p + 1e-4 * normalize(cut.xyz)) && inside_box;

    float share = part > 0.5 ? share_of_parent(p) : 0.0;
    vec4 c = colour_of(part > 1.5 ? brick_parent(p) : part > 0.5 ? brick_own(p) : reconstruct(p));
    // Axes across which the plane does not go have no border to show.
    vec3 away = min(abs(p - page_lo), abs(page_hi - p)) / footprint;
    away = mix(away, vec3(1e9), lessThanEqual(footprint, vec3(2e-6)));
    float line = clamp(0.5 * borders + 0.5 - min(min(away.x, away.y), away.z), 0.0, 1.0);
    c = mix(c, border_of(page_level), borders > 0.0 ? line : 0.0);
    float weight = part > 1.5 ? share : 1.0 - share;
    pixel_color = there ? c * weight : vec4(0.0);
}
