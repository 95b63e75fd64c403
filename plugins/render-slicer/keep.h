// What drawing needs again for the next camera: textures, tables, ranges.
//
// Everything is kept under the object that it was made from and a key, within a byte limit, least
// recently used out first; what was made from an object that is gone goes with it. Used on the OpenGL
// thread alone, where textures may die at once.
#pragma once

#include <algorithm>
#include <cstdint>
#include <list>
#include <memory>

#include "core/base/hash.h"

namespace voxloom::slicer {

class Keep {
  public:
    static Keep& instance() {
        static Keep& keep = *new Keep;  // outlives the OpenGL thread, whose end frees its objects
        return keep;
    }

    // The thing of `key` made from `owner`, or make(bytes) -> shared_ptr<T>, which adds what it holds.
    template <class T, class Make>
    std::shared_ptr<const T> get(const std::shared_ptr<const void>& owner, const Hash& key,
                                 const Make& make) {
        for (auto it = entries_.begin(); it != entries_.end(); ++it)
            if (it->key == key && same_owner(it->owner, owner)) {
                entries_.splice(entries_.begin(), entries_, it);
                return std::static_pointer_cast<const T>(it->thing);
            }
        std::uint64_t bytes = 0;
        std::shared_ptr<const T> thing = make(bytes);
        entries_.push_front({owner, key, thing, bytes});
        peak_ = std::max(peak_, held());
        return thing;
    }

    // A picture begins: make_room() keeps this limit, and peak() is of the picture.
    void begin(std::uint64_t byte_limit) {
        limit_ = byte_limit;
        shrink(limit_);
        peak_ = held();
    }
    // Drops what nobody holds, least recently used first, until so much more is within the limit; false
    // where it cannot be.
    bool make_room(std::uint64_t bytes) {
        std::uint64_t now = held();
        for (auto it = entries_.end(); it != entries_.begin() && now + bytes > limit_;) {
            --it;
            if (it->thing.use_count() > 1 || it->bytes == 0) continue;
            now -= it->bytes;
            it = entries_.erase(it);
        }
        return now + bytes <= limit_;
    }
    std::uint64_t held() const {
        std::uint64_t sum = 0;
        for (const Entry& e : entries_) sum += e.bytes;
        return sum;
    }
    std::uint64_t peak() const { return peak_; }  // bytes, since begin()

    // Forgets one thing; it dies when nobody holds it any more.
    void drop(const std::shared_ptr<const void>& owner, const Hash& key) {
        entries_.remove_if([&](const Entry& e) { return e.key == key && same_owner(e.owner, owner); });
    }

    // Drops what is over the limit, or too much to look through, or has lost its owner.
    void shrink(std::uint64_t byte_limit) {
        entries_.remove_if([](const Entry& e) { return e.owner.expired(); });
        std::uint64_t now = held();
        while (!entries_.empty() && (now > byte_limit || entries_.size() > kMostThings)) {
            now -= entries_.back().bytes;
            entries_.pop_back();
        }
    }

    // A camera that moves leaves a small table for every selection, and each is looked at to find another.
    static constexpr std::size_t kMostThings = 512;

  private:
    struct Entry {
        std::weak_ptr<const void> owner;
        Hash key;
        std::shared_ptr<const void> thing;
        std::uint64_t bytes;
    };
    static bool same_owner(const std::weak_ptr<const void>& a, const std::shared_ptr<const void>& b) {
        return !a.owner_before(b) && !b.owner_before(a);
    }
    std::list<Entry> entries_;
    std::uint64_t limit_ = ~std::uint64_t(0), peak_ = 0;
};

}  // namespace voxloom::slicer
