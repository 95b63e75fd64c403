#include "plugins/bricks/coarse_levels.h"

#include <algorithm>
#include <cmath>

#include "core/data/brick_cache.h"

namespace voxloom::bricks {

namespace {

std::size_t place(const BricksDesc& desc, BrickId id) {
    const glm::i64vec3 n(desc.levels[std::size_t(id.level)].bricks), i(id.index);
    return std::size_t((i.z * n.y + i.y) * n.x + i.x);
}
std::size_t bricks_of(const LevelDesc& level) {
    const glm::i64vec3 n(level.bricks);
    return std::size_t(n.x * n.y * n.z);
}
BrickId id_of(const BricksDesc& desc, int level, std::size_t at) {
    const glm::i64vec3 n(desc.levels[std::size_t(level)].bricks);
    const auto i = std::int64_t(at);
    return {level, glm::ivec3(i % n.x, i / n.x % n.y, i / (n.x * n.y))};
}

class WithCoarseLevels final : public Bricks {
  public:
    WithCoarseLevels(BricksPtr source, BricksPtr pyramid, PyramidFilter filter)
        : Bricks(coarse_levels_desc(source->desc(), filter)), source_(std::move(source)), pyramid_(std::move(pyramid)) {
        // Codecs with parents of their own, and filters with wider voxels, are read through the cache.
        forwards_ = source_->desc().levels.size() == 1 && source_->desc().tree_type == desc().tree_type;
        join_errors();
    }

    BrickInfo info(BrickId id) const override { return infos_[std::size_t(id.level)][place(desc(), id)]; }
    std::optional<BrickId> parent(BrickId) const override { return std::nullopt; }
    std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels* parent, const std::stop_token& stop) const override {
        return (forwards(id) ? source_ : pyramid_)->refine(id, parent, stop);
    }
    std::uint64_t family_bytes(BrickId id) const override { return (forwards(id) ? source_ : pyramid_)->family_bytes(id); }
    const std::byte* level_data(int level) const override { return pyramid_->level_data(level); }
    void read_mask(int level, const Box& box, std::span<std::uint8_t> out) const override {
        pyramid_->read_mask(level, box, out);
    }
    std::uint64_t resident_bytes() const override {
        std::uint64_t sum = pyramid_->resident_bytes();  // the source's among them
        for (const auto& level : infos_) sum += level.size() * sizeof(BrickInfo);
        return sum;
    }

  private:
    bool forwards(BrickId id) const { return forwards_ && id.level == 0; }

    void join_errors() {
        struct Loss {
            std::array<double, 8> squares{};
            double largest = 0;
            bool exact = true;
        };
        const int levels = int(desc().levels.size());
        std::vector<std::vector<Loss>> losses(desc().levels.size());
        for (int l = 0; l < levels; ++l) {
            const std::size_t count = bricks_of(desc().levels[std::size_t(l)]);
            auto& infos = infos_.emplace_back(count);
            losses[std::size_t(l)].resize(count);
            for (std::size_t i = 0; i < count; ++i) infos[i] = (l == 0 ? source_ : pyramid_)->info(id_of(desc(), l, i));
        }
        for (std::size_t i = 0; i < infos_[0].size(); ++i) {
            const BrickInfo& fine = infos_[0][i];
            BrickId id = id_of(desc(), 0, i);
            for (int l = 1; l < levels; ++l) {
                const auto octant = std::size_t(desc().octant_of(id));
                id = *desc().coarser(id);
                Loss& loss = losses[std::size_t(l)][place(desc(), id)];
                loss.squares[octant] += fine.l2 * fine.l2;
                loss.largest = std::max(loss.largest, fine.max_error);
                loss.exact = loss.exact && fine.exact_error;
            }
        }
        for (int l = 1; l < levels; ++l)
            for (std::size_t i = 0; i < infos_[std::size_t(l)].size(); ++i) {
                BrickInfo& info = infos_[std::size_t(l)][i];
                const Loss& loss = losses[std::size_t(l)][i];
                double squares = 0;
                for (std::size_t o = 0; o < 8; ++o) {
                    info.octant_l2[o] = std::hypot(info.octant_l2[o], std::sqrt(loss.squares[o]));
                    squares += loss.squares[o];
                }
                info.l2 = std::hypot(info.l2, std::sqrt(squares));
                info.max_error += loss.largest;
                info.exact_error = info.exact_error && loss.exact && loss.largest == 0;
            }
    }

    BricksPtr source_, pyramid_;
    bool forwards_ = false;
    std::vector<std::vector<BrickInfo>> infos_;
};

}  // namespace

BricksDesc coarse_levels_desc(const BricksDesc& source, PyramidFilter filter) {
    BricksDesc desc = dense_pyramid_desc(source.volume, source.brick, filter);
    desc.compressed_bytes += source.compressed_bytes - source.volume.dense_bytes();
    return desc;
}

BricksPtr with_coarse_levels(BricksPtr source, PyramidFilter filter, const std::stop_token& stop,
                             const std::function<void(double)>& progress) {
    const VolumePtr fine = level_as_volume(source, 0, BrickCache::global());
    BricksPtr pyramid = make_dense_pyramid(fine, source->desc().brick, filter, stop, progress);
    return std::make_shared<WithCoarseLevels>(std::move(source), std::move(pyramid), filter);
}

}  // namespace voxloom::bricks
