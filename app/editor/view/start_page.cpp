// What is seen before there is a graph: examples and recent files.
#include "app/editor/view/actions.h"
#include "app/editor/view/editor.h"

namespace voxloom::editor {

namespace {

namespace fs = std::filesystem;

// A file as a card: its name, and a line about it.
bool card(Editor& editor, const std::string& mark_name, const std::string& title, const std::string& about, float width) {
    const Theme& t = theme();
    ImGui::PushID(mark_name.c_str());
    const ImVec2 at = ImGui::GetCursorScreenPos();
    const float height = ui(48);
    const bool clicked = ImGui::InvisibleButton("card", {width, height});
    mark(editor, mark_name);
    const bool hovered = ImGui::IsItemHovered();
    tooltip(about);
    ImDrawList& list = *ImGui::GetWindowDrawList();
    list.AddRectFilled(at, {at.x + width, at.y + height}, hovered ? t.header : t.node, ui(6));
    list.AddText({at.x + ui(12), at.y + ui(6)}, t.text, shortened(title, width - ui(24), t.body, t.body->FontSize).c_str());
    list.AddText({at.x + ui(12), at.y + ui(26)}, t.muted, shortened(about, width - ui(24), t.body, t.body->FontSize).c_str());
    ImGui::PopID();
    return clicked;
}

}  // namespace

void draw_start_page(Editor& editor) {
    const glm::dvec2 lo = editor.canvas.lo, size = editor.canvas.size;
    const float width = std::min(ui(560), float(size.x) - ui(48)), height = std::min(ui(560), float(size.y) - ui(24));
    ImGui::SetNextWindowPos(im(lo + size * 0.5), 0, {0.5f, 0.5f});
    ImGui::SetNextWindowSize({width, height});
    ImGui::PushStyleColor(ImGuiCol_WindowBg, ImVec4(0, 0, 0, 0));
    ImGui::Begin("start", nullptr, ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings);
    ImGui::PopStyleColor();
    ImGui::PushFont(theme().title);
    ImGui::TextUnformatted("voxloom");
    ImGui::PopFont();
    text_in(theme().muted, "Compress, explore and render large volumes.");
    ImGui::Dummy({0, ui(6)});
    if (ImGui::Button("New graph")) new_graph(editor);
    mark(editor, "start:new");
    tooltip(action("new").doc);
    ImGui::SameLine();
    if (ImGui::Button("Open a file…")) action("open").run(editor);
    mark(editor, "start:open");
    tooltip(action("open").doc);

    const float inner = ImGui::GetContentRegionAvail().x - ui(6);
    fs::path chosen;
    auto heading = [](const char* text) {
        ImGui::Dummy({0, ui(6)});
        text_in(theme().accent, text);
    };
    if (!editor.settings.recent.empty()) heading("Recent");
    for (std::size_t i = 0; i < std::min<std::size_t>(editor.settings.recent.size(), 4); ++i) {
        const fs::path& file = editor.settings.recent[i];
        if (card(editor, "recent:" + file.filename().string(), file.filename().string(), file.parent_path().string(), inner)) chosen = file;
    }
    if (!editor.examples.empty()) heading("Examples");
    for (const Example& e : editor.examples)
        if (card(editor, "example:" + e.file.filename().string(), e.file.stem().string(), e.about, inner)) chosen = e.file;
    ImGui::End();
    if (chosen.empty()) return;
    open_graph(editor, chosen);
}

}  // namespace voxloom::editor
