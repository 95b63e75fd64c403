// Voxels that stand in a file in the order of memory: as they are, or in one gzip or zlib stream.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "core/data/volume.h"

namespace voxloom {

// How samples stand in the file. 64-bit integers become f64 (the volume's type is f64 then), which
// holds them exactly up to 2^53; a sample beyond that is an Error.
struct Samples {
    enum class Wide { no, i64, u64 } wide = Wide::no;
    bool swap = false;  // the file's byte order is not this machine's
};

// Brings `bytes`, as they stand in the file, into memory's form, in place. `sample_bytes` is the size
// of one component. `what` names the source in messages.
void to_native(std::span<std::byte> bytes, std::size_t sample_bytes, const Samples& samples,
               const std::filesystem::path& what);

struct StoredVoxels {
    struct Piece {
        std::filesystem::path file;
        std::uint64_t offset = 0;  // of the first voxel (packed: of the stream)
    };
    std::vector<Piece> pieces;     // each holds the same share; packed: exactly one
    bool packed = false;           // one gzip or zlib stream
    std::uint64_t skip = 0;        // packed: unpacked bytes before the first voxel
    bool exact = false;            // more bytes than the voxels need are an Error
    Samples samples;
};

// Says, by the sizes of the files alone, whether `bytes` bytes of voxels can be there; throws Error
// where they cannot. Compressed data: deflate packs no more than 1032 to 1.
void check_size(const StoredVoxels& stored, std::uint64_t bytes);

// One step of uncompressed voxels, read by region with pread.
VolumePtr stored_volume(VolumeDesc desc, StoredVoxels stored, std::int64_t step,
                        std::int64_t steps);

// Steps packed one after the other in one stream. Reading forward unpacks each step once; the state
// at the beginning of every step that was reached is kept (about 50 KB), so going back costs that
// step alone. Memory is that and the steps in use, never the whole file. Thread-safe.
class PackedSteps {
  public:
    PackedSteps(StoredVoxels stored, std::int64_t steps, std::size_t sample_bytes);
    ~PackedSteps();
    // Unpacks `bytes` bytes and the end of the stream, keeping nothing: it is whole, or an Error.
    void skip_through(std::uint64_t bytes, const std::stop_token& stop);
    // `out` has the bytes of one step, the same for every step.
    void read(std::int64_t step, std::span<std::byte> out, const std::stop_token& stop);

  private:
    struct Inflater;
    void skip(std::uint64_t bytes, const std::stop_token& stop);
    std::size_t unpack(std::span<std::byte> out, const std::stop_token& stop);
    void advance(std::span<std::byte> out, const std::stop_token& stop);
    void finish(const std::stop_token& stop);

    StoredVoxels stored_;
    std::int64_t steps_;
    std::size_t sample_bytes_;
    std::mutex mutex_;
    std::int64_t next_ = 0;  // the step that the inflater stands before
    std::unique_ptr<Inflater> inflater_;
    std::vector<std::unique_ptr<Inflater>> starts_;  // copies of it, by step
};

}  // namespace voxloom
