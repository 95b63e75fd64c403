// A display that nobody sees, the editor on it, and a hand on its mouse and keys.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/volumes.h"

namespace voxloom::testing {

// Empty when Xvfb and xdotool are there, else what is missing.
std::string why_no_display();

class VirtualDisplay {
  public:
    VirtualDisplay(int width, int height);  // throws Error
    ~VirtualDisplay();
    VirtualDisplay(const VirtualDisplay&) = delete;
    VirtualDisplay& operator=(const VirtualDisplay&) = delete;
    const std::string& name() const { return name_; }  // ":7"
    // What somebody would see now, four bytes a pixel, with the pointer's picture.
    std::string screen() const;

  private:
    TempFolder folder_;
    pid_t process_ = 0;
    std::string name_;
};

// `voxloom edit` as a process of its own. Waiting ends after a minute with an Error.
class EditorProcess {
  public:
    EditorProcess(const VirtualDisplay& display, const std::filesystem::path& folder,
                  const std::vector<std::string>& arguments);
    ~EditorProcess();
    EditorProcess(const EditorProcess&) = delete;
    EditorProcess& operator=(const EditorProcess&) = delete;

    // What is on the screen, as `--screen` writes it, once `condition` holds for it.
    nlohmann::json wait_for(const std::string& what, const std::function<bool(const nlohmann::json&)>& condition);
    nlohmann::json idle();                      // nothing runs, nothing is shown that is stale
    nlohmann::json with(const std::string& item);

    // Of an item of the screen; (x, y) is a place in it, from 0 to 1.
    void move_to(const std::string& item, double x = 0.5, double y = 0.5);
    void move_by(int x, int y);
    void press(int button = 1);
    void release(int button = 1);
    void click(const std::string& item, double x = 0.5, double y = 0.5);
    void press_with(const std::string& modifier, const std::string& item);  // a click while a key is held
    void drag(const std::string& from, const std::string& to);
    void key(const std::string& key, const std::string& modifier = "");
    void keys_at_once(const std::string& keys);  // "Tab p h", pressed while the editor is stopped: it sees them all together
    void type(const std::string& text);
    std::filesystem::path screenshot();         // F12
    void kill();                                // at once, as a crash would
    int wait();                                 // its exit status, after it was told to quit
    const std::filesystem::path& folder() const { return folder_; }

  private:
    void xdotool(const std::string& command);
    void pause();                               // a few frames
    nlohmann::json read() const;
    std::string display_;
    std::filesystem::path folder_, screen_;
    pid_t process_ = 0;
};

}  // namespace voxloom::testing
