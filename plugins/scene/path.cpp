#include "plugins/scene/path.h"

#include <algorithm>

namespace voxloom::scene {

namespace {

// Velocity at keyframe i of the values f.
template <class F>
glm::dvec3 velocity(std::span<const Keyframe> keys, std::size_t i, const F& f) {
    auto slope = [&](std::size_t a, std::size_t b) { return (f(keys[b]) - f(keys[a])) / (keys[b].time - keys[a].time); };
    if (keys.size() < 2) return glm::dvec3(0);
    if (i == 0) return slope(0, 1);
    if (i + 1 == keys.size()) return slope(i - 1, i);
    const double before = keys[i].time - keys[i - 1].time, after = keys[i + 1].time - keys[i].time;
    return (after * slope(i - 1, i) + before * slope(i, i + 1)) / (before + after);
}

template <class F>
glm::dvec3 between(std::span<const Keyframe> keys, std::size_t i, double time, const F& f) {
    const double h = keys[i + 1].time - keys[i].time, u = (time - keys[i].time) / h;
    const double a = u * u * (3 - 2 * u), b = u * (1 - u) * (1 - u) * h, c = u * u * (u - 1) * h;
    return f(keys[i]) * (1 - a) + f(keys[i + 1]) * a + velocity(keys, i, f) * b + velocity(keys, i + 1, f) * c;
}

}  // namespace

Keyframe at_time(std::span<const Keyframe> keys, double time) {
    if (time <= keys.front().time) return {time, keys.front().eye, keys.front().target};
    if (time >= keys.back().time) return {time, keys.back().eye, keys.back().target};
    const auto next = std::ranges::upper_bound(keys, time, {}, &Keyframe::time);
    const std::size_t i = std::size_t(next - keys.begin()) - 1;
    return {time, between(keys, i, time, [](const Keyframe& k) { return k.eye; }),
            between(keys, i, time, [](const Keyframe& k) { return k.target; })};
}

}  // namespace voxloom::scene
