#include "core/graph/params.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace voxloom {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::string problem(const ParamSpec& spec, ParamValue value) { return problem_with(spec, value); }

TEST(Params, NumbersAreCheckedAgainstTheirRangeInclusively) {
    const ParamSpec spec = param::real("a", 0.5, "doc").range(0, 1);
    EXPECT_THAT(problem(spec, 0.0), IsEmpty());
    EXPECT_THAT(problem(spec, 1.0), IsEmpty());
    EXPECT_THAT(problem(spec, 1.5), HasSubstr("between 0 and 1, not 1.5"));
    EXPECT_THAT(problem(spec, std::nan("")), HasSubstr("must be a number"));
    EXPECT_THAT(problem(spec, std::string("1")), HasSubstr("must be a number"));
}

TEST(Params, WholeNumbersAndRealsTurnIntoEachOtherWhereNothingIsLost) {
    ParamValue value = std::int64_t(3);
    EXPECT_THAT(problem_with(param::real("a", 0, "doc"), value), IsEmpty());
    EXPECT_EQ(value, ParamValue(3.0));
    value = 4.0;
    EXPECT_THAT(problem_with(param::integer("a", 0, "doc"), value), IsEmpty());
    EXPECT_EQ(value, ParamValue(std::int64_t(4)));
    EXPECT_THAT(problem(param::integer("a", 0, "doc"), 4.5), HasSubstr("whole number"));
    EXPECT_THAT(problem(param::integer("a", 0, "doc"), 1e300), HasSubstr("whole number"));
}

TEST(Params, ListsHaveTheirLengthAndEveryNumberIsChecked) {
    const ParamSpec size = param::vector("size", {1, 1}, "doc").range(1, 9).whole();
    EXPECT_THAT(problem(size, std::vector<double>{2, 9}), IsEmpty());
    EXPECT_THAT(problem(size, std::vector<double>{2}), HasSubstr("2 numbers, not 1"));
    EXPECT_THAT(problem(size, std::vector<double>{2, 10}), HasSubstr("between 1 and 9"));
    EXPECT_THAT(problem(size, std::vector<double>{2, 2.5}), HasSubstr("must be whole"));
    const ParamSpec points = param::rows("points", 2, {}, "doc");
    EXPECT_THAT(problem(points, Rows{{1, 2}, {3, 4}}), IsEmpty());
    EXPECT_THAT(problem(points, Rows{{1, 2}, {3}}), HasSubstr("each row must have 2 numbers"));
}

TEST(Params, AWrongChoiceIsAnsweredWithTheNearestOne) {
    const ParamSpec spec = param::choice("filter", {"average", "subsample"}, "average", "doc");
    EXPECT_THAT(problem(spec, std::string("avarage")), HasSubstr("did you mean 'average'?"));
}

TEST(Params, YamlIsPlainOnlyWhereItCannotMeanAnythingElse) {
    EXPECT_EQ(to_yaml(0.1), "0.1");
    EXPECT_EQ(to_yaml(std::string("cthead.nrrd")), "cthead.nrrd");
    for (const char* word : {"", "yes", "null", "1.5", "a b", "a: b", "#x", "-"})
        EXPECT_EQ(to_yaml(std::string(word)).front(), '"') << word;
    EXPECT_EQ(to_yaml(std::string("a\"b\\c\n")), "\"a\\\"b\\\\c\\x0a\"");
    EXPECT_EQ(to_yaml(std::vector<double>{1, 0.5}), "[1, 0.5]");
    EXPECT_EQ(to_yaml(Rows{{1, 2}, {}}), "[[1, 2], []]");
    EXPECT_EQ(to_yaml(std::vector<std::string>{"a", "b c"}), "[a, \"b c\"]");
}

TEST(Params, OnlyWhatAffectsTheOutputEntersTheHash) {
    const std::vector<ParamSpec> specs = {param::real("a", 1, "doc"),
                                          param::integer("threads", 0, "doc").changes(Affects::cost)};
    auto hash = [&](double a, std::int64_t threads) {
        Params params(specs, "/folder");
        params.set("a", a);
        params.set("threads", threads);
        Hasher hasher;
        params.hash_into(hasher);
        return hasher.finish();
    };
    EXPECT_EQ(hash(1, 0), hash(1, 8));
    EXPECT_NE(hash(1, 0), hash(2, 0));
}

TEST(Params, InputPathsAreTakenFromTheGraphsFolder) {
    const std::vector<ParamSpec> specs = {param::path_in("path", "doc"), param::path_out("to", "x.png", "doc")};
    Params params(specs, "/graphs");
    EXPECT_EQ(params.path("path"), "");
    params.set("path", std::string("../data/a.nrrd"));
    EXPECT_EQ(params.path("path"), "/data/a.nrrd");
    EXPECT_EQ(params.path("to"), "x.png");
    params.set("path", std::string("/elsewhere/a.nrrd"));
    EXPECT_EQ(params.path("path"), "/elsewhere/a.nrrd");
    EXPECT_TRUE(params.was_set("path"));
    EXPECT_FALSE(params.was_set("to"));
}

}  // namespace
}  // namespace voxloom
