// Pictures of bricks that are not decoded yet: what is shown on the way, and that it leaves no trace.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <functional>
#include <thread>

#include "core/data/dense_pyramid.h"
#include "core/data/selection.h"
#include "tests/support/linked_plugin.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

using namespace voxloom;
using namespace voxloom::testing;

namespace {

// Bricks of a pyramid that take their time at the finest level.
class SlowBricks final : public Bricks {
  public:
    SlowBricks(BricksPtr inner, std::function<void()> before_fine)
        : Bricks(inner->desc()), inner_(std::move(inner)), before_fine_(std::move(before_fine)) {}
    BrickInfo info(BrickId id) const override { return inner_->info(id); }
    std::optional<BrickId> parent(BrickId id) const override { return inner_->parent(id); }
    std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels* parent, const std::stop_token& stop) const override {
        if (id.level == 0) before_fine_();
        return inner_->refine(id, parent, stop);
    }

  private:
    BricksPtr inner_;
    std::function<void()> before_fine_;
};

BricksPtr pyramid() {
    return make_dense_pyramid(make_volume({64, 64, 64}, ScalarType::u8, [](auto x, auto y, auto z) {
        return 120 + 70 * std::sin(0.1 * double(x) + 0.05 * double(y)) + 50 * std::cos(0.12 * double(z));
    }), glm::ivec3(16), PyramidFilter::average);
}

void sleep_a_little() { std::this_thread::sleep_for(std::chrono::milliseconds(4)); }

NodeRun draw(const char* node, const BricksPtr& bricks, const std::string& params, const std::stop_token& stop = {}, bool looking = true) {
    auto tf = std::make_shared<TransferFunction>();
    tf->one = {{{0, Emission(0)}, {240, Emission(0.05, 0.025, 0, 0.05)}}};
    auto camera = std::make_shared<Camera>();
    camera->target = {32, 32, 32};
    camera->eye = {100, 60, 130};
    NodeInputs inputs;
    inputs["source"] = {bricks};
    inputs["transfer"] = {TransferPtr(tf)};
    inputs["camera"] = {CameraPtr(camera)};
    if (std::string_view(node) == "slicer.render") {
        auto all = std::make_shared<Selection>();
        all->of = std::make_shared<BricksDesc>(bricks->desc());
        all->policy = "test";
        for (int i = 0; i < 64; ++i) {
            SelectedBrick b;
            b.id = {0, {i % 4, i / 4 % 4, i / 16}};
            all->bricks.push_back(b);
        }
        inputs["selection"] = {SelectionPtr(all)};
    }
    RunNodeOptions options;
    options.wants_provisional = looking;
    options.stop = stop;
    const NodeType& type = *linked_plugin().find(node);
    return run_node(type, params_from_yaml(type, "{size: [60, 44], background: [0, 0, 0, 0]" + params + "}"), inputs, options);
}

bool same_bytes(const Image& a, const Image& b) {
    return a.bytes().size() == b.bytes().size() && std::memcmp(a.bytes().data(), b.bytes().data(), a.bytes().size()) == 0;
}

}  // namespace

TEST(Progressive, ShowsWhatIsDecodedAndEndsWithTheSamePicture) {
    for (const char* node : {"slicer.render", "slicer.plane"}) {
        const ImagePtr at_once = draw(node, pyramid(), ", first_picture: 0").image();
        NodeRun run = draw(node, std::make_shared<SlowBricks>(pyramid(), sleep_a_little), ", first_picture: 0.001");
        ASSERT_GE(run.counters["provisional pictures"], 1) << node;
        const auto first = std::get<ImagePtr>(run.provisional.front().second);
        EXPECT_EQ(first->size(), glm::ivec2(60, 44));
        double coverage = 0;
        for (glm::vec4 c : first->rgba32f()) coverage += c.a / (60 * 44);
        EXPECT_GT(coverage, 0.05) << node;  // coarse, but not empty
        EXPECT_TRUE(same_bytes(*run.image(), *at_once)) << node;
        // Nobody looks: nothing is shown, and the picture is the same.
        NodeRun alone = draw(node, std::make_shared<SlowBricks>(pyramid(), [] {}), ", first_picture: 0.001", {}, false);
        EXPECT_TRUE(alone.provisional.empty());
        EXPECT_TRUE(same_bytes(*alone.image(), *at_once)) << node;
    }
}

TEST(Progressive, BandwidthSlowsRefinementAndNothingElse) {
    const ImagePtr at_once = draw("slicer.plane", pyramid(), "").image();
    NodeRun run = draw("slicer.plane", std::make_shared<SlowBricks>(pyramid(), [] {}), ", first_picture: 0.001, bandwidth: 0.5");
    EXPECT_GE(run.counters["provisional pictures"], 1);
    EXPECT_TRUE(same_bytes(*run.image(), *at_once));
}

TEST(Progressive, AnotherViewCancels) {
    for (const char* node : {"slicer.render", "slicer.plane"}) {
        std::stop_source stop;
        std::atomic<int> decoded = 0;
        const auto bricks = std::make_shared<SlowBricks>(pyramid(), [&] {
            sleep_a_little();
            if (++decoded == 3) stop.request_stop();
        });
        EXPECT_THROW(draw(node, bricks, ", first_picture: 0.001", stop.get_token()), Cancelled) << node;
        EXPECT_LT(decoded, 40) << node;
        // What was decoded meanwhile is of use to the next one.
        EXPECT_TRUE(same_bytes(*draw(node, bricks, "", {}).image(), *draw(node, pyramid(), "").image()));
    }
}

TEST(Progressive, ABrickThatCannotBeDecodedIsOneError) {
    const auto bricks = std::make_shared<SlowBricks>(pyramid(), [] { fail("the brick is damaged"); });
    for (const char* node : {"slicer.render", "slicer.plane"})
        try {
            draw(node, bricks, ", first_picture: 0.001");
            FAIL();
        } catch (const Error& e) {
            EXPECT_NE(std::string(e.what()).find("damaged"), std::string::npos);
        }
}
