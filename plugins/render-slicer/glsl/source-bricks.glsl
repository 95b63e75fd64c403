// Bricks in one texture. A page says which part of space a brick, or several side by side, are drawn in,
// where in the texture they lie, and what they blend into at which corner; a ray is on one page at a time.
uniform sampler3D page_index;         // page of each cell, below 0: none
uniform sampler2D page_table;         // 12 texels a page, 4096 pages a column
uniform vec3 cell_size;               // index coordinates
uniform ivec3 cell_last;
uniform vec3 slot_unit;               // texture coordinate of a texel
uniform vec3 slot_lo;                 // first voxel in the texture, from the page's first own one
uniform vec3 brick_size;              // own voxels of a brick
uniform vec3 brick_hi;                // last voxel in the texture of a brick alone

vec3 page_lo = vec3(1.0), page_hi = vec3(0.0);  // what is drawn on the page, index coordinates
vec3 page_first;                      // the page's first voxel, index coordinates
vec3 page_scale = vec3(1.0);          // voxels of the brick per index step
float page_step = 1.0;                // planes between two slices
float page_layer = 0.0;               // log2 of that
float page_level = 0.0;
vec3 slot_at;                         // texel of the page's first own voxel
vec3 slot_hi;                         // last voxel in the texture
float page_blends = 0.0;              // 1: mixes in its parent; 0: that is the brick itself
vec3 parent_at, parent_from, parent_scale;
vec4 blend_below, blend_above;        // share of the parent at the corners, z low and high
vec3 place_of(vec3 p) { return (slot_at + clamp(p, slot_lo, slot_hi) + 0.5) * slot_unit; }

// Turns to the page of a point; false where nothing is drawn. Nothing here is left out by a condition: SIMD
// machines run both sides of one, and the body of a loop at least once.
bool open_page(vec3 p) {
    ivec3 cell = clamp(ivec3(floor(p / cell_size)), ivec3(0), cell_last);
    float page = texelFetch(page_index, cell, 0).r;
    bool there = page >= 0.0;
    int i = int(max(page, 0.0));
    ivec2 at = ivec2((i >> 12) * 12, i & 4095);
    vec4 lo = texelFetch(page_table, at, 0), hi = texelFetch(page_table, at + ivec2(1, 0), 0);
    vec4 first = texelFetch(page_table, at + ivec2(2, 0), 0);
    page_step = lo.w;
    page_layer = hi.w;
    page_first = first.xyz;
    vec4 slot = texelFetch(page_table, at + ivec2(3, 0), 0);
    slot_at = slot.xyz;
    page_level = slot.w;
    page_scale = texelFetch(page_table, at + ivec2(4, 0), 0).xyz;
    slot_hi = texelFetch(page_table, at + ivec2(5, 0), 0).xyz;
    // A cell at the volume's border reaches beyond it, as the ray ends there.
    page_lo = mix(mix(vec3(cell) * cell_size, vec3(-1e6), equal(cell, ivec3(0))), lo.xyz, bvec3(there));
    page_hi = mix(mix(vec3(cell + 1) * cell_size, vec3(1e9), equal(cell, cell_last)), hi.xyz, bvec3(there));
#ifdef BLENDED
    page_blends = first.w;
    parent_at = texelFetch(page_table, at + ivec2(6, 0), 0).xyz;
    parent_from = texelFetch(page_table, at + ivec2(7, 0), 0).xyz;
    parent_scale = texelFetch(page_table, at + ivec2(8, 0), 0).xyz;
    blend_below = texelFetch(page_table, at + ivec2(9, 0), 0);
    blend_above = texelFetch(page_table, at + ivec2(10, 0), 0);
#endif
    return there;
}
#ifdef BLENDED
float share_of_parent(vec3 p) {
    vec3 f = clamp((p - page_first) * page_scale / brick_size, 0.0, 1.0);
    vec4 z = mix(blend_below, blend_above, f.z);
    vec2 y = mix(z.xy, z.zw, f.y);
    return page_blends * mix(y.x, y.y, f.x);
}
#else
float share_of_parent(vec3 p) { return 0.0; }
#endif
