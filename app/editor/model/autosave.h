// What is not saved survives a crash: it is written to a file of the session's own in
// $XDG_STATE_HOME/voxloom, else ~/.local/state/voxloom, and found there by the next session.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "app/editor/model/workspace.h"

namespace voxloom::editor {

std::filesystem::path autosave_folder();

// The unsaved text of this process. Errors are kept quiet: nothing that is worth stopping anybody for.
class Autosave {
  public:
    explicit Autosave(std::filesystem::path folder);
    ~Autosave();  // removes the file where the session ends as it should, and not by an exception
    Autosave(const Autosave&) = delete;
    Autosave& operator=(const Autosave&) = delete;

    // Writes where there is something unsaved that was not written, at most every `seconds`; removes
    // the file where everything is saved. `now` counts seconds from any beginning.
    void update(const Workspace& workspace, double now, double seconds = 1);
    // Whether update() has something to write a little later.
    bool due() const { return due_; }

  private:
    std::filesystem::path file_;
    std::string written_;
    double last_ = -1e30;
    bool due_ = false, there_ = false;
};

struct Recovered {
    std::filesystem::path autosaved;
    Workspace workspace;  // with its unsaved changes
};
// What sessions left behind that are not running any more. Files that are no graphs are removed.
std::vector<Recovered> find_recoverable(const std::filesystem::path& folder);

}  // namespace voxloom::editor
