#include "stored.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxloom {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kChunk = 4u << 20;  // between looks at the stop token
constexpr std::uint64_t kMostPacked = 1032;  // deflate's limit: 258 bytes from 2 bits

// An open file, read at any position by any thread.
class InputFile {
  public:
    explicit InputFile(const fs::path& path) : path_(path) {
        fd_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
        if (fd_ < 0) fail("{} cannot be opened: {}", path.string(), std::strerror(errno));
    }
    ~InputFile() { ::close(fd_); }
    InputFile(const InputFile&) = delete;
    InputFile& operator=(const InputFile&) = delete;

    // Fewer bytes than asked for only at the end of the file.
    std::size_t read_some(std::uint64_t offset, std::span<std::byte> out) const {
        std::size_t done = 0;
        while (done < out.size()) {
            ssize_t n = ::pread(fd_, out.data() + done, out.size() - done, off_t(offset + done));
            if (n < 0 && errno == EINTR) continue;
            if (n < 0) fail("{} cannot be read: {}", path_.string(), std::strerror(errno));
            if (n == 0) break;
            done += std::size_t(n);
        }
        return done;
    }
    void read(std::uint64_t offset, std::span<std::byte> out, const std::stop_token& stop) const {
        for (std::size_t at = 0; at < out.size();) {
            check_stop(stop);
            auto part = out.subspan(at, std::min<std::size_t>(kChunk, out.size() - at));
            if (std::size_t n = read_some(offset + at, part); n < part.size())
                fail("{} ends at byte {}, inside the voxels; copy it again from its source",
                     path_.string(), offset + at + n);
            at += part.size();
        }
    }
    const fs::path& path() const { return path_; }

  private:
    fs::path path_;
    int fd_ = -1;
};

std::uint64_t file_bytes(const fs::path& path) {
    std::error_code error;
    std::uint64_t size = fs::file_size(path, error);
    if (error) fail("{} cannot be opened: {}", path.string(), error.message());
    return size;
}

template <class Integer>
void widen(std::span<std::byte> bytes, const fs::path& what) {
    for (std::size_t i = 0; i + 8 <= bytes.size(); i += 8) {
        Integer v;
        std::memcpy(&v, bytes.data() + i, 8);
        double d = double(v);
        // Beyond 2^53 neighbours fall together, and what cannot be kept is not passed on.
        if (std::abs(d) > 0x1p53)
            fail("{}: the 64-bit integer {} has no exact double; store the volume as 32-bit "
                 "integers or as floats", what.string(), v);
        std::memcpy(bytes.data() + i, &d, 8);
    }
}

template <class Word>
void swap_words(std::span<std::byte> bytes) {
    for (std::size_t i = 0; i + sizeof(Word) <= bytes.size(); i += sizeof(Word)) {
        Word w;
        std::memcpy(&w, bytes.data() + i, sizeof w);
        if constexpr (sizeof(Word) == 2) w = __builtin_bswap16(w);
        if constexpr (sizeof(Word) == 4) w = __builtin_bswap32(w);
        if constexpr (sizeof(Word) == 8) w = __builtin_bswap64(w);
        std::memcpy(bytes.data() + i, &w, sizeof w);
    }
}

}  // namespace

void to_native(std::span<std::byte> bytes, std::size_t sample_bytes, const Samples& samples,
               const fs::path& what) {
    if (samples.swap) {
        if (sample_bytes == 2) swap_words<std::uint16_t>(bytes);
        if (sample_bytes == 4) swap_words<std::uint32_t>(bytes);
        if (sample_bytes == 8) swap_words<std::uint64_t>(bytes);
    }
    if (samples.wide == Samples::Wide::i64) widen<std::int64_t>(bytes, what);
    if (samples.wide == Samples::Wide::u64) widen<std::uint64_t>(bytes, what);
}

void check_size(const StoredVoxels& stored, std::uint64_t bytes) {
    std::uint64_t share = bytes / stored.pieces.size();
    if (share * stored.pieces.size() != bytes)
        fail("{} data files cannot share {} bytes of voxels evenly; correct the header's list of "
             "files", stored.pieces.size(), bytes);
    for (const StoredVoxels::Piece& piece : stored.pieces) {
        std::uint64_t size = file_bytes(piece.file);
        std::uint64_t there = size > piece.offset ? size - piece.offset : 0;
        if (stored.packed) {
            if (bytes > 0 && there <= bytes / kMostPacked)
                fail("{} is cut short: {} of compressed data cannot hold the {} of voxels that its "
                     "header promises; copy it again from its source", piece.file.string(),
                     human_bytes(double(there)), human_bytes(double(bytes)));
        } else if (there < share) {
            fail("{} is cut short: it has {} bytes of voxels where its header promises {}; copy it "
                 "again from its source", piece.file.string(), there, share);
        } else if (stored.exact && there > share) {
            fail("{} has {} bytes of voxels, {} more than the description says; correct dims, type, "
                 "components or offset", piece.file.string(), there, there - share);
        }
    }
}

