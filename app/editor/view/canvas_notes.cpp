// Groups and comments: how they look, and how they are typed.
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <utility>

#include "app/editor/view/canvas_drawing.h"

namespace voxloom::editor {

namespace {

constexpr double kCommentWidth = 220, kCommentPadding = 10;

void draw_group(const Pen& pen, const Group& group, const NodeBox& box) {
    if (!pen.sees(box)) return;
    const ImVec2 lo = pen.at(box.at), hi = pen.at(box.at + box.size);
    const float round = pen.px(8);
    pen.list.AddRectFilled(lo, hi, faded(theme().accent, theme().dark ? 0.09f : 0.12f), round);
    pen.list.AddRectFilled(lo, {hi.x, lo.y + pen.px(kGroupTitle)}, faded(theme().accent, 0.16f), round, ImDrawFlags_RoundCornersTop);
    pen.list.AddRect(lo, hi, faded(theme().accent, 0.45f), round);
    pen.text(box.at + glm::dvec2(12, 4), theme().text, group.title, box.size.x - 24);
}

void draw_comment(const Pen& pen, const Comment& comment, const NodeBox& box, bool selected) {
    if (!pen.sees(box)) return;
    const ImVec2 lo = pen.at(box.at), hi = pen.at(box.at + box.size);
    pen.list.AddRectFilled(lo, hi, faded(theme().warn, 0.13f), pen.px(4));
    pen.list.AddRectFilled(lo, {lo.x + std::max(pen.px(3), 1.f), hi.y}, faded(theme().warn, 0.8f));
    if (selected) pen.list.AddRect(lo, hi, theme().accent, pen.px(4), 0, std::max(pen.px(2), 1.5f));
    if (!pen.readable()) return;
    pen.list.AddText(theme().body, pen.px(13), pen.at(box.at + glm::dvec2(kCommentPadding, kCommentPadding / 2)), theme().text,
                     comment.text.c_str(), nullptr, pen.px(kCommentWidth - 2 * kCommentPadding));
}

void take_text(Editor& editor, const NoteEditor& note) {
    edit(editor, [&] {
        if (note.kind == NoteEditor::Kind::group && note.index < groups_of(editor.work.graph()).size())
            set_title(editor.work, note.index, note.text);
        if (note.kind == NoteEditor::Kind::comment && note.index < comments_of(editor.work.graph()).size())
            set_comment(editor.work, note.index, note.text);
    });
}

}  // namespace

// As high as its text is. Measured large, so that it is the same at every zoom.
NodeBox box_of_comment(const Comment& comment) {
    constexpr float kTimes = 8;
    const float wrap = float(kCommentWidth - 2 * kCommentPadding) * kTimes;
    const ImVec2 size = theme().body->CalcTextSizeA(13 * kTimes, FLT_MAX, wrap, comment.text.c_str());
    return {comment.at, {kCommentWidth, double(size.y / kTimes) + kCommentPadding}};
}

void draw_notes(const Pen& pen, const Editor& editor) {
    const Canvas& canvas = editor.canvas;
    const bool moving = canvas.drag == Canvas::Drag::nodes;
    for (std::size_t i = 0; i < canvas.groups.size(); ++i) {
        const auto selected = [&](const std::string& id) { return editor.work.selected.count(id) > 0; };
        NodeBox box = canvas.group_boxes[i];
        if (moving && std::ranges::all_of(canvas.groups[i].nodes, selected)) box.at += canvas.moved;
        draw_group(pen, canvas.groups[i], box);
    }
    for (std::size_t i = 0; i < canvas.comments.size(); ++i) {
        const bool selected = editor.work.selected_comments.count(i) > 0;
        NodeBox box = canvas.comment_boxes[i];
        if (moving && selected) box.at += canvas.moved;
        draw_comment(pen, canvas.comments[i], box, selected);
    }
}

void open_note(Editor& editor, NoteEditor::Kind kind, std::size_t index) {
    NoteEditor& note = editor.note;
    note = {kind, index, {}, true};
    const Graph& graph = editor.work.graph();
    note.text = kind == NoteEditor::Kind::group ? groups_of(graph).at(index).title : comments_of(graph).at(index).text;
}

// Where the note stands. What was typed is taken when the field is left, and not taken after Escape.
void draw_note_editor(Editor& editor) {
    NoteEditor& note = editor.note;
    if (note.kind == NoteEditor::Kind::none) return;
    const bool group = note.kind == NoteEditor::Kind::group;
    const auto& boxes = group ? editor.canvas.group_boxes : editor.canvas.comment_boxes;
    if (std::exchange(note.opened, false)) {
        const glm::dvec2 at = note.index < boxes.size() ? boxes[note.index].at : editor.canvas.pan;
        const ImVec2 screen = ImGui::GetIO().DisplaySize, p = im(editor.canvas.to_screen(at));
        ImGui::SetNextWindowPos({std::clamp(p.x, ui(4), std::max(ui(4), screen.x - ui(330))), std::clamp(p.y, ui(4), std::max(ui(4), screen.y - ui(170)))});
        ImGui::OpenPopup("note");
    }
    if (!ImGui::BeginPopup("note")) {
        take_text(editor, std::exchange(note, {}));
        return;
    }
    if (ImGui::IsWindowAppearing()) ImGui::SetKeyboardFocusHere();
    const ImGuiInputTextFlags flags = ImGuiInputTextFlags_AutoSelectAll | ImGuiInputTextFlags_EnterReturnsTrue;
    ImGui::SetNextItemWidth(ui(300));
    const bool entered = group ? ImGui::InputText("##text", &note.text, flags)
                               : ImGui::InputTextMultiline("##text", &note.text, {ui(300), ui(100)}, flags | ImGuiInputTextFlags_CtrlEnterForNewLine);
    mark(editor, "note");
    text_in(theme().muted, group ? "Enter takes it." : "Enter takes it, Ctrl+Enter begins a line.");
    const bool escaped = ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape), false);
    if (escaped) note = {};
    if (entered || escaped) ImGui::CloseCurrentPopup();
    ImGui::EndPopup();
}

}  // namespace voxloom::editor
