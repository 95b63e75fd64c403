// The check pass: from a graph and the registry to a plan, without touching a voxel.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/graph/document.h"
#include "core/graph/node.h"
#include "core/plugin/registry.h"

namespace voxloom {

struct Plan {
    struct Source {
        int node = -1;    // index into Plan::nodes
        int output = -1;  // index into that node's type->outputs
    };
    struct Node {
        std::string id;
        const NodeType* type = nullptr;  // null: unknown type (a problem)
        Params params;
        std::vector<std::vector<Source>> inputs;  // by index of type->inputs; empty: not wired
        std::vector<ValueDesc> outputs;           // described, by index of type->outputs
        std::uint64_t working_bytes = 0;
        Mark mark;
        bool ok = false;                          // it and all of its ancestors have no problem
    };
    // In topological order: every source stands before its consumers, but for nodes on a cycle,
    // which are not ok.
    std::vector<Node> nodes;
    std::vector<Source> wanted;   // what the graph asks for; output -1: the node itself (a writer)
    std::vector<Problem> problems;  // in order of line
    std::vector<std::string> warnings;
    std::filesystem::path file, folder;
    int find(std::string_view id) const;  // -1 when there is none
    std::map<std::string, int, std::less<>> index;  // id to position in nodes
};

struct CheckOptions {
    // NODE.PARAM=VALUE of the command line; relative paths in them are taken from `overrides_base`.
    std::vector<std::string> overrides;
    std::filesystem::path overrides_base;
    std::uint64_t memory_limit = 0;  // warn when the dense outputs exceed it; 0: physical memory
};

// Every problem is found, not only the first: types, ports, wires, cycles, parameters, shapes.
// The plan is usable for the nodes that are ok.
Plan check(const Graph& graph, const Registry& registry, const CheckOptions& options = {});

}  // namespace voxloom
