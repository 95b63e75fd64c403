// What comes up over the window: the list of nodes to add, files, questions, problems, help.
#include <fmt/format.h>
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>

#include "app/editor/model/search.h"
#include "app/editor/view/actions.h"
#include "app/editor/view/editor.h"
#include "core/base/error.h"

namespace voxloom::editor {

namespace fs = std::filesystem;

namespace {

constexpr ImGuiWindowFlags kNoTitle = ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                                      ImGuiWindowFlags_NoSavedSettings;

}  // namespace

// --- adding a node -------------------------------------------------------------------------------

void open_add_menu(Editor& editor, glm::dvec2 at) {
    editor.add = {};
    editor.add.at = at;
    editor.add.opened = true;
    editor.start_page = false;
}

namespace {

std::vector<const NodeType*> candidates(const Editor& editor) {
    if (!editor.add.end) return editor.registry.all();
    std::vector<const NodeType*> types;
    for (const Fit& fit : editor.add.fits) types.push_back(fit.type);
    return types;
}

void add_chosen(Editor& editor, const NodeType& type) {
    const AddMenu& add = editor.add;
    edit(editor, [&] {
        const Fit* fit = nullptr;
        for (const Fit& f : add.fits)
            if (f.type == &type) fit = &f;
        if (!add.end || !fit)
            add_node(editor.work, editor.registry, type, add.at);
        else if (add.end_is_output)
            add_behind(editor.work, editor.registry, *fit, *add.end, add.at);
        else
            add_before(editor.work, editor.registry, *fit, *add.end, add.at - glm::dvec2(kNodeWidth, 0));
    });
}

// Up and down go through the list, Enter takes.
bool move_choice(int& chosen, int count) {
    if (ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_DownArrow))) ++chosen;
    if (ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_UpArrow))) --chosen;
    chosen = std::clamp(chosen, 0, std::max(count - 1, 0));
    return ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Enter), false);
}

}  // namespace

void draw_add_menu(Editor& editor) {
    AddMenu& add = editor.add;
    if (std::exchange(add.opened, false)) {
        const ImVec2 at = im(editor.canvas.to_screen(add.at)), screen = ImGui::GetIO().DisplaySize;
        ImGui::SetNextWindowPos({std::clamp(at.x, ui(4), std::max(ui(4), screen.x - ui(350))),
                                 std::clamp(at.y, ui(4), std::max(ui(4), screen.y - ui(430)))});
        ImGui::OpenPopup("add");
    }
    ImGui::SetNextWindowSize({ui(340), ui(420)});
    if (!ImGui::BeginPopup("add")) return;
    if (ImGui::IsWindowAppearing()) ImGui::SetKeyboardFocusHere();
    ImGui::SetNextItemWidth(-1);
    if (ImGui::InputTextWithHint("##query", add.end ? "What takes it from here?" : "Find a node", &add.query)) add.chosen = 0;
    mark(editor, "add-query");
    const auto found = find_nodes(candidates(editor), add.query);
    const NodeType* taken = nullptr;
    if (move_choice(add.chosen, int(found.size())) && !found.empty()) taken = found[std::size_t(add.chosen)];
    ImGui::BeginChild("list");
    for (int i = 0; i < int(found.size()); ++i) {
        const NodeType& type = *found[std::size_t(i)];
        const float y = ImGui::GetCursorPosY();
        ImGui::PushID(i);
        if (ImGui::Selectable("##node", i == add.chosen, 0, {0, ui(40)})) taken = &type;
        mark(editor, "add:" + type.id);
        tooltip(type.doc);
        ImGui::SetCursorPosY(y + ui(2));
        ImGui::Indent(ui(6));
        ImGui::TextUnformatted(type.title.c_str());
        text_in(theme().muted, shortened(type.doc, ui(300), theme().body, theme().body->FontSize).c_str());
        ImGui::Unindent(ui(6));
        ImGui::SetCursorPosY(y + ui(40) + ImGui::GetStyle().ItemSpacing.y);
        ImGui::PopID();
    }
    if (found.empty()) wrapped_in(theme().muted, "Nothing is called like that.");
    ImGui::EndChild();
    if (taken) {
        add_chosen(editor, *taken);
        ImGui::CloseCurrentPopup();
    }
    if (ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape), false)) ImGui::CloseCurrentPopup();
    ImGui::EndPopup();
}

// --- files ---------------------------------------------------------------------------------------

