#include "app/editor/view/editor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "app/editor/view/actions.h"
#include "core/base/error.h"
#include "core/base/text.h"

namespace voxloom::editor {

namespace fs = std::filesystem;

Editor::Editor(const Registry& nodes, fs::path remembered, std::function<void()> wake)
    : registry(nodes), settings_file(std::move(remembered)), settings(load_settings(settings_file)),
      examples(find_examples()),
      recovered(find_recoverable(autosave_folder())), ask_about_recovery(!recovered.empty()), histograms(wake), gradients(wake, 8), small_pictures(wake, 1024), differences(wake, 1), decoded(wake), image_errors(wake), loaded(wake, 1), picks(wake, 2), evaluator(nodes, wake) {}

// --- small things that all regions use -----------------------------------------------------------

void say(Editor& editor, std::string message, bool error) {
    editor.message = std::move(message);
    editor.message_is_error = error;
    editor.message_until = ImGui::GetTime() + (error ? 6 : 3);
}

void changes_at(Editor& editor, double time) { editor.next_change = std::min(editor.next_change, time); }

void edit(Editor& editor, const std::function<void()>& f) {
    // A value that is dragged is one step from the button's press to its release.
    if (!editor.drag_step && ImGui::IsMouseDown(ImGuiMouseButton_Left)) editor.drag_step.emplace(editor.work.document);
    try {
        f();
    } catch (const Error& e) {
        say(editor, e.what(), true);
    }
}

void close_drag_step(Editor& editor) { editor.drag_step.reset(); }

void mark(Editor& editor, std::string name) {
    mark(editor, std::move(name), ImGui::GetItemRectMin(), ImGui::GetItemRectMax());
}

void mark(Editor& editor, std::string name, ImVec2 lo, ImVec2 hi) {
    if (editor.marks_wanted) editor.marks.push_back({std::move(name), lo, hi});
}

const NodeStatus* status_of(const Editor& editor, const std::string& node) {
    auto found = editor.live.nodes.find(node);
    return found == editor.live.nodes.end() ? nullptr : &found->second;
}

// --- documents -----------------------------------------------------------------------------------

void begin_document(Editor& editor, Workspace work) {
    close_drag_step(editor);
    editor.work = std::move(work);
    // Nothing is known of it yet; it is handed to the evaluator when the frame ends.
    editor.live = {};
    editor.live.busy = true;
    editor.texts.clear();
    editor.id_of.clear();
    editor.tried.clear();
    editor.sweep.reset();
    editor.loaded.clear();
    for (Picture& picture : editor.viewport.pictures) picture.port = {};
    editor.viewport.against = Viewport::Against::first;
    editor.viewport.zoom = 0;
    editor.start_page = false;
    fit_canvas(editor);
}

void save_to(Editor& editor, const fs::path& file) {
    close_drag_step(editor);
    try {
        save_workspace(editor.work, file, editor.registry);
        remember(editor.settings, file);
        save_settings(editor.settings, editor.settings_file);
        say(editor, "Saved " + file.string());
        if (auto next = std::exchange(editor.after_saving_asked, nullptr)) next();
    } catch (const Error& e) {
        editor.after_saving_asked = nullptr;
        say(editor, e.what(), true);
    }
}

namespace {

void save_or_ask(Editor& editor, const fs::path& file) {
    editor.overwriting_destroys = what_saving_destroys(editor.work, file);
    if (editor.overwriting_destroys.empty()) return save_to(editor, file);
    editor.overwriting = file;
    editor.ask_about_overwriting = true;
}

}  // namespace

void new_graph(Editor& editor) { begin_document(editor, {}); }

void open_graph(Editor& editor, const fs::path& file) {
    try {
        begin_document(editor, open_workspace(file));
        remember(editor.settings, file);
        save_settings(editor.settings, editor.settings_file);
    } catch (const Error& e) {
        say(editor, e.what(), true);
        if (std::error_code error; fs::exists(file, error) || error) return;
        forget(editor.settings, file);
        save_settings(editor.settings, editor.settings_file);
    }
}

void save(Editor& editor) {
    if (editor.work.file.empty()) return save_as(editor);
    save_or_ask(editor, editor.work.file);
}

void save_as(Editor& editor) {
    open_file_dialog(editor, FileDialog::Purpose::save_graph, editor.work.file, [&editor](const fs::path& file) {
        fs::path named = file;
        if (!named.has_extension()) named += ".yaml";
        save_or_ask(editor, named);
    });
}

void unless_changed(Editor& editor, std::function<void()> f) {
    if (!editor.work.changed()) return f();
    editor.after_saving_asked = std::move(f);
    editor.ask_about_changes = true;
}

// --- evaluation ----------------------------------------------------------------------------------

namespace {

bool contains(const std::vector<WireEnd>& ports, const WireEnd& port) {
    return std::any_of(ports.begin(), ports.end(), [&](const WireEnd& p) { return same_end(p, port); });
}

}  // namespace

std::vector<WireEnd> ports_to_look_at(const Editor& editor) {
    std::vector<WireEnd> ports;
    auto add = [&](const GraphNode& node, std::string_view only, PortType wanted) {
        if (const NodeType* type = editor.registry.find(node.type))
            for (const PortSpec& port : type->outputs)
                if (type_of(port) == wanted && (only.empty() || port.key == only))
                    if (const WireEnd end{node.id, port.key, {}}; !contains(ports, end)) ports.push_back(end);
    };
    for (PortType wanted : {PortType::image, PortType::table}) {
        for (const WireEnd& end : editor.work.graph().outputs)
            if (const GraphNode* node = editor.work.graph().find(end.node)) add(*node, end.port, wanted);
        for (const GraphNode& node : editor.work.graph().nodes) add(node, {}, wanted);
    }
    return ports;
}

std::size_t most_shown(Viewport::Mode mode) { return mode == Viewport::Mode::single ? 1 : mode == Viewport::Mode::four ? 4 : 2; }

namespace {

// Of its node's outputs; -1 where there is no such one.
struct Output {
    const NodeType* type = nullptr;
    std::ptrdiff_t index = -1;
};

Output output_of(const Editor& editor, const WireEnd& port) {
    const GraphNode* node = editor.work.graph().find(port.node);
    const NodeType* type = node ? editor.registry.find(node->type) : nullptr;
    const PortSpec* spec = type ? type->find_output(port.port) : nullptr;
    return {type, spec ? spec - type->outputs.data() : -1};
}

}  // namespace

bool makes_image(const Editor& editor, const WireEnd& port) {
    const Output output = output_of(editor, port);
    return output.index >= 0 && type_of(output.type->outputs[std::size_t(output.index)]) == PortType::image;
}

std::vector<WireEnd> shown_ports(const Editor& editor) {
    const std::vector<WireEnd> all = ports_to_look_at(editor);
    const std::size_t count = most_shown(editor.viewport.mode);
    std::vector<WireEnd> shown;
    for (std::size_t k = 0; k < count; ++k) {
        if (const WireEnd& chosen = editor.viewport.pictures[k].port; contains(all, chosen)) {
            shown.push_back(chosen);
            continue;
        }
        auto next = std::ranges::find_if(all, [&](const WireEnd& end) { return !contains(shown, end) && (shown.empty() || makes_image(editor, end)); });
        if (next != all.end()) shown.push_back(*next);
    }
    return shown;
}

glm::ivec2 whole_size(const Editor& editor, const WireEnd& port, glm::ivec2 otherwise) {
    const NodeStatus* status = status_of(editor, port.node);
    const std::ptrdiff_t index = output_of(editor, port).index;
    if (index < 0 || !status || std::size_t(index) >= status->outputs.size()) return otherwise;
    const auto* image = std::get_if<ImageDesc>(&status->outputs[std::size_t(index)].detail);
    return image && image->size.x > 0 && image->size.y > 0 ? image->size : otherwise;
}

namespace {

// Where nodes stand and what is written beside them changes no result.
bool same_results(const Graph& a, const Graph& b) {
    Graph x = a, y = b;
    for (Graph* graph : {&x, &y}) {
        for (GraphNode& node : graph->nodes) node.at.reset();
        graph->editor.clear();
    }
    return x.file == y.file && same_content(x, y);
}

void submit(Editor& editor, const Graph& graph, bool coarse, bool write) {
    Evaluator::Request request;
    request.graph = graph;
    request.watched = editor.watched;
    if (!coarse) {
        for (const WireEnd& reference : editor.references)
            if (!contains(request.watched, reference)) request.watched.push_back(reference);
        for (std::size_t k = 0; k < editor.references.size(); ++k) {
            if (!is_without_codec(editor.references[k].node)) continue;
            for (GraphNode& node : nodes_without_codec(graph, editor.registry, branch_of(graph, editor.registry, editor.watched[k])))
                if (std::ranges::none_of(request.extra, [&](const GraphNode& n) { return n.id == node.id; })) request.extra.push_back(std::move(node));
        }
    }
    request.coarse = coarse;
    request.write = write;
    request.output_folder = editor.output_folder;
    editor.submitted = editor.work.graph();
    editor.submitted_text = editor.work.document.text();
    editor.submitted_coarse = coarse;
    editor.ever_submitted = true;
    editor.evaluator.submit(std::move(request));
}

}  // namespace

namespace {

// Of the codec's newest value there is all that will be.
bool is_measured(const Editor& editor, const Sweep& sweep) {
    for (std::size_t k = 0; k < editor.branches.size(); ++k)
        if (editor.branches[k].codec == sweep.node && needs_decoding(editor.branches[k], editor.live) && editor.measures[k].decoding) return false;
    return true;
}

// One value after the other, each when the one before has been computed and measured; then the document again, which
// any change of it ends the sweep for. So does leaving the comparison: nobody sees then what comes of it.
void go_on_with_sweep(Editor& editor) {
    Sweep& sweep = *editor.sweep;
    if (editor.viewport.mode == Viewport::Mode::single || !same_results(editor.submitted, editor.work.graph())) return editor.sweep.reset();
    if (editor.live.busy || (sweep.next > 0 && !is_measured(editor, sweep))) return;
    if (sweep.next < sweep.values.size()) return submit(editor, graph_with(editor.work.graph(), sweep, sweep.next++), false, false);
    editor.sweep.reset();
}

}  // namespace

void submit_changes(Editor& editor) {
    if (editor.viewport.mode != Viewport::Mode::single) {
        update_branches(editor);
        collect_tried(editor.tried, editor.branches, editor.measures, editor.live);
    }
    if (editor.sweep) {
        go_on_with_sweep(editor);
        if (editor.sweep) return;
        editor.ever_submitted = false;
    }
    std::vector<WireEnd> shown = shown_ports(editor);
    std::vector<WireEnd> references = references_of(editor, shown);
    const bool others = !std::ranges::equal(shown, editor.watched, same_end) || !std::ranges::equal(references, editor.references, same_end);
    if (others) editor.watched = std::move(shown), editor.references = std::move(references);
    bool changed = !editor.ever_submitted || others;
    if (!changed && editor.submitted_text != editor.work.document.text()) {
        changed = !same_results(editor.submitted, editor.work.graph());
        editor.submitted_text = editor.work.document.text();
    }
    if (changed || (editor.submitted_coarse && !editor.moving)) submit(editor, editor.work.graph(), editor.moving, false);
}

void write_files(Editor& editor) {
    editor.sweep.reset();
    submit(editor, editor.work.graph(), false, true);
    say(editor, "Writing files to " + fs::absolute(editor.output_folder).lexically_normal().string());
}

// --- a frame -------------------------------------------------------------------------------------

namespace {

constexpr ImGuiWindowFlags kRegion = ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                                     ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings |
                                     ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoNavInputs;
constexpr ImGuiWindowFlags kCanvas = ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse | ImGuiWindowFlags_NoBackground;

void region(const char* name, ImVec2 lo, ImVec2 hi, ImGuiWindowFlags flags, ImVec2 padding, const std::function<void()>& f) {
    ImGui::SetNextWindowPos(lo);
    ImGui::SetNextWindowSize({std::max(hi.x - lo.x, 1.f), std::max(hi.y - lo.y, 1.f)});
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, padding);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowMinSize, ImVec2(1, 1));
    ImGui::Begin(name, nullptr, kRegion | flags);
    ImGui::PopStyleVar(2);
    f();
    ImGui::End();
}

