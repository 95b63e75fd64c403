#include "app/cli/files.h"

#include <unistd.h>

#include <fstream>

#include "core/base/error.h"

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

}  // namespace voxloom::cli