namespace {

void go_to_folder(FileDialog& dialog, const fs::path& folder) {
    dialog.folder = folder;
    dialog.entries.clear();
    std::error_code listing, error;
    for (const auto& entry : fs::directory_iterator(folder, listing)) {
        const fs::path& path = entry.path();
        const bool is_folder = entry.is_directory(error);
        const bool graphs = dialog.purpose != FileDialog::Purpose::parameter;
        if (path.filename().string().starts_with(".")) continue;
        if (!is_folder && graphs && path.extension() != ".yaml" && path.extension() != ".yml") continue;
        dialog.entries.push_back(is_folder ? path / "" : path);
    }
    dialog.problem = listing ? "This folder cannot be read: " + listing.message() + "." : "";
    std::sort(dialog.entries.begin(), dialog.entries.end(), [](const fs::path& a, const fs::path& b) {
        return std::pair(a.has_filename(), a) < std::pair(b.has_filename(), b);
    });
}

const char* title_of(FileDialog::Purpose purpose) {
    switch (purpose) {
        case FileDialog::Purpose::open_graph: return "Open a graph";
        case FileDialog::Purpose::save_graph: return "Save the graph";
        case FileDialog::Purpose::parameter: return "Choose a file or a folder";
    }
    return "";
}

void draw_entries(Editor& editor, std::optional<fs::path>& taken) {
    FileDialog& dialog = editor.files;
    fs::path go;
    ImGui::BeginChild("entries", {0, -ImGui::GetFrameHeightWithSpacing() * 2 - ui(6)}, true);
    if (dialog.folder.has_relative_path() && ImGui::Selectable("..  (up)", false, ImGuiSelectableFlags_DontClosePopups)) go = dialog.folder.parent_path();
    for (const fs::path& entry : dialog.entries) {
        const bool folder = !entry.has_filename();
        const std::string name = (folder ? entry.parent_path() : entry).filename().string() + (folder ? "/" : "");
        if (ImGui::Selectable(name.c_str(), dialog.name == name, ImGuiSelectableFlags_DontClosePopups | ImGuiSelectableFlags_AllowDoubleClick)) {
            if (folder) go = entry.parent_path();
            else dialog.name = name;
            if (!folder && ImGui::IsMouseDoubleClicked(0)) taken = entry;
        }
        mark(editor, "file:" + name);
    }
    if (!dialog.problem.empty()) wrapped_in(theme().bad, dialog.problem);
    else if (dialog.entries.empty()) text_in(theme().muted, dialog.purpose == FileDialog::Purpose::parameter ? "Nothing is here." : "No graph is here.");
    ImGui::EndChild();
    if (!go.empty()) go_to_folder(dialog, go);
}

void draw_file_dialog(Editor& editor) {
    FileDialog& dialog = editor.files;
    if (std::exchange(dialog.opened, false)) ImGui::OpenPopup("files");
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    ImGui::SetNextWindowSize({std::min(ui(620), screen.x * 0.9f), std::min(ui(460), screen.y * 0.9f)});
    ImGui::SetNextWindowPos({screen.x / 2, screen.y / 2}, 0, {0.5f, 0.5f});
    if (!ImGui::BeginPopupModal("files", nullptr, kNoTitle)) return;
    text_in(theme().accent, title_of(dialog.purpose));
    text_in(theme().muted, shortened(dialog.folder.string(), ImGui::GetContentRegionAvail().x, theme().body, theme().body->FontSize).c_str());
    std::optional<fs::path> taken;
    draw_entries(editor, taken);
    if (ImGui::IsWindowAppearing()) ImGui::SetKeyboardFocusHere();
    ImGui::SetNextItemWidth(-1);
    if (ImGui::InputTextWithHint("##name", "Name, or a whole path", &dialog.name, ImGuiInputTextFlags_EnterReturnsTrue | ImGuiInputTextFlags_AutoSelectAll) && !dialog.name.empty())
        taken = dialog.folder / dialog.name;
    mark(editor, "file-name");
    if (ImGui::Button(dialog.purpose == FileDialog::Purpose::save_graph ? "Save" : "Open") && !dialog.name.empty()) taken = dialog.folder / dialog.name;
    mark(editor, "file-ok");
    ImGui::SameLine();
    if (ImGui::Button("Cancel") || ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape), false)) {
        editor.after_saving_asked = nullptr;
        ImGui::CloseCurrentPopup();
    }
    mark(editor, "file-cancel");
    std::error_code error;
    if (taken && dialog.purpose != FileDialog::Purpose::parameter && fs::is_directory(*taken, error)) {
        go_to_folder(dialog, taken->lexically_normal());
        dialog.name.clear();
    } else if (taken) {
        const auto chosen = dialog.chosen;
        ImGui::CloseCurrentPopup();
        chosen(taken->lexically_normal());
    }
    ImGui::EndPopup();
}

