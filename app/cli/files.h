#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/graph/node.h"

namespace voxloom::cli {

// Writes to a temporary name beside `file`, then renames; makes the folder. Throws Error.
void write_text_file(const std::filesystem::path& file, const std::string& text);

// Throws Error, naming `option`, where the folder neither takes files nor can be made: before an hour's
// work, not after it.
void require_writable(const std::filesystem::path& folder, std::string_view option);

// Does the node name the file's ending among its keywords ("vxw")?
bool names_ending(const NodeType& type, const std::filesystem::path& file);

}  // namespace voxloom::cli
