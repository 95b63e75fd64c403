float level_at(vec3 p, float centre) {
    vec4 t = reconstruct(p);
#ifdef COLOR
    return dot(t.rgb, vec3(0.2126, 0.7152, 0.0722));
#elif defined(VALIDITY)
    return t.y > 1e-4 ? t.x / t.y : centre;
#else
    return t.x;
#endif
}
// Shifts of whole voxels commute with the interpolation, so this is what stored gradients give; the
// clamp replicates the border as they do.
vec3 gradient(vec3 p) {
    float c = level_at(p, 0.0);
    vec3 g;
    for (int a = 0; a < 3; ++a) {
        vec3 e = vec3(a == 0, a == 1, a == 2);
        e *= VOXEL_STEP;
        g[a] = 0.5 * (level_at(p + e, c) - level_at(p - e, c));
    }
    return g / VOXEL_STEP;
}
