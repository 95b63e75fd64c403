#include "plugins/codec-vq/coded_brick.h"

#include <cstring>

#include "plugins/codec-vq/block.h"

namespace voxloom::vq {

namespace {

template <class F>
void for_each_block(Index3 dims, const F& f) {
    const Index3 n = blocks_of(dims);
    std::size_t i = 0;
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) f(Index3(x, y, z), i++);
}

// --- encoding ---

// Blocks of one component: a plane of means and two of codewords, and what is kept as it is.
template <class T>
struct Planes {
    std::vector<T> means;
    std::vector<std::uint8_t> octants, voxels;
    std::vector<std::pair<std::size_t, Block<T>>> raw;
};

template <class T>
Planes<T> quantised(const Channel<const T>& from, double unit, Loop loop, const Codebooks& books, const BrickSearch& search,
                    CodedBrick& brick) {
    const std::size_t count = Box::of(blocks_of(from.dims)).voxels();
    Planes<T> planes{std::vector<T>(count), std::vector<std::uint8_t>(count), std::vector<std::uint8_t>(count), {}};
    std::vector<std::size_t> coded;  // which blocks the vectors belong to
    std::vector<float> differences;
    for_each_block(from.dims, [&](Index3 block, std::size_t i) {
        const Block<T> values = read_block(from, block);
        if (!all_finite(values) || (!is_constant(values) && is_too_wide(values, unit))) {
            planes.raw.emplace_back(i, values);
        } else if (is_constant(values)) {
            planes.means[i] = values[0];
            ++brick.constant_blocks;
        } else {
            coded.push_back(i);
            differences.resize(coded.size() * kVoxels);
            planes.means[i] = mean_and_differences(values, unit, loop == Loop::closed, &differences[differences.size() - kVoxels]);
        }
    });

    std::vector<float> octants(coded.size() * kOctants), distance(coded.size());
    for (std::size_t k = 0; k < coded.size(); ++k)
        std::ranges::copy(octant_means(&differences[k * kVoxels]), octants.begin() + std::ptrdiff_t(k * kOctants));
    std::vector<std::uint8_t> index(coded.size());
    find_nearest(search.octants, octants.data(), coded.size(), index.data(), distance.data());
    for (std::size_t k = 0; k < coded.size(); ++k) {
        planes.octants[coded[k]] = index[k];
        const float* known = loop == Loop::closed ? books.octants.word(index[k]).data() : &octants[k * kOctants];
        take_octants_off(known, &differences[k * kVoxels]);
    }
    std::ranges::fill(index, std::uint8_t(0));
    find_nearest(search.voxels, differences.data(), coded.size(), index.data(), distance.data());
    for (std::size_t k = 0; k < coded.size(); ++k) planes.voxels[coded[k]] = index[k];
    brick.raw_blocks += planes.raw.size();
    return planes;
}

template <class T>
ValueRange finite_range(std::span<const T> values) {
    ValueRange range;
    bool any = false;
    for (const T v : values) {
        if constexpr (std::is_floating_point_v<T>)
            if (!std::isfinite(v)) continue;
        const auto d = double(v);
        range = any ? ValueRange{std::min(range.min, d), std::max(range.max, d)} : ValueRange{d, d};
        any = true;
    }
    return range;
}

template <class T>
void code(const BrickForm& form, Loop loop, std::span<const Codebooks> books, std::span<const BrickSearch> search,
          std::span<const T> voxels, CodedBrick& brick) {
    const ValueRange range = finite_range(voxels);
    ByteWriter writer(brick.bytes);
    writer.number(T(range.min));
    writer.number(T(range.max));
    std::vector<Planes<T>> all;
    for (int c = 0; c < form.components; ++c) {
        const auto i = std::size_t(c);
        all.push_back(quantised<T>({voxels.data(), form.dims, form.components, c}, form.unit, loop, books[i], search[i], brick));
        writer.bytes(std::as_bytes(std::span(all[i].means)));
        writer.bytes(std::as_bytes(std::span(all[i].octants)));
        writer.bytes(std::as_bytes(std::span(all[i].voxels)));
    }
    for (const Planes<T>& planes : all) {
        writer.varint(planes.raw.size());
        std::size_t next = 0;
        for (const auto& [block, values] : planes.raw) {
            writer.varint(block - next);
            writer.bytes(std::as_bytes(std::span(values)));
            next = block;
        }
    }
}

// --- decoding ---

// Numbers up to 16 bits are exact in float with room for fractions; others need double.
template <class T>
using Real = std::conditional_t<(sizeof(T) <= 2), float, double>;

// Values between the least and the most of the brick, integers rounded.
template <class T>
struct Limits {
    Real<T> least, most;
    T value(Real<T> v) const {
        if constexpr (std::is_floating_point_v<T>) {
            return T(v < least ? least : v > most ? most : v);
        } else {
            // From the least value on, so that cutting off the fraction is rounding.
            const Real<T> above = v - least + Real<T>(0.5), top = most - least + Real<T>(0.5);
            using Int = std::conditional_t<(sizeof(T) <= 2), std::int32_t, std::int64_t>;
            return T(Int(least) + Int(above < 0 ? Real<T>(0) : above > top ? top : above));
        }
    }
};

// `octants` and `differences` are codewords.
template <class T>
Block<T> decode_block(T mean, const float* octants, const float* differences, Real<T> unit, const Limits<T>& limits) {
    Block<T> values;
    const auto sum = [&](int row, int x) { return Real<T>(octants[octant_of(row) + x / 2]) + Real<T>(differences[row + x]); };
    if constexpr (sizeof(T) <= 2) {  // in two steps, each of which the compiler makes vectors of
        std::array<Real<T>, kVoxels> sums;
        for (int row = 0; row < kVoxels; row += kSide)
            for (int x = 0; x < kSide; ++x) sums[std::size_t(row + x)] = sum(row, x);
        for (std::size_t i = 0; i < kVoxels; ++i) values[i] = limits.value(Real<T>(mean) + unit * sums[i]);
    } else {
        for (int row = 0; row < kVoxels; row += kSide)
            for (int x = 0; x < kSide; ++x) values[std::size_t(row + x)] = limits.value(Real<T>(mean) + unit * sum(row, x));
    }
    return values;
}

template <class T>
T load(std::span<const std::byte> plane, std::size_t i) {
    T v;
    std::memcpy(&v, plane.data() + i * sizeof(T), sizeof v);
    return v;
}

void require_words(std::span<const std::byte> plane, const Codebook& book) {
    if (!plane.empty() && int(*std::ranges::max_element(plane)) >= book.count()) fail("it names a codeword that is not there");
}

template <class T>
void decode(const BrickForm& form, std::span<const Codebooks> books, std::span<const std::byte> bytes, std::span<T> voxels) {
    ByteReader reader(bytes);
    const T least = reader.number<T>(), most = reader.number<T>();
    if constexpr (std::is_floating_point_v<T>)
        if (!std::isfinite(least) || !std::isfinite(most)) fail("its limits are not finite");
    if (!(least <= most)) fail("its limits are in disorder");
    const Limits<T> limits{Real<T>(least), Real<T>(most)};
    const std::size_t count = Box::of(blocks_of(form.dims)).voxels();
    for (int c = 0; c < form.components; ++c) {
        const Channel<T> to{voxels.data(), form.dims, form.components, c};
        const Codebooks& own = books[std::size_t(c)];
        const auto means = reader.bytes(count * sizeof(T)), octants = reader.bytes(count), differences = reader.bytes(count);
        require_words(octants, own.octants);
        require_words(differences, own.voxels);
        for_each_block(form.dims, [&](Index3 block, std::size_t i) {
            write_block(to, block, decode_block(load<T>(means, i), own.octants.word(int(octants[i])).data(),
                                                own.voxels.word(int(differences[i])).data(), Real<T>(form.unit), limits));
        });
    }
    const Index3 n = blocks_of(form.dims);
    for (int c = 0; c < form.components; ++c) {
        const Channel<T> to{voxels.data(), form.dims, form.components, c};
        std::uint64_t block = 0;
        for (std::uint64_t left = reader.varint(); left > 0; --left) {
            const std::uint64_t step = reader.varint();
            if (step >= count - block) fail("it keeps a block that is not there");
            block += step;
            Block<T> values;
            std::ranges::copy(reader.bytes(sizeof values), std::as_writable_bytes(std::span(values)).begin());
            const auto i = std::int64_t(block);
            write_block(to, Index3(i % n.x, i / n.x % n.y, i / (n.x * n.y)), values);
        }
    }
    if (reader.left() > 0) fail("it is longer than it should be");
}

}  // namespace

