// The loader: what it refuses, and what it says.

#include "core/plugin/loader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>

#include "core/base/error.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

fs::path test_plugin(const std::string& name) {
    return fs::path(VOXLOOM_BINARY_DIR) / "tests/bad-plugins" / (name + ".so");
}

std::string refusal(const fs::path& file) {
    Registry registry;
    try {
        load_plugin(file, registry);
    } catch (const Error& e) {
        return e.what();
    }
    return "";
}

TEST(Loader, refusesAnotherRevisionAndNamesBoth) {
    EXPECT_THAT(refusal(test_plugin("plugin-revision")),
                AllOf(HasSubstr("plugin-revision.so"), HasSubstr("revision 42"), HasSubstr("has 1"),
                      HasSubstr("rebuild")));
}

TEST(Loader, refusesAnotherToolchainAndNamesBoth) {
    EXPECT_THAT(refusal(test_plugin("plugin-fingerprint")),
                AllOf(HasSubstr("compiler of another age"), HasSubstr("libstdc++"), HasSubstr("rebuild")));
}

TEST(Loader, refusesALibraryThatIsNotAPlugin) {
    EXPECT_THAT(refusal(test_plugin("plugin-no_entry")), HasSubstr("is not a voxloom plugin"));
}

TEST(Loader, refusesAFileThatIsNotALibrary) {
    testing::TempFolder folder;
    const fs::path file = folder.path() / "text.so";
    std::ofstream(file) << "not a library";
    EXPECT_THAT(refusal(file), AllOf(HasSubstr("text.so"), HasSubstr("cannot be loaded")));
    EXPECT_THAT(refusal(folder.path() / "missing.so"), HasSubstr("cannot be loaded"));
}

TEST(Loader, refusesANodeWhoseDefaultIsOutOfRange) {
    EXPECT_THAT(refusal(test_plugin("plugin-bad_default")),
                AllOf(HasSubstr("'test.bad-default'"), HasSubstr("'share'"), HasSubstr("between 0 and 1")));
}

TEST(Loader, namesBothPluginsThatOfferOneId) {
    testing::TempFolder folder;
    fs::copy(test_plugin("plugin-same_id"), folder.path() / "first.so");
    fs::copy(test_plugin("plugin-same_id"), folder.path() / "second.so");
    Registry registry;
    LoadReport report = load_plugins(registry, {folder.path()});
    EXPECT_EQ(report.loaded.size(), 1u);
    ASSERT_EQ(report.problems.size(), 1u);
    EXPECT_THAT(report.problems[0], AllOf(HasSubstr("first.so"), HasSubstr("second.so"), HasSubstr("test.same")));
}

TEST(Loader, anEarlierFolderOverridesALaterOneAndTheRestGoesOn) {
    testing::TempFolder a, b;
    fs::copy(test_plugin("plugin-same_id"), a.path() / "p.so");
    fs::copy(test_plugin("plugin-same_id"), b.path() / "p.so");
    fs::copy(test_plugin("plugin-revision"), b.path() / "old.so");
    Registry registry;
    LoadReport report = load_plugins(registry, {a.path(), b.path(), "/no/such/folder"});
    ASSERT_EQ(report.loaded.size(), 1u);
    EXPECT_EQ(report.loaded[0].file, a.path() / "p.so");
    ASSERT_EQ(report.problems.size(), 2u);
    EXPECT_THAT(report.problems[0], HasSubstr("old.so"));
    EXPECT_THAT(report.problems[1], AllOf(HasSubstr("/no/such/folder"), HasSubstr("VOXLOOM_PLUGIN_PATH")));
}

TEST(Loader, searchesTheFoldersOfTheEnvironmentFirst) {
    const char* before = getenv("VOXLOOM_PLUGIN_PATH");
    const std::string kept = before ? before : "";
    setenv("VOXLOOM_PLUGIN_PATH", "/one::/two", 1);
    auto folders = plugin_search_path();
    before ? setenv("VOXLOOM_PLUGIN_PATH", kept.c_str(), 1) : unsetenv("VOXLOOM_PLUGIN_PATH");
    ASSERT_EQ(folders.size(), 3u);
    EXPECT_EQ(folders[0], "/one");
    EXPECT_EQ(folders[1], "/two");
    EXPECT_THAT(folders[2].string(), HasSubstr("lib/voxloom/plugins"));
}

}  // namespace
}  // namespace voxloom
