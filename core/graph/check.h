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
        const NodeType* type = nullptr;  // null: unknown type (a problem, unless it is disabled)
        GraphNode::Use use = GraphNode::Use::normal;
        // Why it does not run though nothing is wrong with it: "it is disabled", "it needs 'ct', which
        // is disabled"; empty: it does. What is off is not ok.
        std::string off;
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

// Nodes that are not used:
//  - A bypassed node does not run. What is wired to one of its outputs gets what its first input of the
//    same type gets, else its first input of a type that the consumer takes, too. Where there is no
//    such input it is a problem of the node, which names the output and who asks for it.
//  - A disabled node does not run, and nothing of it is checked. An input that can do without it is as
//    if it were not wired; a node that cannot does not run either, which is no problem.
//
// Every problem is found, not only the first: types, ports, wires, cycles, parameters, shapes.
// The plan is usable for the nodes that are ok.
Plan check(const Graph& graph, const Registry& registry, const CheckOptions& options = {});

}  // namespace voxloom