namespace {

class StoredVolume final : public Volume {
  public:
    StoredVolume(VolumeDesc desc, StoredVoxels stored, std::int64_t step, std::int64_t steps)
        : Volume(std::move(desc)), stored_(std::move(stored)) {
        const std::uint64_t bytes = this->desc().dense_bytes();
        first_ = bytes * std::uint64_t(step);
        share_ = bytes * std::uint64_t(steps) / stored_.pieces.size();
    }

    void read(const Box& box, std::span<std::byte> out, const std::stop_token& stop) const override {
        assert(out.size() == box.voxels() * desc().voxel_bytes());
        if (box.empty()) return;
        const Index3 dims = desc().dims, n = box.dims();
        const std::uint64_t voxel = desc().voxel_bytes();
        const std::uint64_t row = std::uint64_t(n.x) * voxel;
        Open open;
        Buffer rows;
        if (n.x == dims.x && n.y == dims.y) {
            read_bytes(at(box.lo), out, open, stop);
        } else {
            // From the first to the last row of a slice in one go, where that is not much more than
            // what is asked for; else row by row.
            const std::uint64_t stride = std::uint64_t(dims.x) * voxel;
            const std::uint64_t span = std::uint64_t(n.y - 1) * stride + row;
            const bool at_once = span <= kChunk || span <= 2 * row * std::uint64_t(n.y);
            if (at_once) rows = Buffer(span, "rows of " + desc().name);
            for (std::int64_t z = 0; z < n.z; ++z) {
                check_stop(stop);
                if (at_once) read_bytes(at(box.lo + Index3(0, 0, z)), rows.bytes(), open, stop);
                for (std::int64_t y = 0; y < n.y; ++y) {
                    auto to = out.subspan(std::uint64_t(z * n.y + y) * row, row);
                    if (at_once)
                        std::memcpy(to.data(), rows.data() + std::uint64_t(y) * stride, row);
                    else
                        read_bytes(at(box.lo + Index3(0, y, z)), to, open, stop);
                }
            }
        }
        to_native(out, bytes_of(desc().type), stored_.samples, stored_.pieces.front().file);
    }

  private:
    // The piece that was read from last: most reads stay in one.
    struct Open {
        std::size_t piece = 0;
        std::optional<InputFile> file;
    };

    std::uint64_t at(Index3 i) const {
        const Index3 dims = desc().dims;
        return first_ + std::uint64_t((i.z * dims.y + i.y) * dims.x + i.x) * desc().voxel_bytes();
    }

    void read_bytes(std::uint64_t from, std::span<std::byte> out, Open& open,
                    const std::stop_token& stop) const {
        while (!out.empty()) {
            const std::size_t piece = std::size_t(from / share_);
            const std::uint64_t inside = from % share_;
            if (!open.file || open.piece != piece) {
                open.file.emplace(stored_.pieces[piece].file);
                open.piece = piece;
            }
            auto part = out.first(std::min<std::uint64_t>(out.size(), share_ - inside));
            open.file->read(stored_.pieces[piece].offset + inside, part, stop);
            out = out.subspan(part.size());
            from += part.size();
        }
    }

    StoredVoxels stored_;
    std::uint64_t first_ = 0, share_ = 0;
};

}  // namespace

VolumePtr stored_volume(VolumeDesc desc, StoredVoxels stored, std::int64_t step,
                        std::int64_t steps) {
    assert(!stored.packed);
    return std::make_shared<StoredVolume>(std::move(desc), std::move(stored), step, steps);
}

// --- packed ----------------------------------------------------------------------------------------

// A position in a stream: zlib's state and where its next input stands in the file. Input that was
// read ahead is not part of it, so that a copy is small.
struct PackedSteps::Inflater {
    z_stream z{};
    std::uint64_t next_input;
    bool ended = false;

    explicit Inflater(std::uint64_t offset) : next_input(offset) {
        // 15 bits of window; +32: gzip or zlib, as the stream says.
        if (inflateInit2(&z, 15 + 32) != Z_OK) fail("zlib cannot start: no memory");
    }
    Inflater(Inflater& other) : next_input(other.next_input), ended(other.ended) {
        if (inflateCopy(&z, &other.z) != Z_OK) fail("zlib cannot copy its state: no memory");
        z.avail_in = 0;
    }
    ~Inflater() { inflateEnd(&z); }
};

PackedSteps::PackedSteps(StoredVoxels stored, std::int64_t steps, std::size_t sample_bytes)
    : stored_(std::move(stored)), steps_(steps), sample_bytes_(sample_bytes),
      starts_(std::size_t(steps)) {
    assert(stored_.packed && stored_.pieces.size() == 1);
}