// A thin strip between two regions that can be dragged. `share` is of the length from `from` on.
void splitter(Editor& editor, const char* name, bool vertical, ImVec2 lo, ImVec2 hi, float from, float length, float& share) {
    region(name, lo, hi, ImGuiWindowFlags_NoScrollbar, {0, 0}, [&] {
        ImGui::InvisibleButton("drag", {std::max(hi.x - lo.x, 1.f), std::max(hi.y - lo.y, 1.f)});
        mark(editor, name);
        if (ImGui::IsItemHovered() || ImGui::IsItemActive())
            ImGui::SetMouseCursor(vertical ? ImGuiMouseCursor_ResizeEW : ImGuiMouseCursor_ResizeNS);
        if (!ImGui::IsItemActive()) return;
        const float at = vertical ? ImGui::GetMousePos().x : ImGui::GetMousePos().y;
        share = std::clamp((at - from) / length, 0.15f, 0.85f);
    });
}

void draw_message(Editor& editor) {
    if (editor.message.empty() || ImGui::GetTime() > editor.message_until) {
        editor.message.clear();
        return;
    }
    changes_at(editor, editor.message_until);
    const Theme& t = theme();
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    const std::string message = wrapped(editor.message, std::min(ui(420), screen.x - ui(40)), t.body, t.body->FontSize);
    const ImVec2 text = ImGui::CalcTextSize(message.c_str());
    const glm::dvec2 below = editor.canvas.lo + editor.canvas.size * glm::dvec2(0.5, 1);
    ImVec2 at = editor.message_is_error ? ImGui::GetMousePos()
                                        : ImVec2(float(below.x) - text.x / 2 - ui(12), float(below.y) - ui(34) - text.y);
    at.x = std::clamp(at.x + ui(editor.message_is_error ? 16 : 0), ui(8), std::max(ui(8), screen.x - text.x - ui(32)));
    at.y = std::clamp(at.y + ui(editor.message_is_error ? 20 : 0), ui(8), std::max(ui(8), screen.y - text.y - ui(32)));
    ImDrawList& list = *ImGui::GetForegroundDrawList();
    const ImVec2 hi{at.x + text.x + ui(24), at.y + text.y + ui(16)};
    list.AddRectFilled(at, hi, t.node, ui(6));
    list.AddRect(at, hi, editor.message_is_error ? t.bad : t.accent, ui(6));
    list.AddText(t.body, t.body->FontSize, {at.x + ui(12), at.y + ui(8)}, t.text, message.c_str());
    mark(editor, "message", at, hi);
}

