#include "tests/window/screen.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <thread>

#include "core/base/error.h"

namespace voxloom::testing {

namespace fs = std::filesystem;

namespace {

bool is_installed(const std::string& program) {
    return std::system(("command -v " + program + " >/dev/null 2>&1").c_str()) == 0;
}

pid_t spawn(const std::vector<std::string>& command, const std::vector<std::string>& environment, const fs::path& log) {
    std::vector<char*> argv;
    for (const std::string& part : command) argv.push_back(const_cast<char*>(part.c_str()));
    argv.push_back(nullptr);
    const pid_t process = fork();
    if (process < 0) fail("no process can be started for {}", command[0]);
    if (process > 0) return process;
    for (const std::string& variable : environment) putenv(const_cast<char*>(variable.c_str()));
    const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
    dup2(out, STDOUT_FILENO);
    dup2(out, STDERR_FILENO);
    execvp(argv[0], argv.data());
    _exit(127);
}

void sleep_ms(int ms) { std::this_thread::sleep_for(std::chrono::milliseconds(ms)); }

}  // namespace

std::string why_no_display() {
    if (!is_installed("Xvfb")) return "Xvfb is not installed";
    if (!is_installed("xdotool")) return "xdotool is not installed";
    return {};
}

// --- the display ---------------------------------------------------------------------------------

VirtualDisplay::VirtualDisplay(int width, int height) {
    int ends[2];
    if (pipe(ends) != 0) fail("no pipe can be made");
    process_ = spawn({"Xvfb", "-displayfd", std::to_string(ends[1]), "-screen", "0", fmt::format("{}x{}x24", width, height),
                      "-nolisten", "tcp", "-fbdir", folder_.path().string()}, {}, "/dev/null");
    close(ends[1]);
    // It picks a free number and says it once it is ready.
    char c = 0;
    std::string number;
    while (::read(ends[0], &c, 1) == 1 && c != '\n') number += c;
    close(ends[0]);
    if (number.empty()) fail("Xvfb did not start");
    name_ = ":" + number;
}

VirtualDisplay::~VirtualDisplay() {
    ::kill(process_, SIGTERM);
    waitpid(process_, nullptr, 0);
}

// Xvfb keeps its screen in a file of the X Window Dump format: a header of 32-bit numbers, most significant byte first,
// a name that fills it up, 12 bytes for each colour of a palette, then lines of pixels.
std::string VirtualDisplay::screen() const {
    std::ifstream in(folder_.path() / "Xvfb_screen0", std::ios::binary);
    const std::string dump{std::istreambuf_iterator<char>(in), {}};
    auto number = [&](std::size_t i) {
        std::size_t value = 0;
        for (std::size_t k = 4 * i; k < 4 * i + 4; ++k) value = value << 8 | static_cast<unsigned char>(dump.at(k));
        return value;
    };
    const std::size_t pixels = number(0) + 12 * number(19), height = number(5), line_bytes = number(12);
    if (dump.size() < pixels + height * line_bytes) fail("the display has no screen to read");
    return dump.substr(pixels, height * line_bytes);
}

// --- the editor ----------------------------------------------------------------------------------

EditorProcess::EditorProcess(const VirtualDisplay& display, const fs::path& folder, const std::vector<std::string>& arguments)
    : display_(display.name()), folder_(folder), screen_(folder / "screen.json") {
    fs::create_directories(folder);
    std::error_code error;
    fs::remove(screen_, error);
    std::vector<std::string> command{VOXLOOM_BINARY_DIR "/bin/voxloom", "edit", "--screen", screen_.string(),
                                     "--out", (folder / "out").string()};
    command.insert(command.end(), arguments.begin(), arguments.end());
    process_ = spawn(command, {"DISPLAY=" + display_, "XDG_CONFIG_HOME=" + (folder / "config").string(),
                               "XDG_STATE_HOME=" + (folder / "state").string()}, folder / "editor.log");
}

EditorProcess::~EditorProcess() { kill(); }

void EditorProcess::kill() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
    process_ = 0;
}

int EditorProcess::wait() {
    int status = 0;
    for (int i = 0; i < 1200; ++i) {
        if (waitpid(process_, &status, WNOHANG) == process_) {
            process_ = 0;
            return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
        }
        sleep_ms(50);
    }
    fail("the editor does not end");
}

nlohmann::json EditorProcess::read() const {
    std::ifstream in(screen_);
    return nlohmann::json::parse(in, nullptr, false);
}

