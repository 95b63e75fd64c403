// Bricks of one level, which lie in the texture as they do in space: one page over everything.
uniform vec3 slot_at;                 // texel of the level's first voxel
uniform vec3 slot_lo, slot_hi;        // first and last voxel in the texture
uniform vec3 page_scale;              // voxels of the level per index step
const vec3 page_first = vec3(0.0);
