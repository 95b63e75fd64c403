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
// A difference along one axis, smoothed along the other two: (SIDE, 1-2 SIDE, SIDE) is (1 2 1)/4 for
// Sobel and (1 4 1)/6 for the weights whose leading error is isotropic.
vec3 gradient(vec3 p) {
    float c = level_at(p, 0.0);
    vec3 g = vec3(0.0);
    for (int z = -1; z <= 1; ++z)
        for (int y = -1; y <= 1; ++y)
            for (int x = -1; x <= 1; ++x) {
                vec3 o = vec3(x, y, z);
                vec3 w = mix(vec3(1.0 - 2.0 * SIDE), vec3(SIDE), abs(o));
                g += 0.5 * o * w.yzx * w.zxy * level_at(p + o * VOXEL_STEP, c);
            }
    return g / VOXEL_STEP;
}
