// The slabs between planes k and end, at least one; front and back samples are known at the planes. SIMD
// machines run what a loop's condition stands before once more with nobody in it: so it stands behind.
void march(float k, float end) {
    float m = on_ray(k);
    Sample front = observe(ray_at(m));
    do {
        k += PLANE_STEP;
        float next = on_ray(k);
        Sample back = observe(ray_at(next));
        add_slab(slab(front, back), (next - m) * slab_length);
        samples += 1.0;
        front = back;
        m = next;
    } while (k < end && !finished());
}
