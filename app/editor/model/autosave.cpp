#include "app/editor/model/autosave.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <exception>
#include <fstream>

#include "core/base/error.h"
#include "core/base/output_file.h"
#include "core/base/text.h"

namespace voxloom::editor {

namespace fs = std::filesystem;

namespace {

// The first line says which file the text belongs to, and is no part of it.
constexpr std::string_view kHead = "# unsaved: ";

// A process with this number that runs this very program.
bool is_running(std::int64_t process) {
    std::error_code error;
    const fs::path its = fs::read_symlink(fmt::format("/proc/{}/exe", process), error);
    return !error && its == fs::read_symlink("/proc/self/exe", error);
}

std::string content_of(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

// Where one of them cannot be asked it is not.
bool is_newer(const fs::path& file, const fs::path& other) {
    std::error_code error, other_error;
    const auto time = fs::last_write_time(file, error), other_time = fs::last_write_time(other, other_error);
    return !error && !other_error && time > other_time;
}

}  // namespace

fs::path autosave_folder() {
    if (const char* state = std::getenv("XDG_STATE_HOME"); state && *state) return fs::path(state) / "voxloom";
    const char* home = std::getenv("HOME");
    return fs::path(home ? home : ".") / ".local/state/voxloom";
}

Autosave::Autosave(fs::path folder) : file_(folder / fmt::format("{}.unsaved", getpid())) {}

Autosave::~Autosave() {
    std::error_code error;
    if (there_ && std::uncaught_exceptions() == 0) fs::remove(file_, error);
}

void Autosave::update(const Workspace& workspace, double now, double seconds) {
    const bool changed = workspace.changed();
    if (!changed && there_) {
        std::error_code error;
        fs::remove(file_, error);
        there_ = false;
        written_.clear();
    }
    due_ = changed && workspace.document.text() != written_;
    if (!due_ || now - last_ < seconds) return;
    last_ = now;
    due_ = false;
    written_ = workspace.document.text();
    try {
        fs::create_directories(file_.parent_path());
        OutputFile out(file_);
        out.write(fmt::format("{}{}\n", kHead, workspace.file.empty() ? "" : fs::absolute(workspace.file).string()));
        out.write(written_);
        out.commit();
        there_ = true;
    } catch (const std::exception&) {
        // Tried again after the next change.
    }
}

std::vector<Recovered> find_recoverable(const fs::path& folder) {
    std::vector<Recovered> found;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
        std::int64_t process = 0;
        if (entry.path().extension() != ".unsaved" || !parse_integer(entry.path().stem().string(), process)) continue;
        if (is_running(process)) continue;
        const std::string text = content_of(entry.path());
        const std::size_t line = text.find('\n');
        try {
            if (!text.starts_with(kHead) || line == std::string::npos) fail("no autosaved graph");
            Recovered recovered;
            recovered.autosaved = entry.path();
            Workspace& work = recovered.workspace;
            work.file = text.substr(kHead.size(), line - kHead.size());
            work.document = Document::parse(text.substr(line + 1), work.file);
            // Of a file that was written after that nobody here has seen what it holds: saving asks.
            if (!work.file.empty() && !is_newer(work.file, entry.path())) work.saved_text = content_of(work.file);
            found.push_back(std::move(recovered));
        } catch (const Error&) {
            std::error_code ignored;
            fs::remove(entry.path(), ignored);
        }
    }
    return found;
}

}  // namespace voxloom::editor
