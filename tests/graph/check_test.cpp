#include "core/graph/check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "core/base/text.h"
#include "tests/support/fake_nodes.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

Plan check_text(const std::string& text, const CheckOptions& options = {}) {
    static const Registry registry = testing::fake_registry();
    return check(Document::parse(text, "g.yaml").graph(), registry, options);
}

// All problems as the user sees them, one a line.
std::string problems_of(const Plan& plan) {
    std::string all;
    for (const Problem& problem : plan.problems) all += problem.text(plan.file) + "\n";
    return all;
}

constexpr const char* kChain = R"(voxloom: 1
nodes:
  - id: last
    type: fake.add
    in: { volume: first.volume }
  - id: first
    type: fake.source
    set: { size: 3 }
)";

TEST(Check, PutsEverySourceBeforeItsConsumers) {
    Plan plan = check_text(kChain);
    EXPECT_EQ(problems_of(plan), "");
    ASSERT_EQ(plan.nodes.size(), 2u);
    EXPECT_EQ(plan.nodes[0].id, "first");
    EXPECT_EQ(plan.nodes[1].id, "last");
    EXPECT_EQ(plan.find("last"), 1);
    EXPECT_EQ(plan.find("nobody"), -1);
    ASSERT_EQ(plan.nodes[1].inputs.size(), 1u);
    ASSERT_EQ(plan.nodes[1].inputs[0].size(), 1u);
    EXPECT_EQ(plan.nodes[1].inputs[0][0].node, 0);
    EXPECT_EQ(plan.nodes[1].inputs[0][0].output, 0);
    EXPECT_TRUE(plan.nodes[0].ok && plan.nodes[1].ok);
}

}  // namespace
}  // namespace voxloom
