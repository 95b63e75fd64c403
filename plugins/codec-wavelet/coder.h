// What every entropy coder of details looks like: one component of a family in, bytes out.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/byte_io.h"
#include "plugins/codec-wavelet/family.h"

namespace voxloom::wavelet {

enum class CoderKind : std::uint8_t { paper = 0, dense = 1, blocks = 2, fast = 3 };  // blocks is only read
inline constexpr int kCoderKinds = 4;
std::string_view name_of(CoderKind kind);

// Immutable once it is trained or read: any thread may encode and decode at any time. What one call
// writes, one call reads, with nothing from any other family.
class Coder {
  public:
    virtual ~Coder() = default;
    virtual CoderKind kind() const = 0;

    // Learns what families of this volume look like, in the order of the calls. Before the first
    // encode(); several passes over the same families are allowed.
    virtual void train(const Details&) {}
    // Ends the training. What was learned becomes tables(), in which every decoder finds it again.
    virtual void finish_training() {}
    virtual Bytes tables() const { return {}; }

    // Appends to `out`. Details that are all zero give nothing, and are decoded from nothing.
    virtual void encode(const Details& details, Bytes& out) const = 0;
    // Fills every band of details.q but the low one. Throws Error on what no encoder writes; never
    // reads outside of `in`.
    virtual void decode(std::span<const std::byte> in, Details& details) const = 0;
};

// `tables` are those of the coder that encoded; empty: the state before any training.
// Throws Error when they are corrupt.
std::unique_ptr<Coder> make_coder(CoderKind kind, std::span<const std::byte> tables = {});

bool all_zero(const Details& details);
void clear_bands(Details& details);

}  // namespace voxloom::wavelet