// --- questions and lists -------------------------------------------------------------------------

void draw_changes_question(Editor& editor) {
    if (std::exchange(editor.ask_about_changes, false)) ImGui::OpenPopup("changes");
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    ImGui::SetNextWindowPos({screen.x / 2, screen.y / 2}, 0, {0.5f, 0.5f});
    if (!ImGui::BeginPopupModal("changes", nullptr, kNoTitle | ImGuiWindowFlags_AlwaysAutoResize)) return;
    ImGui::TextUnformatted("The graph has changes that are not saved.");
    ImGui::Dummy({ui(380), ui(6)});
    if (ImGui::Button("Save")) {
        ImGui::CloseCurrentPopup();
        save(editor);  // goes on when it has been saved
    }
    mark(editor, "changes:save");
    ImGui::SameLine();
    if (ImGui::Button("Discard")) {
        ImGui::CloseCurrentPopup();
        if (auto next = std::exchange(editor.after_saving_asked, nullptr)) next();
    }
    mark(editor, "changes:discard");
    ImGui::SameLine();
    if (ImGui::Button("Cancel") || ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape), false)) {
        editor.after_saving_asked = nullptr;
        ImGui::CloseCurrentPopup();
    }
    mark(editor, "changes:cancel");
    ImGui::EndPopup();
}

void draw_overwriting_question(Editor& editor) {
    if (std::exchange(editor.ask_about_overwriting, false)) ImGui::OpenPopup("overwriting");
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    ImGui::SetNextWindowPos({screen.x / 2, screen.y / 2}, 0, {0.5f, 0.5f});
    if (!ImGui::BeginPopupModal("overwriting", nullptr, kNoTitle | ImGuiWindowFlags_AlwaysAutoResize)) return;
    ImGui::TextUnformatted(editor.overwriting_destroys.c_str());
    text_in(theme().accent, shortened(editor.overwriting.string(), ui(420), theme().body, theme().body->FontSize).c_str());
    ImGui::Dummy({ui(420), ui(6)});
    if (ImGui::Button("Overwrite")) {
        ImGui::CloseCurrentPopup();
        save_to(editor, editor.overwriting);
    }
    mark(editor, "overwriting:overwrite");
    ImGui::SameLine();
    if (ImGui::Button("Save as…")) {
        ImGui::CloseCurrentPopup();
        save_as(editor);
    }
    mark(editor, "overwriting:save-as");
    ImGui::SameLine();
    if (ImGui::Button("Cancel") || ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape), false)) {
        editor.after_saving_asked = nullptr;
        ImGui::CloseCurrentPopup();
    }
    mark(editor, "overwriting:cancel");
    ImGui::EndPopup();
}

void draw_recovery_question(Editor& editor) {
    if (editor.recovered.empty()) return;
    if (std::exchange(editor.ask_about_recovery, false)) ImGui::OpenPopup("recovery");
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    ImGui::SetNextWindowPos({screen.x / 2, screen.y / 2}, 0, {0.5f, 0.5f});
    if (!ImGui::BeginPopupModal("recovery", nullptr, kNoTitle | ImGuiWindowFlags_AlwaysAutoResize)) return;
    const fs::path& file = editor.recovered.back().workspace.file;
    ImGui::TextUnformatted("A session ended unexpectedly, with changes that were not saved:");
    text_in(theme().accent, file.empty() ? "a graph without a file" : file.string().c_str());
    ImGui::Dummy({ui(420), ui(6)});
    auto answered = [&] {
        std::error_code error;
        fs::remove(editor.recovered.back().autosaved, error);
        editor.recovered.pop_back();
        ImGui::CloseCurrentPopup();
        editor.ask_about_recovery = !editor.recovered.empty();
    };
    if (ImGui::Button("Recover")) {
        begin_document(editor, std::move(editor.recovered.back().workspace));
        answered();
        // The others wait for the next start: they would take the place of this one.
        editor.ask_about_recovery = false;
        editor.recovered.clear();
    }
    mark(editor, "recovery:recover");
    ImGui::SameLine();
    if (ImGui::Button("Discard")) answered();
    mark(editor, "recovery:discard");
    ImGui::SameLine();
    if (ImGui::Button("Ask again next time") || ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape), false)) {
        editor.recovered.clear();
        ImGui::CloseCurrentPopup();
    }
    mark(editor, "recovery:later");
    ImGui::EndPopup();
}

