#include "app/editor/view/actions.h"

#include <GLFW/glfw3.h>
#include <fmt/format.h>

#include <algorithm>
#include <cassert>

#include "app/editor/model/camera_control.h"

namespace voxloom::editor {

namespace {

bool has_selection(const Editor& e) { return !e.work.selected.empty() || !e.work.selected_comments.empty(); }
bool has_selected_nodes(const Editor& e) { return !e.work.selected.empty(); }
bool has_nodes(const Editor& e) { return !e.work.graph().nodes.empty(); }

void undo(Editor& e) {
    close_drag_step(e);
    e.work.document.undo();
    forget_missing(e.work);
    e.texts.clear();
}

void redo(Editor& e) {
    close_drag_step(e);
    e.work.document.redo();
    forget_missing(e.work);
    e.texts.clear();
}

void copy(Editor& e) {
    e.copied = copy_selected(e.work, e.registry);
    if (!e.copied.empty()) ImGui::SetClipboardText(e.copied.c_str());
}

glm::dvec2 pointer_on_canvas(const Editor& e) {
    const glm::dvec2 p = e.canvas.to_canvas(vec(ImGui::GetMousePos()));
    const glm::dvec2 hi = e.canvas.to_canvas(e.canvas.lo + e.canvas.size);
    const bool inside = p.x >= e.canvas.pan.x && p.y >= e.canvas.pan.y && p.x <= hi.x && p.y <= hi.y;
    return inside ? p : (e.canvas.pan + hi) * 0.5;
}

void paste_here(Editor& e) {
    const char* clipboard = ImGui::GetClipboardText();
    const std::string text = clipboard && *clipboard ? clipboard : e.copied;
    edit(e, [&] { paste(e.work, e.registry, text, pointer_on_canvas(e)); });
}

void duplicate(Editor& e) {
    const std::string text = copy_selected(e.work, e.registry);
    edit(e, [&] { paste(e.work, e.registry, text, pointer_on_canvas(e)); });
}

void remove(Editor& e) { edit(e, [&] { remove_selected(e.work); }); }

void cut(Editor& e) {
    copy(e);
    remove(e);
}

void select_all(Editor& e) {
    for (const GraphNode& node : e.work.graph().nodes) e.work.selected.insert(node.id);
    for (std::size_t i = 0; i < comments_of(e.work.graph()).size(); ++i) e.work.selected_comments.insert(i);
}

void group(Editor& e) {
    edit(e, [&] { open_note(e, NoteEditor::Kind::group, group_selected(e.work, "Group")); });
}

void comment(Editor& e) {
    edit(e, [&] { open_note(e, NoteEditor::Kind::comment, add_comment(e.work, "Comment", pointer_on_canvas(e))); });
    e.note.text.clear();  // what stays empty is removed
    e.start_page = false;
}

template <GraphNode::Use use>
void toggle(Editor& e) {
    edit(e, [&] { toggle_use(e.work, use); });
}

void rescale(Editor& e, double factor) {
    e.settings.text_scale = std::min(std::max(e.settings.text_scale * factor, 0.5), 3.0);
    e.theme_changed = true;
}

// The camera that the shown picture is made with.
std::optional<std::string> shown_camera(const Editor& e) {
    const std::vector<WireEnd> shown = shown_ports(e);
    return shown.empty() ? std::nullopt : camera_of(e.work.graph(), e.registry, shown.front().node);
}
bool has_camera(const Editor& e) { return shown_camera(e).has_value(); }

void compare(Editor& e) {
    using Mode = Viewport::Mode;
    Mode& mode = e.viewport.mode;
    mode = mode == Mode::single ? Mode::two : mode == Mode::two ? Mode::wipe : mode == Mode::wipe ? Mode::difference : Mode::single;
}

template <int azimuth, int elevation>
void look(Editor& e) {
    edit(e, [&e] { look_from(e.work, e.registry, *shown_camera(e), azimuth, elevation); });
}

std::vector<Action> make_actions() {
    using E = Editor;
    return {
        {"new", "File", "New", "Begins an empty graph.", GLFW_KEY_N, true, false,
         [](E& e) { unless_changed(e, [&e] { new_graph(e); }); }},
        {"open", "File", "Open", "Opens a graph from a file.", GLFW_KEY_O, true, false,
         [](E& e) {
             unless_changed(e, [&e] {
                 open_file_dialog(e, FileDialog::Purpose::open_graph, e.work.file,
                                  [&e](const std::filesystem::path& file) { open_graph(e, file); });
             });
         }},
        {"save", "File", "Save", "Saves the graph to its file.", GLFW_KEY_S, true, false, [](E& e) { save(e); }},
        {"save-as", "File", "Save as", "Saves the graph to another file.", GLFW_KEY_S, true, true,
         [](E& e) { save_as(e); }},
        {"quit", "File", "Quit", "Leaves the editor.", GLFW_KEY_Q, true, false,
         [](E& e) { unless_changed(e, [&e] { e.quit = true; }); }},
        {"undo", "Edit", "Undo", "Takes the last change back.", GLFW_KEY_Z, true, false, undo,
         [](const E& e) { return e.work.document.can_undo(); }},
        {"redo", "Edit", "Redo", "Makes the change again that was taken back.", GLFW_KEY_Y, true, false, redo,
         [](const E& e) { return e.work.document.can_redo(); }},
        {"cut", "Edit", "Cut", "Takes the selected nodes to the clipboard, as YAML.", GLFW_KEY_X, true, false, cut, has_selection},
        {"copy", "Edit", "Copy", "Copies the selected nodes to the clipboard, as YAML.", GLFW_KEY_C, true, false, copy, has_selection},
        {"paste", "Edit", "Paste", "Adds the nodes of the clipboard's YAML at the pointer.", GLFW_KEY_V, true, false, paste_here},
        {"duplicate", "Edit", "Duplicate", "Adds a copy of the selected nodes at the pointer.", GLFW_KEY_D, true, false, duplicate, has_selection},
        {"delete", "Edit", "Delete", "Removes the selected nodes and their wires.", GLFW_KEY_DELETE, false, false, remove, has_selection},
        {"select-all", "Edit", "Select all", "Selects every node.", GLFW_KEY_A, true, false, select_all, has_nodes},
        {"add", "Canvas", "Add node", "Finds a kind of node by a few letters and adds it.", GLFW_KEY_TAB, false, false,
         [](E& e) { open_add_menu(e, pointer_on_canvas(e)); }},
        {"fit", "Canvas", "Fit", "Shows the whole graph.", GLFW_KEY_F, false, false, [](E& e) { fit_canvas(e); }, has_nodes},
        {"arrange", "Canvas", "Arrange", "Lays all nodes out anew, sources left and results right.", GLFW_KEY_L, false, false,
         [](E& e) {
             edit(e, [&e] { arrange(e.work, e.registry); });
             fit_canvas(e);
         }, has_nodes},
        {"align", "Canvas", "Align", "Puts the selected nodes below each other.", GLFW_KEY_A, false, true,
         [](E& e) { edit(e, [&e] { align_selected(e.work, e.registry); }); },
         [](const E& e) { return e.work.selected.size() > 1; }},
        {"bypass", "Canvas", "Bypass", "The selected nodes pass on what comes in, and do not run; again, and they do.", GLFW_KEY_B, false, false,
         toggle<GraphNode::Use::bypassed>, has_selected_nodes},
        {"disable", "Canvas", "Disable", "Takes the selected nodes out of the graph, with all that needs them, without removing them; again, and they are back.",
         GLFW_KEY_D, false, false, toggle<GraphNode::Use::disabled>, has_selected_nodes},
        {"group", "Canvas", "Group", "Makes a group with a title of the selected nodes.", GLFW_KEY_G, false, false, group, has_selected_nodes},
        {"ungroup", "Canvas", "Ungroup", "Takes the group away that the selected nodes are in; the nodes stay.", GLFW_KEY_G, false, true,
         [](E& e) { edit(e, [&e] { ungroup_selected(e.work); }); },
         [](const E& e) {
             return std::ranges::any_of(e.canvas.groups, [&](const Group& g) {
                 return std::ranges::any_of(g.nodes, [&](const std::string& id) { return e.work.selected.count(id) > 0; });
             });
         }},
        {"comment", "Canvas", "Comment", "Writes a comment at the pointer.", GLFW_KEY_N, false, false, comment},
        {"write", "Run", "Write files", "Runs the nodes that write files; their files go to the output folder.", GLFW_KEY_F5, false, false,
         [](E& e) { write_files(e); }, has_nodes},
        {"stop", "Run", "Stop", "Stops what is running.", GLFW_KEY_ESCAPE, false, false,
         [](E& e) { e.evaluator.cancel(); }, [](const E& e) { return e.live.busy; }},
        {"fit-picture", "Picture", "Fit picture", "Shows the whole picture.", GLFW_KEY_HOME, false, false,
         [](E& e) { e.viewport.zoom = 0, e.viewport.offset = glm::dvec2(0.0); }},
        {"compare", "Picture", "Compare", "One picture, two, one wiped over the other, or their difference, in turns.", GLFW_KEY_C, false, false, compare},
        {"numbers", "Picture", "Numbers", "Shows or hides the numbers and the plot below compared pictures.", GLFW_KEY_C, false, true,
         [](E& e) { e.viewport.numbers = !e.viewport.numbers; },
         [](const E& e) { return e.viewport.mode != Viewport::Mode::single; }},
        {"front", "Picture", "Front", "Looks from the front.", GLFW_KEY_1, false, false, look<0, 0>, has_camera},
        {"back", "Picture", "Back", "Looks from the back.", GLFW_KEY_1, false, true, look<180, 0>, has_camera},
        {"side", "Picture", "Side", "Looks from the right side of the picture's front.", GLFW_KEY_3, false, false, look<90, 0>, has_camera},
        {"other-side", "Picture", "Other side", "Looks from the left side of the picture's front.", GLFW_KEY_3, false, true, look<-90, 0>, has_camera},
        {"top", "Picture", "Top", "Looks from above.", GLFW_KEY_7, false, false, look<0, 90>, has_camera},
        {"bottom", "Picture", "Bottom", "Looks from below.", GLFW_KEY_7, false, true, look<0, -90>, has_camera},
        {"projection", "Picture", "Perspective", "Changes between perspective and parallel lines that stay parallel.", GLFW_KEY_5, false, false,
         [](E& e) { edit(e, [&e] { toggle_projection(e.work, e.registry, *shown_camera(e)); }); }, has_camera},
        {"reset-camera", "Picture", "Reset", "Puts the camera back to where its node has it by default.", GLFW_KEY_R, false, false,
         [](E& e) { edit(e, [&e] { reset_camera(e.work, e.registry, *shown_camera(e)); }); }, has_camera},
        {"screenshot", "Picture", "Screenshot", "Saves the window as a PNG file in the output folder.", GLFW_KEY_F12, false, false,
         [](E& e) { e.screenshot_wanted = true; }},
        {"picture-file", "Picture", "Save picture", "Saves the shown picture, at its own size, as a PNG file in the output folder.", GLFW_KEY_F11, false, false,
         [](E& e) { e.picture_wanted = true; }},
        {"large", "View", "Large", "The pictures take the graph's place; again, and it is back.", GLFW_KEY_SPACE, true, false,
         [](E& e) {
             e.large_picture = !e.large_picture;
             e.canvas.drag = Canvas::Drag::none;
         }},
        {"expert", "View", "Expert", "Shows the parameters for experts, too.", GLFW_KEY_E, true, false,
         [](E& e) { e.show_expert = !e.show_expert; }},
        {"problems", "View", "Problems", "Lists everything that is wrong with the graph.", GLFW_KEY_P, false, false,
         [](E& e) { e.show_problems = !e.show_problems; }},
        {"theme", "View", "Dark or light", "Changes between the dark and the light theme.", GLFW_KEY_T, true, false,
         [](E& e) { e.settings.dark = !e.settings.dark, e.theme_changed = true; }},
        {"larger", "View", "Larger", "Makes texts and everything else larger.", GLFW_KEY_EQUAL, true, false, [](E& e) { rescale(e, 1.125); }},
        {"smaller", "View", "Smaller", "Makes texts and everything else smaller.", GLFW_KEY_MINUS, true, false, [](E& e) { rescale(e, 1 / 1.125); }},
        {"help", "View", "Help", "Shows what can be done, and with which keys.", GLFW_KEY_F1, false, false,
         [](E& e) { e.show_help = !e.show_help; }},
    };
}

}  // namespace

const std::vector<Action>& actions() {
    static const std::vector<Action> all = make_actions();
    return all;
}

const Action& action(std::string_view id) {
    for (const Action& a : actions())
        if (id == a.id) return a;
    assert(false && "no such action");
    return actions().front();
}

std::string key_text(const Action& a) {
    std::string name;
    switch (a.key) {
        case GLFW_KEY_DELETE: name = "Delete"; break;
        case GLFW_KEY_TAB: name = "Tab"; break;
        case GLFW_KEY_ESCAPE: name = "Escape"; break;
        case GLFW_KEY_SPACE: name = "Space"; break;
        case GLFW_KEY_HOME: name = "Home"; break;
        case GLFW_KEY_EQUAL: name = "+"; break;
        default:
            if (a.key >= GLFW_KEY_F1 && a.key <= GLFW_KEY_F25)
                name = fmt::format("F{}", a.key - GLFW_KEY_F1 + 1);
            else
                name = std::string(1, char(a.key));
    }
    return (a.ctrl ? "Ctrl+" : "") + std::string(a.shift ? "Shift+" : "") + name;
}

void handle_keys(Editor& editor) {
    const ImGuiIO& io = ImGui::GetIO();
    const bool popup = ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopupId | ImGuiPopupFlags_AnyPopupLevel);
    for (const Action& a : actions()) {
        // A picture can be taken of anything.
        if ((io.WantTextInput || popup) && a.key != GLFW_KEY_F11 && a.key != GLFW_KEY_F12) continue;
        // On many keyboards + is = with Shift.
        if (io.KeyCtrl != a.ctrl || (io.KeyShift != a.shift && a.key != GLFW_KEY_EQUAL) || io.KeyAlt) continue;
        if (!ImGui::IsKeyPressed(a.key, false)) continue;
        if (!a.possible || a.possible(editor)) a.run(editor);
        return;
    }
}

BarButton button_of(Editor& editor, std::string_view id, bool apart) {
    const Action& a = action(id);
    return {a.title, key_text(a), a.doc, std::string("action:") + a.id, !a.possible || a.possible(editor), [&editor, &a] { a.run(editor); }, apart};
}

void action_button(Editor& editor, std::string_view id) { draw_button(editor, button_of(editor, id)); }

}  // namespace voxloom::editor
