// A few synthetic node types for tests of documents, checks and evaluation: cheap, exact,
// countable.
#pragma once

#include <map>
#include <mutex>
#include <string>

#include "core/plugin/registry.h"

namespace voxloom::testing {

// How often each node was described and evaluated, by id of the node's type and by node.
// Outlives every run of the registry that counts into it.
class FakeCounts {
  public:
    void described(const std::string& type);
    void evaluated(const std::string& node);
    int descriptions(const std::string& type) const;
    int evaluations(const std::string& node) const;
    int evaluations() const;
    void clear();

  private:
    mutable std::mutex mutex_;
    std::map<std::string, int> described_, evaluated_;
};

// fake.source    -> volume         size^3 u8 or f32 voxels, all of them `value`; reads `path` if
// given fake.add       volume -> volume  adds `amount`; takes `milliseconds`, in steps that can be
// cancelled fake.sum       a, b? -> volume   adds two volumes voxel by voxel fake.gather    many ->
// volume    adds any number of volumes fake.table     volume -> table, transfer   first voxel as a
// table; and a transfer function fake.write     volume ->         writes the first voxel as text to
// `file` fake.every     -> image          has a parameter of every kind; describes an image of
// `vector` fake.fail      volume? -> volume evaluating fails with `message`; describing too, with
// when: describe
Registry fake_registry(FakeCounts* counts = nullptr);

}  // namespace voxloom::testing