void draw_problems(Editor& editor) {
    if (!editor.show_problems) return;
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    const float height = std::min(ui(220), screen.y * 0.4f);
    ImGui::SetNextWindowPos({ui(12), screen.y - ui(36) - height});
    ImGui::SetNextWindowSize({std::min(ui(620), screen.x - ui(24)), height});
    ImGui::Begin("Problems", &editor.show_problems, ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings);
    if (editor.live.problems.empty()) text_in(theme().good, "There is no problem.");
    for (const Problem& problem : editor.live.problems) {
        ImGui::PushID(&problem);
        const std::string text = problem.node.empty() ? problem.message : problem.node + ": " + problem.message;
        wrapped_in(theme().text, text);
        if (ImGui::IsItemClicked() && !problem.node.empty()) editor.work.selected = {problem.node};
        ImGui::PopID();
    }
    for (const std::string& warning : editor.live.warnings) wrapped_in(theme().warn, warning);
    ImGui::End();
}

}  // namespace

void open_file_dialog(Editor& editor, FileDialog::Purpose purpose, const fs::path& at, std::function<void(const fs::path&)> chosen) {
    FileDialog& dialog = editor.files;
    dialog = {};
    dialog.purpose = purpose;
    dialog.opened = true;
    dialog.chosen = std::move(chosen);
    std::error_code error;
    fs::path file = fs::absolute(at.empty() ? fs::current_path() / "" : at).lexically_normal();
    if (purpose == FileDialog::Purpose::save_graph) dialog.name = at.empty() ? "graph.yaml" : file.filename().string();
    go_to_folder(dialog, fs::is_directory(file, error) ? (file.has_filename() ? file : file.parent_path())
                         : fs::is_directory(file.parent_path(), error) ? file.parent_path() : fs::current_path());
}

void draw_dialogs(Editor& editor) {
    draw_recovery_question(editor);
    draw_changes_question(editor);
    draw_overwriting_question(editor);
    draw_file_dialog(editor);
    draw_problems(editor);
}

// --- help ----------------------------------------------------------------------------------------

void draw_help(Editor& editor) {
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    ImGui::SetNextWindowPos({screen.x / 2, screen.y / 2}, 0, {0.5f, 0.5f});
    ImGui::SetNextWindowSize({std::min(ui(760), screen.x * 0.94f), std::min(ui(600), screen.y * 0.9f)});
    ImGui::SetNextWindowFocus();
    ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 1);
    ImGui::Begin("help", &editor.show_help, kNoTitle);
    ImGui::PushFont(theme().title);
    ImGui::TextUnformatted("What can be done");
    ImGui::PopFont();
    const char* mouse[][2] = {
        {"Drag from a port", "Draws a wire. Dropped in empty space it offers what fits."},
        {"Drag from a wired input", "Takes the wire off; with Shift, begins another one."},
        {"Wheel; right or middle button", "Zooms to the pointer; moves the canvas."},
        {"Drag in empty space", "Selects what the box touches; with Shift, adds it."},
        {"The map in the corner", "Goes to what is clicked; follows the hand."},
        {"Double click, right click", "Adds a node. A double click on a node shows its picture."},
        {"Drag the picture", "Turns its camera; with Shift or the middle button, moves it."},
        {"Wheel on the picture", "Zooms the camera; with Ctrl, magnifies the picture."},
        {"Pictures' list, upper right", "Compares: two, four, wiped, in turns, their difference."},
        {"A name above the numbers", "Makes its picture the one that errors are measured against."},
        {"Drop a node on a wire", "Puts it into the wire."},
        {"Drag a group's title", "Moves its nodes and the comments in it; double click changes it."},
        {"Alt+click a wire", "Removes it."},
        {"Ctrl+click a slider", "Types a number."},
        {"Right click a parameter's name", "Resets it, or copies it as --set."},
    };
    auto row = [](const char* key, const char* what) {
        ImGui::TextUnformatted(key);
        ImGui::SameLine(ui(240));
        wrapped_in(theme().muted, what);
    };
    ImGui::Dummy({0, ui(4)});
    text_in(theme().accent, "Mouse");
    for (auto& [key, what] : mouse) row(key, what);
    std::string group;
    for (const Action& a : actions()) {
        if (group != a.group) {
            ImGui::Dummy({0, ui(4)});
            text_in(theme().accent, a.group);
            group = a.group;
        }
        row(key_text(a).c_str(), a.doc);
    }
    mark(editor, "help", ImGui::GetWindowPos(), {ImGui::GetWindowPos().x + ImGui::GetWindowWidth(), ImGui::GetWindowPos().y + ImGui::GetWindowHeight()});
    if (ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape), false)) editor.show_help = false;
    ImGui::End();
    ImGui::PopStyleVar();
}

}  // namespace voxloom::editor
