// Bricks of one level, which lie in the texture as they do in space: one page over everything.
uniform vec3 page_scale;              // voxels of the level per index step
uniform vec3 slot_unit, slot_base;    // from a voxel to a texture coordinate
uniform vec3 slot_at;                 // texel of the level's first voxel
uniform vec3 slot_lo, slot_hi;        // first and last voxel in the texture
const vec3 page_first = vec3(0.0);
vec3 place_of(vec3 p) { return p * slot_unit + slot_base; }
