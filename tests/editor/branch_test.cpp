// What a picture's branch costs: found in the graph, read from what was measured, tried and gone back to.
#include <gtest/gtest.h>

#include <cmath>

#include "app/editor/model/branch.h"
#include "app/editor/model/plane_control.h"
#include "core/base/error.h"
#include "core/data/dense_pyramid.h"
#include "core/graph/check.h"
#include "tests/support/volumes.h"

namespace voxloom::editor {
namespace {

const char* const kText = R"(voxloom: 1
nodes:
  - { id: ct, type: test.read }
  - { id: code, type: test.encode, in: { volume: ct.volume }, set: { steps: 3 } }
  - { id: back, type: test.decode, in: { bricks: code.bricks } }
  - { id: view, type: test.draw, in: { source: back.volume } }
  - { id: direct, type: test.draw, in: { source: ct.volume } }
  - { id: wrong, type: test.error, in: { volume: back.volume, reference: ct.volume } }
  - { id: unlike, type: test.picture-error, in: { image: view.image, reference: direct.image } }
)";

struct Branches : ::testing::Test {
    Registry nodes;
    Document document = Document::parse(kText);
    Evaluator::State state;

    Branches() {
        auto add = [&](const char* id, std::vector<PortSpec> inputs, std::vector<PortSpec> outputs, std::vector<ParamSpec> params = {}) {
            NodeType type;
            type.id = id;
            type.title = type.doc = "test";
            type.inputs = std::move(inputs);
            type.outputs = std::move(outputs);
            type.params = std::move(params);
            type.evaluate = [](Evaluation&) {};
            nodes.add(type);
        };
        add("test.read", {}, {{"volume", PortType::volume, "v"}});
        add("test.encode", {{"volume", PortType::volume, "v"}}, {{"bricks", PortType::bricks, "b"}},
            {param::choice("target", {"error", "steps"}, "steps", "Which."),
             param::real("bound", 1, "Bound.").range(0.01, 10).slider(0.1, 10, Scale::logarithmic).shown_if("target", {"error"}).is_quality(),
             param::integer("steps", 4, "Steps.").range(1, 5).slider(1, 5).is_quality()});
        add("test.decode", {{"bricks", PortType::bricks, "b"}}, {{"volume", PortType::volume, "v"}});
        add("test.draw", {{"source", {PortType::volume, PortType::bricks}, "s"}}, {{"image", PortType::image, "i"}});
        add("test.error", {{"volume", PortType::volume, "v"}, {"reference", PortType::volume, "r"}}, {{"table", PortType::table, "t"}});
        add("test.picture-error", {{"image", PortType::image, "v"}, {"reference", PortType::image, "r"}}, {{"table", PortType::table, "t"}});
        state.graph = std::make_shared<const Graph>(document.graph());
    }
    Branch branch(const char* node) const { return branch_of(document.graph(), nodes, {node, "image", {}}); }
    void finish(const std::string& id, double seconds, std::map<std::string, std::pair<double, std::string>> measurements = {}) {
        NodeStatus& status = state.nodes[id];
        status.state = NodeState::done;
        status.wall_seconds = seconds;
        status.measurements = std::move(measurements);
        status.key = Hasher().text(id).value(double(seconds)).finish();
    }
    void table(const std::string& id, const std::string& column, double value) {
        auto made = std::make_shared<Table>();
        made->columns = {{"name", ""}, {column, ""}};
        made->rows = {{std::string("x"), value}};
        state.values[id + ".table"] = {TablePtr(made), true, 1};
        finish(id, 1);
    }
};

TEST_F(Branches, areFoundUpstreamAndByWhatMeasuresThem) {
    const Branch b = branch("view");
    EXPECT_EQ(b.codec, "code");
    EXPECT_EQ(b.decoder, "back");
    EXPECT_EQ(b.volume_error, "wrong");
    EXPECT_EQ(b.image_error, "unlike");
    const Branch plain = branch("direct");
    EXPECT_EQ(plain.codec, "");
    EXPECT_EQ(plain.volume_error, "") << "the error of another branch is none of this one";
    EXPECT_EQ(plain.image_error, "") << "a reference is not what is measured";
}

TEST_F(Branches, numbersAreThoseThatWereMeasuredAndNoOthers) {
    EXPECT_FALSE(numbers_of(branch("view"), state).ratio);
    finish("code", 2.5, {{"ratio", {7, ""}}, {"psnr", {40, "dB"}}, {"codec time", {0.5, "s"}}});
    finish("back", 0.25);
    finish("view", 0);
    BranchNumbers n = numbers_of(branch("view"), state);
    EXPECT_EQ(n.ratio, 7);
    EXPECT_EQ(n.psnr, 40);
    EXPECT_EQ(n.encode, 0.5);
    EXPECT_EQ(n.decode, 0.25);
    EXPECT_FALSE(n.frame) << "kept from a run that nobody timed";
    EXPECT_FALSE(n.image_rmse);
    table("wrong", "psnr", 41);
    table("unlike", "rmse", 0.01);
    n = numbers_of(branch("view"), state);
    EXPECT_EQ(n.psnr, 41) << "a measurement of the whole is better than the codec's own";
    EXPECT_EQ(n.image_rmse, 0.01);
    state.nodes["code"].state = NodeState::waiting;
    state.values["wrong.table"].fresh = false;
    n = numbers_of(branch("view"), state);
    EXPECT_FALSE(n.ratio) << "of an older graph";
    EXPECT_FALSE(n.psnr);
}

TEST_F(Branches, measuresOfTheEditorStandInForNodesThatAreNotThere) {
    const Branch b = branch("view");
    EXPECT_EQ(b.bricks.node + "." + b.bricks.port, "code.bricks");
    EXPECT_EQ(b.original.node + "." + b.original.port, "ct.volume");
    EXPECT_EQ(branch("direct").bricks.node, "");
    auto decoded = std::make_shared<Decoded>();
    decoded->ratio = 5, decoded->bits_per_voxel = 1.6, decoded->cpu_seconds = 2, decoded->bytes_per_second = 1e8;
    decoded->psnr = 39, decoded->max_error = 4;
    auto image = std::make_shared<ImageError>();
    image->rmse = 0.125, image->max_error = 0.5;
    OwnMeasures own;
    own.decoded = decoded, own.image = image;
    finish("code", 1, {{"psnr", {40, "dB"}}});
    finish("back", 0.25);
    BranchNumbers n = numbers_of(b, state, own);
    EXPECT_EQ(n.ratio, 5);
    EXPECT_EQ(n.bits_per_voxel, 1.6);
    EXPECT_EQ(n.psnr, 39) << "all of it was decoded: what the codec says may be of less";
    EXPECT_EQ(n.max_error, 4);
    EXPECT_EQ(n.decode, 2);
    EXPECT_EQ(n.decoded_bytes_per_second, 1e8);
    EXPECT_EQ(n.image_rmse, 0.125);
    EXPECT_EQ(n.image_max, 0.5);
    table("wrong", "psnr", 41);
    table("unlike", "rmse", 0.01);
    n = numbers_of(b, state, own);
    EXPECT_EQ(n.psnr, 41);
    EXPECT_EQ(n.image_rmse, 0.01);
    EXPECT_FALSE(n.image_is_own);
    own.image_first = true;
    EXPECT_EQ(numbers_of(b, state, own).image_rmse, 0.125);
    EXPECT_TRUE(numbers_of(b, state, own).image_is_own);
    own.image = nullptr;
    EXPECT_FALSE(numbers_of(b, state, own).image_rmse) << "the graph's is against another picture";
    EXPECT_FALSE(numbers_of(b, state, own).image_max);
    decoded->problem = "corrupt";
    n = numbers_of(b, state, own);
    EXPECT_FALSE(n.ratio);
    EXPECT_EQ(n.decode, 0.25);
}

TEST_F(Branches, areDrawnWithoutTheirCodecByCopiesThatPassItBy) {
    const std::vector<GraphNode> nodes_without = nodes_without_codec(document.graph(), nodes, branch("view"));
    ASSERT_EQ(nodes_without.size(), 3u);
    Graph graph = document.graph();
    graph.nodes.insert(graph.nodes.end(), nodes_without.begin(), nodes_without.end());
    const Plan plan = check(graph, nodes);
    EXPECT_TRUE(plan.problems.empty());
    const Plan::Node& view = plan.nodes[std::size_t(plan.find(id_without_codec("view")))];
    EXPECT_TRUE(view.ok);
    EXPECT_EQ(plan.nodes[std::size_t(view.inputs.at(0).at(0).node)].id, "ct");
    EXPECT_TRUE(is_without_codec(id_without_codec("view")));
    EXPECT_THROW(document.add_node(id_without_codec("view"), "test.draw"), Error) << "no node of a document has such a name";
    EXPECT_TRUE(nodes_without_codec(document.graph(), nodes, branch("direct")).empty());
}

// --- decoding ------------------------------------------------------------------------------------

VolumePtr wave(double plus, Index3 dims = {37, 21, 9}) {
    return voxloom::testing::make_volume(dims, ScalarType::i16, [plus](auto x, auto y, auto z) { return plus + double(x + 2 * y + 3 * z); });
}

TEST(Decoding, measuresWhatAConstantErrorIs) {
    const BricksPtr bricks = make_dense_pyramid(wave(3), glm::ivec3(8), PyramidFilter::average);
    const auto d = decode_all(bricks, wave(0));
    EXPECT_EQ(d->problem, "");
    EXPECT_EQ(d->max_error, 3);
    EXPECT_NEAR(*d->psnr, 20 * std::log10((36 + 40 + 24) / 3.0), 1e-9);
    const double voxels = 37 * 21 * 9, bytes = double(bricks->desc().compressed_bytes);
    EXPECT_DOUBLE_EQ(d->ratio, 2 * voxels / bytes);
    EXPECT_DOUBLE_EQ(d->bits_per_voxel, 8 * bytes / voxels);
    EXPECT_GT(d->cpu_seconds, 0);
    EXPECT_DOUBLE_EQ(d->bytes_per_second, 2 * voxels / d->cpu_seconds);
    const auto same = decode_all(bricks, bricks);
    EXPECT_EQ(same->max_error, 0);
    EXPECT_EQ(*same->psnr, INFINITY);
    for (const Value& other : {Value(), Value(wave(0, {36, 21, 9}))}) {
        const auto alone = decode_all(bricks, other);
        EXPECT_EQ(alone->problem, "");
        EXPECT_FALSE(alone->psnr);
        EXPECT_GT(alone->cpu_seconds, 0);
    }
    EXPECT_EQ(decode_all(make_dense_pyramid(wave(0, {1, 7, 1}), glm::ivec3(8), PyramidFilter::average), wave(0, {1, 7, 1}))->max_error, 0);
}

TEST_F(Branches, areComparedOnlyWithAnOriginalOfTheGraphAsItIs) {
    const VolumePtr original = wave(0);
    const BricksPtr bricks = make_dense_pyramid(original, glm::ivec3(8), PyramidFilter::average);
    state.volumes["ct.volume"] = original;
    state.bricks["code.bricks"] = bricks;
    finish("ct", 1);
    EXPECT_FALSE(compared_of(branch("view"), state).bricks);
    finish("code", 1);
    EXPECT_EQ(compared_of(branch("view"), state).bricks, bricks);
    EXPECT_EQ(compared_of(branch("view"), state).original, Value(original));
    state.nodes["ct"].state = NodeState::waiting;
    EXPECT_EQ(compared_of(branch("view"), state).original, Value()) << "of an older graph";
}

TEST(Decoding, saysWhatIsWrongWithTheBricks) {
    struct Torn final : Bricks {
        using Bricks::Bricks;
        BrickInfo info(BrickId) const override { return {}; }
        std::optional<BrickId> parent(BrickId) const override { return {}; }
        std::vector<DecodedBrick> refine(BrickId, const BrickVoxels*, const std::stop_token&) const override { fail("the brick is torn"); }
    };
    BricksDesc desc;
    desc.volume = wave(0)->desc();
    desc.brick = glm::ivec3(16);
    desc.tree_type = desc.volume.type;
    desc.levels = pyramid_levels(desc.volume, desc.brick, true);
    const auto torn = std::make_shared<const Torn>(desc);
    EXPECT_NE(decode_all(torn, Value())->problem.find("torn"), std::string::npos);
    EXPECT_NE(decode_all(torn, wave(0))->problem.find("torn"), std::string::npos);
    std::stop_source stop;
    stop.request_stop();
    EXPECT_THROW(decode_all(torn, wave(0), stop.get_token()), Cancelled);
}

TEST_F(Branches, whatWasTriedIsKeptOnceAndComesBackInOneStep) {
    std::vector<Tried> tried;
    collect_tried(tried, {branch("view"), branch("direct")}, {}, state);
    EXPECT_TRUE(tried.empty());
    finish("code", 1, {{"psnr", {40, "dB"}}});
    collect_tried(tried, {branch("view")}, {}, state);
    collect_tried(tried, {branch("view")}, {}, state);
    ASSERT_EQ(tried.size(), 1u);
    EXPECT_EQ(tried[0].seconds, 1);
    document.set_param("code", "steps", std::int64_t(5));
    document.set_param("code", "bound", 0.5);
    const std::string before = document.text();
    bring_back(document, tried[0], nodes);
    EXPECT_EQ(document.text(), kText);
    document.undo();
    EXPECT_EQ(document.text(), before);
    document.remove_node("code");
    EXPECT_THROW(bring_back(document, tried[0], nodes), Error);
    Branch only;
    only.codec = "code";
    for (int i = 0; i < 600; ++i) {
        finish("code", 2 + i, {{"psnr", {INFINITY, "dB"}}});
        collect_tried(tried, {only}, {}, state);
    }
    EXPECT_EQ(tried.size(), 500u);
    EXPECT_EQ(tried.back().seconds, 601);
}

TEST_F(Branches, areDecodedForAPlaceAmongWhatWasTriedWhereNothingElseTellsTheirError) {
    const Branch view = branch("view");
    EXPECT_FALSE(needs_decoding(view, state)) << "there is nothing to decode yet";
    EXPECT_FALSE(needs_decoding(branch("direct"), state));
    finish("code", 1);
    EXPECT_TRUE(needs_decoding(view, state));
    std::vector<Tried> tried;
    collect_tried(tried, {view}, {}, state);
    EXPECT_TRUE(tried.empty());
    auto decoded = std::make_shared<Decoded>();
    decoded->psnr = 39;
    OwnMeasures own;
    own.decoded = decoded;
    collect_tried(tried, {view}, {own}, state);
    ASSERT_EQ(tried.size(), 1u);
    EXPECT_EQ(tried[0].psnr, 39);
    finish("code", 2, {{"psnr", {40, "dB"}}});
    EXPECT_FALSE(needs_decoding(view, state)) << "it says so itself";
    finish("code", 3);
    table("wrong", "psnr", 41);
    EXPECT_FALSE(needs_decoding(view, state)) << "a node measures it";
    finish("code", 4, {{"psnr", {-INFINITY, "dB"}}});
    state.values.clear();
    tried.clear();
    collect_tried(tried, {view}, {}, state);
    EXPECT_TRUE(tried.empty()) << "of a constant there is no such number, and no place in a plot";
}

TEST_F(Branches, aSweepGoesOverTheParameterThatIsInUse) {
    std::optional<Sweep> sweep = sweep_of(document.graph(), nodes, "code");
    ASSERT_TRUE(sweep);
    EXPECT_EQ(sweep->param, "steps");
    ASSERT_EQ(sweep->values.size(), 5u) << "whole numbers, each once";
    EXPECT_EQ(sweep->values.front(), ParamValue(std::int64_t(1)));
    document.set_param("code", "target", std::string("error"));
    sweep = sweep_of(document.graph(), nodes, "code", 3);
    ASSERT_TRUE(sweep);
    EXPECT_EQ(sweep->param, "bound");
    EXPECT_EQ(sweep->values, (std::vector<ParamValue>{0.1, 1.0, 10.0}));
    const std::string before = document.text();
    const Graph changed = graph_with(document.graph(), *sweep, 2);
    EXPECT_EQ(changed.find("code")->params.back().yaml.text, "10");
    EXPECT_EQ(document.text(), before);
    EXPECT_FALSE(sweep_of(document.graph(), nodes, "back"));
    EXPECT_FALSE(sweep_of(document.graph(), nodes, "nobody"));
}

// --- cutting planes ------------------------------------------------------------------------------

struct Planes : ::testing::Test {
    Registry nodes;
    Workspace work;
    Evaluator::State state;

