#include "app/editor/model/damage.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace voxloom::editor {

namespace {

constexpr std::size_t kMostRects = 6;
constexpr double kMostShare = 0.75;  // of the window; then all of it is drawn
// Pixels that are rather drawn too many than a rectangle more, and for each of a list's triangles: for every rectangle in a
// list all of them are drawn again.
constexpr double kSpare = 4096, kSpareATriangle = 8;

bool contains(const Rect& a, const Rect& b) { return glm::all(glm::lessThanEqual(a.lo, b.lo)) && glm::all(glm::greaterThanEqual(a.hi, b.hi)); }
double area(const Rect& r) { return double(r.hi.x - r.lo.x) * double(r.hi.y - r.lo.y); }
Rect both(const Rect& a, const Rect& b) { return {glm::min(a.lo, b.lo), glm::max(a.hi, b.hi)}; }
double waste(const Rect& a, const Rect& b) { return area(both(a, b)) - area(a) - area(b); }

class Rects {
  public:
    Rects(glm::ivec2 size, std::size_t triangles) : size_(size), spare_(kSpare + kSpareATriangle * double(triangles)) {}

    void add(Rect r) {
        r = {glm::clamp(r.lo, glm::ivec2(0), size_), glm::clamp(r.hi, glm::ivec2(0), size_)};
        if (r.lo.x >= r.hi.x || r.lo.y >= r.hi.y) return;
        if (std::ranges::any_of(rects_, [&](const Rect& other) { return contains(other, r); })) return;
        // What is near is one; that may bring it near to others.
        for (bool merged = true; merged;) {
            const auto near = std::ranges::find_if(rects_, [&](const Rect& other) { return waste(r, other) <= spare_; });
            merged = near != rects_.end();
            if (!merged) break;
            r = both(r, *near);
            rects_.erase(near);
        }
        rects_.push_back(r);
        double sum = 0;
        for (const Rect& one : rects_) sum += area(one);
        most_ = most_ || sum > kMostShare * area({glm::ivec2(0), size_});
        if (rects_.size() <= kMostRects) return;
        std::size_t best = 1, with = 0;
        for (std::size_t i = 1; i < rects_.size(); ++i)
            for (std::size_t k = 0; k < i; ++k)
                if (waste(rects_[i], rects_[k]) < waste(rects_[best], rects_[with])) best = i, with = k;
        rects_[with] = both(rects_[with], rects_[best]);
        rects_.erase(rects_.begin() + std::ptrdiff_t(best));
    }
    // So much of the window is to be drawn that nobody needs to look further.
    bool most() const { return most_; }
    std::vector<Rect> take() { return most_ ? std::vector<Rect>{{glm::ivec2(0), size_}} : std::move(rects_); }

  private:
    glm::ivec2 size_;
    double spare_;
    bool most_ = false;
    std::vector<Rect> rects_;
};

// The triangles of a list by their number.
class Triangles {
  public:
    explicit Triangles(const DrawnList& list) : list_(list) {
        for (std::uint32_t c = 0; c < list.commands.size(); ++c) command_.insert(command_.end(), list.commands[c].count / 3, c);
        std::uint32_t sum = 0;
        for (const DrawnCommand& command : list.commands) {
            before_.push_back(sum);
            sum += command.count / 3;
        }
    }
    std::size_t size() const { return command_.size(); }
    const DrawnCommand& command(std::size_t i) const { return list_.commands[command_[i]]; }
    const DrawnVertex& vertex(std::size_t i, std::size_t k) const {
        const DrawnCommand& c = command(i);
        return list_.vertices[c.first_vertex + list_.indices[c.first_index + 3 * (i - before_[command_[i]]) + k]];
    }
    // A pixel more on each side, for whatever is drawn along edges.
    Rect covers(std::size_t i) const {
        const glm::vec4& clip = command(i).clip;
        glm::vec2 lo(clip.z, clip.w), hi(clip.x, clip.y);
        for (std::size_t k = 0; k < 3; ++k) lo = glm::min(lo, vertex(i, k).position), hi = glm::max(hi, vertex(i, k).position);
        lo = glm::max(lo - 1.f, glm::vec2(clip.x, clip.y)), hi = glm::min(hi + 1.f, glm::vec2(clip.z, clip.w));
        constexpr float kFar = 1e6f;  // what is no number of pixels is everything
        if (!(lo.x > -kFar && lo.y > -kFar && hi.x < kFar && hi.y < kFar)) return {glm::ivec2(0), glm::ivec2(int(kFar))};
        return {glm::ivec2(glm::floor(lo)), glm::ivec2(glm::ceil(hi))};
    }

  private:
    const DrawnList& list_;
    std::vector<std::uint32_t> command_, before_;
};

bool same(const Triangles& a, std::size_t i, const Triangles& b, std::size_t k) {
    const DrawnCommand &x = a.command(i), &y = b.command(k);
    if (x.clip != y.clip || x.texture != y.texture) return false;
    for (std::size_t v = 0; v < 3; ++v)
        if (!(a.vertex(i, v) == b.vertex(k, v))) return false;
    return true;
}

// What changes where `before`, which may be nothing, becomes `now`.
Rects compare(const DrawnList& before, const DrawnList& now, glm::ivec2 size) {
    const Triangles a(before), b(now);
    Rects rects(size, std::max(a.size(), b.size()));
    const std::size_t most = std::min(a.size(), b.size());
    if (a.size() == b.size()) {
        for (std::size_t i = 0; i < most && !rects.most(); ++i)
            if (!same(a, i, b, i)) rects.add(a.covers(i)), rects.add(b.covers(i));
        return rects;
    }
    // Something came or went: what is the same before and behind it.
    std::size_t first = 0, last = 0;
    while (first < most && same(a, first, b, first)) ++first;
    while (last < most - first && same(a, a.size() - 1 - last, b, b.size() - 1 - last)) ++last;
    for (std::size_t i = first; i < a.size() - last && !rects.most(); ++i) rects.add(a.covers(i));
    for (std::size_t i = first; i < b.size() - last && !rects.most(); ++i) rects.add(b.covers(i));
    return rects;
}

}  // namespace

std::vector<Rect> damage(const std::vector<DrawnList>& before, const std::vector<DrawnList>& now, glm::ivec2 size) {
    const std::vector<Rect> everything{{glm::ivec2(0), size}};
    std::map<std::string, std::size_t> places;
    for (std::size_t i = 0; i < before.size(); ++i)
        if (!places.emplace(before[i].name, i).second) return everything;
    Rects rects(size, 0);
    auto add = [&](const DrawnList& from, const DrawnList& to) {
        for (const Rect& r : compare(from, to, size).take()) rects.add(r);
    };
    const DrawnList nothing;
    std::size_t next = 0;  // the places of what is in both must rise
    std::vector<bool> met(before.size());
    for (const DrawnList& list : now) {
        const auto found = places.find(list.name);
        if (found == places.end()) {
            add(nothing, list);
            continue;
        }
        if (found->second < next || met[found->second]) return everything;
        met[found->second] = true;
        next = found->second + 1;
        add(before[found->second], list);
    }
    for (std::size_t i = 0; i < before.size(); ++i)
        if (!met[i]) add(before[i], nothing);
    return rects.take();
}

}  // namespace voxloom::editor
