#include "core/graph/evaluate.h"

namespace voxloom {

ResultCache::ResultPtr ResultCache::find(const Hash& key) {
    std::lock_guard lock(mutex_);
    auto it = index_.find(key);
    if (it == index_.end()) return nullptr;
    order_.splice(order_.begin(), order_, it->second);
    return it->second->result;
}

void ResultCache::store(const Hash& key, ResultPtr result) {
    std::lock_guard lock(mutex_);
    if (result->bytes > limit_ || index_.contains(key)) return;
    bytes_ += result->bytes;
    order_.push_front({key, std::move(result)});
    index_[key] = order_.begin();
    shrink();
}

void ResultCache::shrink() {
    while (bytes_ > limit_) {
        bytes_ -= order_.back().result->bytes;
        index_.erase(order_.back().key);
        order_.pop_back();
    }
}

void ResultCache::set_byte_limit(std::uint64_t bytes) {
    std::lock_guard lock(mutex_);
    limit_ = bytes;
    shrink();
}

std::uint64_t ResultCache::bytes() const {
    std::lock_guard lock(mutex_);
    return bytes_;
}

std::size_t ResultCache::size() const {
    std::lock_guard lock(mutex_);
    return order_.size();
}

void ResultCache::clear() {
    std::lock_guard lock(mutex_);
    order_.clear();
    index_.clear();
    bytes_ = 0;
}

}  // namespace voxloom