    Planes() {
        auto add = [&](const char* id, PortType gives) {
            NodeType type;
            type.id = id;
            type.title = type.doc = "test";
            type.inputs = {{"source", PortType::bricks, "s", true}, {"selection", PortType::selection, "s", true}};
            type.outputs = {{"out", gives, "o"}};
            type.params = {param::vector("normal", {0, 0, 1}, "Normal."), param::vector("origin", {0.5, 0.5, 0.5}, "Origin.")};
            type.evaluate = [](Evaluation&) {};
            nodes.add(type);
        };
        add("test.draw", PortType::image);
        add("test.select", PortType::selection);
        work.document.add_node("bricks", "test.unknown");
        work.document.add_node("view", "test.draw");
        work.document.connect("bricks", "out", "view", "source");
        VolumeDesc desc;
        desc.dims = {11, 21, 1};
        desc.set_spacing_origin({1, 0.5, 1000}, {100, 0, -3});
        state.nodes["bricks"].outputs = {ValueDesc(desc)};
    }
    Plane now(const char* node = "view") const { return *plane_now(work.graph(), nodes, node, state); }
};

TEST_F(Planes, areOfTheSelectionWhereThereIsOne) {
    EXPECT_EQ(plane_of(work.graph(), nodes, "view"), "view");
    work.document.add_node("select", "test.select");
    work.document.connect("select", "out", "view", "selection");
    EXPECT_EQ(plane_of(work.graph(), nodes, "view"), "select");
    EXPECT_FALSE(plane_of(work.graph(), nodes, "bricks"));
    EXPECT_FALSE(plane_now(work.graph(), nodes, "select", state)) << "nothing says of which volume";
    work.document.set_param("view", "normal", std::vector<double>{0, 0, 0});
    EXPECT_FALSE(plane_now(work.graph(), nodes, "view", state));
}

TEST_F(Planes, moveAlongTheirNormalInTheWorldAndStayInTheBox) {
    EXPECT_EQ(now().point, glm::dvec3(105, 5, -3));
    turn_plane(work, "view", {0, 10, 0});
    EXPECT_EQ(now().normal, glm::dvec3(0, 1, 0));
    move_plane(work, "view", now(), 2);
    EXPECT_NEAR(now().point.y, 7, 1e-9);
    EXPECT_NEAR(now().point.x, 105, 1e-9);
    move_plane(work, "view", now(), 1e9);
    EXPECT_NEAR(now().point.y, 10, 1e-9) << "the last voxel";
    const std::string before = work.document.text();
    turn_plane(work, "view", {0, 0, 0});
    EXPECT_EQ(work.document.text(), before);
}

}  // namespace
}  // namespace voxloom::editor
