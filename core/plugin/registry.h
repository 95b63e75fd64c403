// What there is: node types and where they came from.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/graph/node.h"

namespace voxloom {

class Registry {
  public:
    // Throws Error when the id is taken, naming both origins, or when the description itself is
    // wrong (a default out of range, two parameters with one key, ...).
    void add(NodeType type);
    const NodeType* find(std::string_view id) const;
    std::vector<const NodeType*> all() const;  // sorted by id
    const std::vector<std::string>& ids() const { return ids_; }
    const std::string& origin(std::string_view id) const;  // file of the plugin

    // Everything added from now on is recorded as coming from `origin`.
    void set_origin(std::string origin) { origin_ = std::move(origin); }

  private:
    struct Entry {
        NodeType type;
        std::string origin;
    };
    std::map<std::string, Entry, std::less<>> types_;
    std::vector<std::string> ids_;
    std::string origin_ = "built in";
};

// What is wrong with a description, or empty. The registry refuses such types.
std::string problem_with(const NodeType& type);

}  // namespace voxloom
