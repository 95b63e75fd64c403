// Classified at the voxels, then interpolated: the texture holds optical depth and colour of one slab of
// the finest level.
struct Sample { vec4 emission; };
Sample observe(vec3 p) { return Sample(max(CLASSIFIED_AT(p), 0.0) * SLAB_STEP); }
vec4 slab(Sample f, Sample b) { return 0.5 * (f.emission + b.emission); }