PackedSteps::~PackedSteps() = default;

void PackedSteps::read(std::int64_t step, std::span<std::byte> out, const std::stop_token& stop) {
    assert(step >= 0 && step < steps_);
    std::lock_guard lock(mutex_);
    try {
        // From the nearest start at or before the step; `next_` is one of them.
        std::int64_t from = step;
        while (from > 0 && !starts_[std::size_t(from)]) --from;
        if (!inflater_ || next_ > step || next_ < from) {
            if (starts_[std::size_t(from)]) {
                inflater_ = std::make_unique<Inflater>(*starts_[std::size_t(from)]);
            } else {
                inflater_ = std::make_unique<Inflater>(stored_.pieces.front().offset);
                skip(stored_.skip, stop);
            }
            next_ = from;
        }
        // `out` serves as the place for the steps before it, too.
        for (; next_ <= step; ++next_) {
            if (steps_ > 1 && !starts_[std::size_t(next_)])
                starts_[std::size_t(next_)] = std::make_unique<Inflater>(*inflater_);
            advance(out, stop);
        }
        if (next_ == steps_) {
            finish(stop);
            inflater_.reset();
        }
    } catch (...) {
        inflater_.reset();
        throw;
    }
    to_native(out, sample_bytes_, stored_.samples, stored_.pieces.front().file);
}

void PackedSteps::skip(std::uint64_t bytes, const std::stop_token& stop) {
    std::vector<std::byte> place(std::min<std::uint64_t>(bytes, 1 << 20));
    for (std::uint64_t left = bytes, n; left > 0; left -= n) {
        n = std::min<std::uint64_t>(left, place.size());
        advance({place.data(), n}, stop);
    }
}

void PackedSteps::skip_through(std::uint64_t bytes, const std::stop_token& stop) {
    std::lock_guard lock(mutex_);
    inflater_ = std::make_unique<Inflater>(stored_.pieces.front().offset);
    skip(bytes, stop);
    finish(stop);
    inflater_.reset();
}

// Unpacks until `out` is full, or the stream ends; gives the number of bytes unpacked.
std::size_t PackedSteps::unpack(std::span<std::byte> out, const std::stop_token& stop) {
    Inflater& in = *inflater_;
    const InputFile file(stored_.pieces.front().file);
    std::vector<std::byte> input(std::size_t(256) << 10);
    std::size_t done = 0;
    auto give_back_input = [&] {
        in.next_input -= in.z.avail_in;
        in.z.avail_in = 0;
    };
    while (!in.ended && done < out.size()) {
        check_stop(stop);
        if (in.z.avail_in == 0) {
            std::size_t n = file.read_some(in.next_input, input);
            in.z.next_in = reinterpret_cast<Bytef*>(input.data());
            in.z.avail_in = uInt(n);
            in.next_input += n;
            if (n == 0)
                fail("{} is cut short: its compressed data ends at byte {}, before its voxels do; "
                     "copy it again from its source", file.path().string(), in.next_input);
        }
        const std::size_t part = std::min<std::size_t>(out.size() - done, kChunk);
        in.z.next_out = reinterpret_cast<Bytef*>(out.data() + done);
        in.z.avail_out = uInt(part);
        const int status = inflate(&in.z, Z_NO_FLUSH);
        done += part - in.z.avail_out;
        if (status == Z_STREAM_END) {
            // Several members may follow one another (bgzip, pigz, cat): they are one stream.
            give_back_input();
            std::byte magic[2];
            in.ended = file.read_some(in.next_input, magic) < 2 || magic[0] != std::byte(0x1f) ||
                       magic[1] != std::byte(0x8b);
            if (!in.ended) inflateReset(&in.z);
        } else if (status != Z_OK && status != Z_BUF_ERROR) {
            fail("{} is damaged: its compressed data is not right near byte {} ({}); copy it again "
                 "from its source", file.path().string(), in.next_input - in.z.avail_in,
                 in.z.msg ? in.z.msg : "no memory");
        }
    }
    give_back_input();
    return done;
}

void PackedSteps::advance(std::span<std::byte> out, const std::stop_token& stop) {
    if (std::size_t done = unpack(out, stop); done < out.size())
        fail("{} is cut short: its compressed data unpacks to fewer bytes than its header promises; "
             "copy it again from its source", stored_.pieces.front().file.string());
}

// The end of a stream holds its checksum: only when it is met the last step is known to be right.
void PackedSteps::finish(const std::stop_token& stop) {
    std::byte more[1];
    if (unpack(more, stop) > 0 && stored_.exact)
        fail("{} unpacks to more bytes of voxels than the description says; correct dims, type, "
             "components or offset", stored_.pieces.front().file.string());
}

}  // namespace voxloom
