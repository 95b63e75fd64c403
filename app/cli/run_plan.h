// What commands that run graphs share: from a plan to files, and from a result to messages.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/graph/evaluate.h"
#include "core/plugin/registry.h"

namespace voxloom::cli {

struct Saver {
    int node;  // of the plan
    std::filesystem::path file;
};
// Every wanted image, table and volume gets a writer behind it, as if the graph had one; files are named
// NODE.PORT, then the suffix.
std::vector<Saver> add_savers(Plan& plan, const Registry& registry, const std::string& suffix = {});

// Throws Error, naming the option, when the graph has no such node.
int node_named(const Plan& plan, std::string_view id, std::string_view option);
// Makes NODE.PORT and NODE what is wanted, where there are any.
void select_outputs(Plan& plan, const std::vector<std::string>& outputs);

// Errors and warnings, as sentences, on standard error.
void print_messages(const Plan& plan, const RunResult& result);

}  // namespace voxloom::cli
