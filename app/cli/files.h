#pragma once

#include <filesystem>
#include <string>

namespace voxloom::cli {

// Writes to a temporary name beside `file`, then renames; makes the folder. Throws Error.
void write_text_file(const std::filesystem::path& file, const std::string& text);

}  // namespace voxloom::cli