void let_go_of_unasked(Editor& editor) {
    auto each = [](auto&... backgrounds) { (backgrounds.let_go_of_unasked(), ...); };
    each(editor.histograms, editor.gradients, editor.small_pictures, editor.differences, editor.decoded, editor.image_errors, editor.picks);
    if (editor.loaded_kept.is_over(ImGui::GetTime())) editor.loaded.clear();
}

}  // namespace

void draw(Editor& editor) {
    editor.marks.clear();
    editor.moving = false;
    editor.next_change = std::numeric_limits<double>::infinity();
    editor.picked.clear();
    editor.evaluator.refresh(editor.live);
    handle_keys(editor);
    // What was pasted is not to lie behind it.
    editor.start_page = editor.start_page && editor.work.graph().nodes.empty();

    const ImVec2 size = ImGui::GetIO().DisplaySize;
    const float top = ui(44), bottom = size.y - ui(28), gap = ui(5);
    region("toolbar", {0, 0}, {size.x, top}, ImGuiWindowFlags_NoScrollbar, {ui(10), ui(8)}, [&] { draw_toolbar(editor); });
    const bool large = editor.large_picture && !editor.start_page;
    Split& split = editor.viewport.mode == Viewport::Mode::single ? editor.split_single : editor.split_compared;
    float& share = large ? editor.split_large : split.x;
    const float x = std::round(size.x * share), y = std::round(top + (bottom - top) * split.y);
    const ImVec2 picture_lo{large ? 0 : x + gap, top}, picture_hi{large ? x : size.x, large ? bottom : y};
    if (!large)
        region("graph", {0, top}, {x, bottom}, kCanvas, {0, 0}, [&] { draw_canvas(editor); });
    region("picture", picture_lo, picture_hi, kCanvas, {0, 0}, [&] { draw_viewport(editor); });
    region("parameters", {x + gap, large ? top : y + gap}, {size.x, bottom}, 0, {ui(14), ui(10)}, [&] { draw_parameters(editor); });
    region("status", {0, bottom}, {size.x, size.y}, ImGuiWindowFlags_NoScrollbar, {ui(12), ui(5)}, [&] { draw_status_bar(editor); });
    splitter(editor, "split:x", true, {x, top}, {x + gap, bottom}, 0, size.x, share);
    if (!large) splitter(editor, "split:y", false, {x + gap, y}, {size.x, y + gap}, top, bottom - top, split.y);
    if (editor.start_page) draw_start_page(editor);
    draw_add_menu(editor);
    draw_note_editor(editor);
    draw_dialogs(editor);
    if (editor.show_help) draw_help(editor);
    draw_message(editor);
    // What is done where the button is let go still belongs to the drag.
    if (!ImGui::IsMouseDown(ImGuiMouseButton_Left)) close_drag_step(editor);
    editor.autosave.update(editor.work, ImGui::GetTime());
    if (editor.autosave.due()) changes_at(editor, ImGui::GetTime() + 0.25);
    if (ImGui::GetIO().WantTextInput) changes_at(editor, ImGui::GetTime() + 0.2);  // the cursor blinks
    editor.moving = editor.moving || ImGui::GetTime() < editor.moving_until;
    submit_changes(editor);
    let_go_of_unasked(editor);
}

