#include "app/cli/files.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "core/base/error.h"
#include "core/base/output_file.h"

namespace voxloom::cli {

namespace fs = std::filesystem;

void write_text_file(const fs::path& file, const std::string& text) {
    std::error_code error;
    if (file.has_parent_path()) fs::create_directories(file.parent_path(), error);
    const fs::path temporary = file.string() + ".tmp" + std::to_string(getpid());
    std::ofstream out(temporary, std::ios::binary);
    out << text;
    out.close();
    if (!out) {
        fs::remove(temporary, error);
        fail("{}: cannot be written; is the folder there, and writable?", file.string());
    }
    fs::rename(temporary, file, error);
    if (error) fail("{}: cannot be written: {}", file.string(), error.message());
}

void require_writable(const fs::path& folder, std::string_view option) {
    fs::path there = fs::absolute(folder.empty() ? fs::path(".") : folder);
    while (!fs::exists(there) && there.has_parent_path() && there != there.parent_path()) there = there.parent_path();
    if (!fs::is_directory(there))
        fail("{} {}: {} is a file, not a folder; choose another place", option, folder.string(), there.string());
    if (access(there.c_str(), W_OK | X_OK) != 0)
        fail("{} {}: {} cannot be written to ({}); choose another place", option, folder.string(), there.string(),
             std::error_code(errno, std::generic_category()).message());
}

bool names_ending(const NodeType& type, const fs::path& file) {
    const std::string ending = extension_of(file);
    return !ending.empty() && std::ranges::find(type.keywords, ending.substr(1)) != type.keywords.end();
}

}  // namespace voxloom::cli
