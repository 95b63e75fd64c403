// What it costs to reach decoded voxels: hits of the brick cache, bricks with aprons, regions, and
// building the pyramid. Nothing is decoded here, so this is the floor under every codec.
#include <benchmark/benchmark.h>

#include <random>

#include "core/data/brick_cache.h"
#include "core/data/dense_pyramid.h"

namespace voxloom {
namespace {

constexpr std::int64_t kSide = 256;

VolumePtr noise(ScalarType type) {
    VolumeDesc desc;
    desc.dims = Index3(kSide);
    desc.type = type;
    Buffer voxels(desc.dense_bytes());
    std::mt19937 random(1);
    for (std::uint16_t& v : voxels.as<std::uint16_t>()) v = std::uint16_t(random() & 0x3f3f);
    return std::make_shared<DenseVolume>(desc, std::move(voxels));
}

// Without arrays behind its levels, so that everything goes through the cache. lifting53 keeps its
// coarse levels in a wider type: reading them converts.
class ThroughTheCache final : public Bricks {
  public:
    explicit ThroughTheCache(BricksPtr inner) : Bricks(inner->desc()), inner_(std::move(inner)) {}
    BrickInfo info(BrickId id) const override { return inner_->info(id); }
    std::optional<BrickId> parent(BrickId id) const override { return inner_->parent(id); }
    std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels* parent,
                                     const std::stop_token& stop) const override {
        return inner_->refine(id, parent, stop);
    }
    std::uint64_t family_bytes(BrickId id) const override { return inner_->family_bytes(id); }

  private:
    BricksPtr inner_;
};

const BricksPtr& pyramid(bool converts) {
    static const BricksPtr all[2] = {
        std::make_shared<ThroughTheCache>(
            make_dense_pyramid(noise(ScalarType::u16), glm::ivec3(32), PyramidFilter::average)),
        std::make_shared<ThroughTheCache>(
            make_dense_pyramid(noise(ScalarType::u16), glm::ivec3(32), PyramidFilter::lifting53))};
    return all[converts];
}

BrickCache& cache() {
    static BrickCache& all = *new BrickCache(std::uint64_t(1) << 30);
    return all;
}

BrickId some_brick(std::mt19937& random) {
    return {0, {int(random() % 8), int(random() % 8), int(random() % 8)}};
}

void cache_hit(benchmark::State& state) {
    const BricksPtr& bricks = pyramid(false);
    for (int i = 0; i < 512; ++i) cache().get(bricks, {0, {i % 8, i / 8 % 8, i / 64}});
    std::mt19937 random(unsigned(state.thread_index()));
    for (auto _ : state) benchmark::DoNotOptimize(cache().get(bricks, some_brick(random)));
}
BENCHMARK(cache_hit)->ThreadRange(1, 4)->UseRealTime();

// Each family replaces another one: what the cache adds to a decoder that only copies.
void cache_miss(benchmark::State& state) {
    const BricksPtr& bricks = pyramid(false);
    BrickCache small(16 * bricks->family_bytes({0, {0, 0, 0}}));
    std::mt19937 random(1);
    for (auto _ : state) benchmark::DoNotOptimize(small.get(bricks, some_brick(random)));
    state.SetBytesProcessed(std::int64_t(state.iterations()) * 32 * 32 * 32 * 2);
}
BENCHMARK(cache_miss);

// A brick with its apron, as renderers upload it. Arguments: voxels above, whether it converts.
void brick_with_apron(benchmark::State& state) {
    const BricksPtr& bricks = pyramid(state.range(1));
    const Apron apron{state.range(0) > 1 ? 1 : 0, int(state.range(0))};
    const std::int64_t side = 32 + apron.below + apron.above;
    Buffer out(std::uint64_t(side * side * side) * 2);
    std::mt19937 random(1);
    for (auto _ : state) read_brick(bricks, some_brick(random), apron, out.bytes(), cache());
    state.SetBytesProcessed(std::int64_t(state.iterations()) * std::int64_t(out.size()));
}
BENCHMARK(brick_with_apron)->ArgsProduct({{0, 1, 2}, {0, 1}});

void whole_level(benchmark::State& state) {
    const BricksPtr& bricks = pyramid(state.range(0));
    Buffer out(std::uint64_t(kSide * kSide * kSide) * 2);
    for (auto _ : state) read_region(bricks, 0, Box::of(Index3(kSide)), out.bytes(), cache());
    state.SetBytesProcessed(std::int64_t(state.iterations()) * std::int64_t(out.size()));
}
BENCHMARK(whole_level)->Arg(0)->Arg(1)->UseRealTime();

void build_pyramid(benchmark::State& state) {
    const VolumePtr volume = noise(ScalarType::u16);
    for (auto _ : state)
        benchmark::DoNotOptimize(make_dense_pyramid(volume, glm::ivec3(32), PyramidFilter(state.range(0))));
    state.SetBytesProcessed(std::int64_t(state.iterations()) * std::int64_t(volume->desc().dense_bytes()));
}
BENCHMARK(build_pyramid)->DenseRange(0, 2)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace voxloom