// --- toolbar and status bar ----------------------------------------------------------------------

void draw_toolbar(Editor& editor) {
    const std::vector<std::vector<const char*>> groups = {
        {"new", "open", "save", "save-as"}, {"undo", "redo"}, {"add", "arrange", "fit"}, {"write", "stop"}, {"help"}};
    std::vector<BarButton> buttons;
    for (const auto& group : groups)
        for (const char* id : group) buttons.push_back(button_of(editor, id, id == group.front()));
    const std::string name = (editor.work.file.empty() ? "Untitled" : editor.work.file.filename().string()) +
                             (editor.work.changed() ? " *" : "");
    const float end = ImGui::GetWindowWidth() - ui(14), width = std::min(ImGui::CalcTextSize(name.c_str()).x, end / 3);
    button_bar(editor, "more:toolbar", buttons, ImGui::GetWindowPos().x + end - width - ui(16));
    ImGui::SameLine();
    ImGui::SetCursorPosX(end - width);
    ImGui::AlignTextToFramePadding();
    text_in(theme().muted, shortened(name, width, theme().body, theme().body->FontSize).c_str());
    tooltip(editor.work.file.empty() ? "Not saved yet." : fs::absolute(editor.work.file).lexically_normal().string());
}

void draw_status_bar(Editor& editor) {
    const Theme& t = theme();
    const Evaluator::State& live = editor.live;
    std::string state = "Ready";
    ImU32 color = t.muted;
    if (live.busy) {
        state = "Running";
        color = t.accent;
        for (const auto& [id, status] : live.nodes)
            if (status.state == NodeState::running) {
                state = is_without_codec(id) ? "Running the reference" : "Running " + id;
                if (status.fraction >= 0) state += fmt::format("  {:.0f} %", 100 * status.fraction);
                if (status.seconds_left >= 0) state += ", " + human_seconds(status.seconds_left) + " left";
            }
    } else if (live.wall_seconds > 0) {
        state = "Ready, last run " + human_seconds(live.wall_seconds);
    }
    text_in(color, state.c_str());
    mark(editor, "state");
    if (!editor.picked.empty()) {
        ImGui::SameLine(0, ui(24));
        text_in(t.text, editor.picked.c_str());
        mark(editor, "picked");
    }
    if (!live.problems.empty()) {
        ImGui::SameLine(0, ui(24));
        const std::string problems = fmt::format("{} problem{}", live.problems.size(), live.problems.size() == 1 ? "" : "s");
        text_in(t.bad, problems.c_str());
        if (ImGui::IsItemClicked()) editor.show_problems = !editor.show_problems;
        tooltip("Click for the list.  (P)");
        mark(editor, "problems");
    }
    const std::string right = fmt::format("{} nodes   {:.0f} %", editor.work.graph().nodes.size(), 100 * editor.canvas.zoom);
    ImGui::SameLine(ImGui::GetWindowWidth() - ImGui::CalcTextSize(right.c_str()).x - ui(12));
    text_in(t.muted, right.c_str());
}

}  // namespace voxloom::editor
