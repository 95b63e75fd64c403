// One ray over the slabs from m to end, whose front and back samples are known at the planes. Returns
// where it stopped.
float march(float m, float end) {
    Sample front = observe(ray_at(m));
    while (m < end && !finished()) {
        float next = min(floor(m) + 1.0, end);
        Sample back = observe(ray_at(next));
        add_slab(slab(front, back), (next - m) * slab_length);
        samples += 1.0;
        front = back;
        m = next;
    }
    return m;
}
