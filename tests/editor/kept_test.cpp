#include "app/editor/model/kept.h"

#include <gtest/gtest.h>

namespace voxloom::editor {
namespace {

TEST(Kept, endsSoManySecondsAfterItsLastUseAndNoSooner) {
    Kept kept{30};
    EXPECT_TRUE(kept.is_over(0)) << "nobody has used it";
    kept.use(100);
    EXPECT_FALSE(kept.is_over(100));
    EXPECT_FALSE(kept.is_over(130));
    EXPECT_TRUE(kept.is_over(130.5));
    kept.use(125);
    EXPECT_FALSE(kept.is_over(155)) << "each use counts anew";
    EXPECT_TRUE(kept.is_over(155.5));
    kept.use(200);
    EXPECT_FALSE(kept.is_over(201)) << "what comes back is kept again";
}

}  // namespace
}  // namespace voxloom::editor