Codebooks zero_codebooks() {
    return {{kOctants, std::vector<float>(kOctants)}, {kVoxels, std::vector<float>(kVoxels)}};
}

CodedBrick code_brick(const BrickForm& form, Loop loop, std::span<const Codebooks> books,
                      std::span<const BrickSearch> search, std::span<const std::byte> voxels) {
    CodedBrick brick;
    brick.bytes.reserve(plain_brick_bytes(form));
    with_type(form.type, [&](auto t) {
        using T = decltype(t);
        code<T>(form, loop, books, search, {reinterpret_cast<const T*>(voxels.data()), form.values()}, brick);
    });
    return brick;
}

std::uint64_t plain_brick_bytes(const BrickForm& form) {
    const std::uint64_t blocks = Box::of(blocks_of(form.dims)).voxels();
    return 2 * bytes_of(form.type) + std::uint64_t(form.components) * (blocks * (bytes_of(form.type) + 2) + 1);
}

void decode_brick(const BrickForm& form, std::span<const Codebooks> books, std::span<const std::byte> bytes,
                  std::span<std::byte> voxels) {
    with_type(form.type, [&](auto t) {
        using T = decltype(t);
        decode<T>(form, books, bytes, {reinterpret_cast<T*>(voxels.data()), form.values()});
    });
}

}  // namespace voxloom::vq