nlohmann::json EditorProcess::wait_for(const std::string& what, const std::function<bool(const nlohmann::json&)>& condition) {
    for (int i = 0; i < 2400; ++i) {
        nlohmann::json screen = read();
        if (screen.is_object() && condition(screen)) return screen;
        int status = 0;
        if (process_ > 0 && waitpid(process_, &status, WNOHANG) == process_) {
            process_ = 0;
            std::ifstream log(folder_ / "editor.log");
            fail("the editor ended (status {}) before {}: {}", status, what, std::string(std::istreambuf_iterator<char>(log), {}));
        }
        sleep_ms(25);
    }
    const nlohmann::json screen = read();
    fail("in a minute there was not {}; on the screen: {}", what, screen.is_object() ? screen.dump().substr(0, 6000) : "nothing");
}

nlohmann::json EditorProcess::idle() {
    pause();
    return wait_for("rest", [](const nlohmann::json& s) { return !s["busy"].get<bool>(); });
}

nlohmann::json EditorProcess::with(const std::string& item) {
    return wait_for("'" + item + "'", [&](const nlohmann::json& s) { return s["items"].contains(item); });
}

void EditorProcess::xdotool(const std::string& command) {
    if (std::system(("DISPLAY=" + display_ + " xdotool " + command + " >/dev/null 2>&1").c_str()) != 0)
        fail("xdotool {} failed", command);
}

// Until what was done is shown, or nothing more will be.
void EditorProcess::pause() {
    const nlohmann::json first = read();
    const int before = first.is_object() ? first["frame"].get<int>() : 0;
    for (int i = 0; i < 40; ++i) {
        sleep_ms(25);
        const nlohmann::json now = read();
        if (!now.is_object() || i < 2) continue;
        if (now["frame"].get<int>() >= before + 2 || (i >= 8 && now["resting"].get<bool>())) return;
    }
}

void EditorProcess::move_to(const std::string& item, double x, double y) {
    with(item);
    pause();  // what has just come up may still move
    const nlohmann::json r = with(item)["items"][item];
    const double left = r[0], top = r[1], right = r[2], bottom = r[3];
    xdotool(fmt::format("mousemove {} {}", int(left + (right - left) * x), int(top + (bottom - top) * y)));
    pause();
}

void EditorProcess::move_by(int x, int y) {
    xdotool(fmt::format("mousemove_relative -- {} {}", x, y));
    pause();
}

void EditorProcess::press(int button) {
    xdotool(fmt::format("mousedown {}", button));
    pause();
}

void EditorProcess::release(int button) {
    xdotool(fmt::format("mouseup {}", button));
    pause();
}

void EditorProcess::click(const std::string& item, double x, double y) {
    move_to(item, x, y);
    press();
    release();
}

void EditorProcess::press_with(const std::string& modifier, const std::string& item) {
    xdotool("keydown " + modifier);
    click(item);
    xdotool("keyup " + modifier);
    pause();
}

void EditorProcess::drag(const std::string& from, const std::string& to) {
    move_to(from);
    press();
    move_by(3, 3);
    move_to(to);
    release();
}

void EditorProcess::key(const std::string& key, const std::string& modifier) {
    if (!modifier.empty()) xdotool("keydown " + modifier);
    pause();
    xdotool("keydown " + key);
    pause();
    xdotool("keyup " + key);
    if (!modifier.empty()) xdotool("keyup " + modifier);
    pause();
}

void EditorProcess::keys_at_once(const std::string& keys) {
    ::kill(process_, SIGSTOP);
    xdotool("key --delay 50 " + keys);  // faster ones are taken for one key that repeats
    ::kill(process_, SIGCONT);
    pause();
}

void EditorProcess::type(const std::string& text) {
    xdotool("type --delay 60 -- '" + text + "'");
    pause();
}

fs::path EditorProcess::screenshot() {
    auto pictures = [&] {
        std::vector<fs::path> all;
        std::error_code error;
        for (const auto& entry : fs::directory_iterator(folder_ / "out", error))
            if (entry.path().filename().string().starts_with("screenshot")) all.push_back(entry.path());
        std::sort(all.begin(), all.end());
        return all;
    };
    const std::size_t before = pictures().size();
    key("F12");
    for (int i = 0; i < 400; ++i) {
        if (auto all = pictures(); all.size() > before) return all.back();
        sleep_ms(25);
    }
    fail("F12 made no screenshot");
}

}  // namespace voxloom::testing
