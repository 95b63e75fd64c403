// Catmull-Rom, the interpolating cubic. Where the texture unit filters in full precision the middle
// two taps of an axis are one linear fetch: 27 instead of 64.
vec4 reconstruct(vec3 p) {
    vec3 i = floor(p), f = p - i;
    vec3 w0 = f * (-0.5 + f * (1.0 - 0.5 * f));
    vec3 w1 = 1.0 + f * f * (-2.5 + 1.5 * f);
    vec3 w2 = f * (0.5 + f * (2.0 - 1.5 * f));
    vec3 w3 = f * f * (-0.5 + 0.5 * f);
#ifdef EXACT_FILTER
    vec3 at[3] = vec3[](i - 1.0, i + w2 / (w1 + w2), i + 2.0);
    vec3 w[3] = vec3[](w0, w1 + w2, w3);
    vec4 sum = vec4(0.0);
    for (int z = 0; z < 3; ++z)
        for (int y = 0; y < 3; ++y)
            for (int x = 0; x < 3; ++x)
                sum += w[x].x * w[y].y * w[z].z * sample_linear(vec3(at[x].x, at[y].y, at[z].z));
#else
    vec3 w[4] = vec3[](w0, w1, w2, w3);
    vec4 sum = vec4(0.0);
    for (int z = 0; z < 4; ++z)
        for (int y = 0; y < 4; ++y)
            for (int x = 0; x < 4; ++x)
                sum += w[x].x * w[y].y * w[z].z * fetch_voxel(ivec3(i) + ivec3(x, y, z) - 1);
#endif
    return sum;
}
