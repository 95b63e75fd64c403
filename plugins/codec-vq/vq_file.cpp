// Files of vector-quantised bricks: docs/brick-format.md.
#include <algorithm>
#include <cmath>

#include "core/base/mapped_file.h"
#include "core/data/brick_file.h"
#include "plugins/codec-vq/block.h"
#include "plugins/codec-vq/vq_bricks.h"

namespace voxloom::vq {

namespace {

constexpr BrickFileKind kVqFile{"voxvecqu", 1, 1};
constexpr float kLargestNumber = 1e10f;  // of a codeword: differences of 32-bit integers, and what the search can take

// --- codebooks: how many codewords, and all but the first, which is zero ---

void write_book(const Codebook& book, ScalarType type, ByteWriter& writer) {
    writer.number(std::uint16_t(book.count()));
    for (std::size_t i = std::size_t(book.dim); i < book.words.size(); ++i) {
        if (has_fine_steps(type))
            writer.number(std::int16_t(book.words[i] / kFineStep));
        else
            writer.number(book.words[i]);
    }
}

Codebook read_book(int dim, ScalarType type, ByteReader& reader) {
    const int count = reader.number<std::uint16_t>();
    if (count < 1 || count > kMostCodewords) fail("a codebook of {} codewords is not possible", count);
    Codebook book{dim, std::vector<float>(std::size_t(count * dim))};
    for (std::size_t i = std::size_t(dim); i < book.words.size(); ++i) {
        book.words[i] = has_fine_steps(type) ? float(reader.number<std::int16_t>()) * kFineStep : reader.number<float>();
        if (!(std::abs(book.words[i]) <= kLargestNumber)) fail("a codeword is not a number that can be");
    }
    return book;
}

// --- the head ---

VqIndex read_head(std::span<const std::byte> head, std::uint64_t payload) {
    ByteReader reader(head);
    VqIndex index;
    index.provenance = reader.text();
    const VolumeDesc volume = read_volume_desc(reader);
    glm::ivec3 brick;
    for (int a = 0; a < 3; ++a) brick[a] = reader.number<std::int32_t>();
    index.desc = vq_desc(volume, brick);
    const auto loop = reader.number<std::uint8_t>();
    if (loop > 1) fail("its loop is not known to this version");
    index.loop = Loop(loop);
    index.unit = reader.number<double>();
    if (!(index.unit > 0) || !std::isfinite(index.unit) || (!is_float(volume.type) && index.unit != 1))
        fail("its unit is not one");
    for (int a = 0; a < 3; ++a) index.macroblocks[a] = reader.number<std::int32_t>();
    if (index.macroblocks != macroblocks_for(index.desc, index.macroblocks)) fail("its macroblocks are not whole bricks");
    const std::uint64_t books = checked_product(Index3(index.macroblocks), std::uint64_t(volume.components), "codebooks");
    if (books > reader.left() / 4) fail("its codebooks are too short for its size");
    for (std::uint64_t b = 0; b < books; ++b) {
        Codebooks& own = index.books.emplace_back();
        own.octants = read_book(kOctants, volume.type, reader);
        own.voxels = read_book(kVoxels, volume.type, reader);
    }

    index.bricks = read_brick_index(index.desc, payload, reader);
    for (std::size_t i = 0; i < index.bricks.places.size(); ++i)
        if (index.bricks.places[i].size < plain_brick_bytes(index.form(index.desc.box_of(brick_at(index.desc, i)).dims())))
            fail("a brick is too short for its size");
    if (reader.left() > 0) fail("its head is longer than it should be");
    return index;
}

}  // namespace

bool has_fine_steps(ScalarType type) { return bytes_of(type) == 1; }

void round_words(ScalarType type, Codebook& book) {
    if (!has_fine_steps(type)) return;
    for (float& word : book.words) word = std::clamp(std::floor(word / kFineStep + 0.5f), -32767.0f, 32767.0f) * kFineStep;
}

Bytes front_of(const VqIndex& index, std::uint64_t payload_bytes) {
    Bytes head;
    ByteWriter writer(head);
    writer.text(index.provenance);
    write_volume_desc(index.desc.volume, writer);
    for (int a = 0; a < 3; ++a) writer.number(std::int32_t(index.desc.brick[a]));
    writer.number(std::uint8_t(index.loop));
    writer.number(index.unit);
    for (int a = 0; a < 3; ++a) writer.number(std::int32_t(index.macroblocks[a]));
    for (const Codebooks& books : index.books) {
        write_book(books.octants, index.desc.volume.type, writer);
        write_book(books.voxels, index.desc.volume.type, writer);
    }
    write_brick_index(index.bricks, index.desc.volume.type, writer);
    return enclose(kVqFile, head, payload_bytes);
}

void write_file(const VqBricks& bricks, const std::filesystem::path& path, const std::stop_token& stop) {
    write_brick_file(path, front_of(bricks.index(), bricks.payload().size()), bricks.payload(), stop);
}

VqBricksPtr open_bytes(std::span<const std::byte> file, std::shared_ptr<const void> keeper, const std::string& name) {
    try {
        const Envelope envelope = open_envelope(kVqFile, file);
        VqIndex index = read_head(envelope.head, envelope.payload.size());
        index.desc.compressed_bytes = file.size();
        return std::make_shared<VqBricks>(std::move(index), envelope.payload, std::move(keeper), 0);
    } catch (const Error& e) {
        fail("{} is not a vector-quantised file that can be read: {}; get the file again", name, e.what());
    }
}

VqBricksPtr open_file(const std::filesystem::path& path) {
    auto file = std::make_shared<const MappedFile>(path);
    return open_bytes(file->bytes(), file, path.string());
}

}  // namespace voxloom::vq
