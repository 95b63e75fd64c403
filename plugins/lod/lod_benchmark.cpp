// Selecting and balancing 2048 bricks of a tree over 2048 cubed voxels, without any voxel.
#include <benchmark/benchmark.h>

#include "plugins/lod/balance.h"
#include "plugins/lod/error_model.h"
#include "plugins/lod/priority.h"
#include "plugins/lod/synthetic_bricks.h"

namespace voxloom::lod {
namespace {

struct Scene {
    BricksPtr bricks = std::make_shared<SyntheticBricks>(Index3(2048), glm::ivec3(16), shell_error);
    Camera camera;
    ErrorModel errors = value_errors(bricks);
    PriorityLimits limits{2048, 0, 1};
    Scene() {
        camera.eye = {3000, 2000, 1500};
        camera.target = {1024, 1024, 1024};
    }
};

void select(benchmark::State& state) {
    const Scene scene;
    const Sight sight(scene.camera, {512, 512}, scene.bricks->desc());
    for (auto _ : state)
        benchmark::DoNotOptimize(select_by_priority(scene.bricks->desc(), scene.errors, sight, scene.limits).sum);
}
BENCHMARK(select)->Unit(benchmark::kMillisecond);

void balance(benchmark::State& state) {
    const Scene scene;
    const BricksDesc& desc = scene.bricks->desc();
    const Sight sight(scene.camera, {512, 512}, desc);
    const Cut cut = select_by_priority(desc, scene.errors, sight, scene.limits).cut;
    auto selection = new_selection(desc, "benchmark", nullptr, {});
    list_bricks(cut, desc, &sight, *selection);
    for (auto _ : state) {
        CompleteTree tree(desc, *selection);
        tree.balance([&](BrickId id) { return sight.sees(region_of(desc.volume, desc.fine_box_of(id))); });
        tree.set_corner_blends();
        state.counters["bricks"] = double(tree.drawn());
    }
}
BENCHMARK(balance)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace voxloom::lod

BENCHMARK_MAIN();
