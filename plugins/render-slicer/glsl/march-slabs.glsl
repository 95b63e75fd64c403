// The slabs between planes k and end; front and back samples are known at the planes.
void march(float k, float end) {
    float m = on_ray(k);
    Sample front = observe(ray_at(m));
    while (k < end && !finished()) {
        k += PLANE_STEP;
        float next = on_ray(k);
        Sample back = observe(ray_at(next));
        add_slab(slab(front, back), (next - m) * slab_length);
        samples += 1.0;
        front = back;
        m = next;
    }
}
