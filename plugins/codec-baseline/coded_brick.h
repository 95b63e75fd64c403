// One brick and its bytes: a first byte that says how it was kept, then the codec's own.
#pragma once

#include "core/base/buffer.h"
#include "plugins/codec-baseline/codec.h"

namespace voxloom::baseline {

enum class Kept : std::uint8_t {
    as_set,    // by the file's setting
    lossless,  // by the codec without loss, where the setting could not keep NaN or the bound on the error
    raw,       // as it is, where the codec could not help
};

struct CodedBrick {
    Bytes bytes;
    Buffer decoded;  // what decoding gives
    Kept kept = Kept::as_set;
    std::int64_t codec_ns = 0;  // CPU time of the codec's encoding alone
};

// Codes a brick and decodes it again, so that what is promised is known: no value is off by more than `bound`, what is
// not finite stays, and without loss every bit does.
CodedBrick code_brick(const Codec& codec, const Form& form, const Setting& setting, double bound,
                      std::span<const std::byte> voxels);

// Throws Error, without the brick's name, for damaged bytes.
void decode_brick(const Codec& codec, const Form& form, const Setting& setting, std::span<const std::byte> bytes,
                  std::span<std::byte> voxels);

// Errors over the finite values, in their order.
struct BrickError {
    double squares = 0, largest = 0;
    std::uint64_t finite = 0;
};
BrickError error_of(const Form& form, std::span<const std::byte> truth, std::span<const std::byte> given);

}  // namespace voxloom::baseline
