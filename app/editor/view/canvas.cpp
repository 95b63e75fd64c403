// The graph: nodes, ports and wires, and what the mouse does to them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "app/editor/view/canvas_mouse.h"
#include "core/base/error.h"

namespace voxloom::editor {

namespace {

void update_boxes(Editor& editor) {
    Canvas& canvas = editor.canvas;
    if (canvas.text == editor.work.document.text()) return;
    canvas.text = editor.work.document.text();
    canvas.ports = ports_of(editor.work.graph(), editor.registry);
    canvas.boxes = boxes_of(editor.work.graph(), canvas.ports);
    canvas.groups = groups_of(editor.work.graph());
    canvas.group_boxes = boxes_of_groups(canvas.groups, editor.work.graph(), canvas.boxes);
    canvas.comments = comments_of(editor.work.graph());
    canvas.comment_boxes.clear();
    for (const Comment& comment : canvas.comments) canvas.comment_boxes.push_back(box_of_comment(comment));
}

void do_fit(Canvas& canvas) {
    canvas.fit_wanted = false;
    canvas.fitted = true;
    if (canvas.boxes.empty() && canvas.comment_boxes.empty()) {
        canvas.zoom = 1;
        canvas.pan = -canvas.size / (2.0 * double(theme().scale));
        return;
    }
    const auto [lo, hi] = bounds_of(canvas);
    const glm::dvec2 room = canvas.size / double(theme().scale) - glm::dvec2(48);
    const glm::dvec2 ratio = glm::max(room, glm::dvec2(10)) / glm::max(hi - lo, glm::dvec2(1));
    canvas.zoom = std::clamp(std::min(ratio.x, ratio.y), kLeastZoom, 1.25);
    canvas.pan = (lo + hi - canvas.size / (canvas.zoom * double(theme().scale))) * 0.5;
}

// --- what is said of the thing under the pointer --------------------------------------------------

std::string port_tooltip(const Editor& editor, const Hit& hit) {
    const Canvas& canvas = editor.canvas;
    for (std::size_t i = 0; i < canvas.ports.size(); ++i) {
        if (editor.work.graph().nodes[i].id != hit.port->node) continue;
        const NodePorts& ports = canvas.ports[i];
        const int k = hit.port_is_output ? ports.output(hit.port->port) : ports.input(hit.port->port);
        if (k < 0) return {};
        const PortSpec& port = (hit.port_is_output ? ports.outputs : ports.inputs)[std::size_t(k)];
        std::string text = port.key;
        if (ports.type) text += ": " + port.types.text() + (port.optional ? ", optional" : "") + (port.many ? ", any number" : "");
        text += "\n" + port.doc;
        if (const NodeStatus* status = status_of(editor, hit.port->node); status && hit.port_is_output && std::size_t(k) < status->outputs.size())
            text += "\n" + summary(status->outputs[std::size_t(k)]);
        return text;
    }
    return {};
}

std::string node_tooltip(const Editor& editor, std::size_t i) {
    const GraphNode& node = editor.work.graph().nodes[i];
    const NodeType* type = editor.canvas.ports[i].type;
    std::string text = type ? type->title + " (" + type->id + ")\n" + type->doc
                            : node.type + "\nThis kind of node is not known here; it is kept as it is.";
    if (const NodeStatus* status = status_of(editor, node.id)) {
        if (!status->message.empty()) text += "\n\n" + status->message;
        for (const std::string& warning : status->warnings) text += "\n\nWarning: " + warning;
    }
    return text;
}

std::string wire_tooltip(const Editor& editor, const Wire& wire) {
    std::string text = wire.from.node + "." + wire.from.port + " → " + wire.to.node + "." + wire.to.port;
    if (std::string flows = flow_text(editor, wire.from); !flows.empty()) text += "\n" + flows;
    return text + "\nAlt+click removes it.";
}

void show_tooltip(Editor& editor, const Hit& hit, const std::vector<Wire>& wires) {
    if (editor.canvas.drag == Canvas::Drag::wire) {
        if (!hit.port || hit.port->node == editor.canvas.wire.node) return;
        if (std::string problem = other_end_problem(editor, hit); !problem.empty()) ImGui::SetTooltip("%s", problem.c_str());
        return;
    }
    if (editor.canvas.drag != Canvas::Drag::none || !editor.message.empty()) return;
    std::string text;
    if (hit.port) text = port_tooltip(editor, hit);
    else if (hit.node >= 0) text = node_tooltip(editor, std::size_t(hit.node));
    else if (hit.map) text = "The whole graph. Click or drag: goes there.";
    else if (hit.comment >= 0) text = "Double click: change the text.";
    else if (hit.group >= 0) text = "Drag: moves its nodes and comments.\nDouble click: change the title.";
    else if (hit.wire >= 0) text = wire_tooltip(editor, wires[std::size_t(hit.wire)]);
    // A tooltip over every node would be in the way: what lies under a resting pointer only.
    static double still_since = 0;
    if (ImGui::GetIO().MouseDelta.x != 0 || ImGui::GetIO().MouseDelta.y != 0) still_since = ImGui::GetTime();
    const double due = still_since + 0.4;
    if (text.empty()) return;
    if (ImGui::GetTime() < due) return changes_at(editor, due);
    ImGui::BeginTooltip();
    ImGui::PushTextWrapPos(ui(340));
    ImGui::TextUnformatted(text.c_str());
    mark(editor, "tooltip");
    ImGui::PopTextWrapPos();
    ImGui::EndTooltip();
}

void mark_everything(Editor& editor) {
    if (!editor.marks_wanted) return;
    const Canvas& canvas = editor.canvas;
    const double reach = 4 * theme().scale;
    if (canvas.map) mark(editor, "map", im(canvas.map->lo), im(canvas.map->lo + canvas.map->size));
    mark(editor, "canvas", im(canvas.lo), im(canvas.lo + canvas.size));
    for (std::size_t i = 0; i < canvas.boxes.size(); ++i) {
        const std::string& id = editor.work.graph().nodes[i].id;
        const NodeBox& box = canvas.boxes[i];
        mark(editor, "node:" + id, im(canvas.to_screen(box.at)), im(canvas.to_screen(box.at + glm::dvec2(box.size.x, kHeaderHeight))));
        auto port = [&](const char* kind, const std::string& key, glm::dvec2 at) {
            mark(editor, fmt::format("{}:{}.{}", kind, id, key), im(canvas.to_screen(at) - reach), im(canvas.to_screen(at) + reach));
        };
        for (std::size_t k = 0; k < canvas.ports[i].inputs.size(); ++k) port("in", canvas.ports[i].inputs[k].key, box.input(int(k)));
        for (std::size_t k = 0; k < canvas.ports[i].outputs.size(); ++k) port("out", canvas.ports[i].outputs[k].key, box.output(int(k)));
    }
    for (std::size_t i = 0; i < canvas.group_boxes.size(); ++i) {
        const NodeBox& box = canvas.group_boxes[i];
        mark(editor, fmt::format("group:{}", i), im(canvas.to_screen(box.at)), im(canvas.to_screen(box.at + glm::dvec2(box.size.x, kGroupTitle))));
    }
    for (std::size_t i = 0; i < canvas.comment_boxes.size(); ++i) {
        const NodeBox& box = canvas.comment_boxes[i];
        mark(editor, fmt::format("comment:{}", i), im(canvas.to_screen(box.at)), im(canvas.to_screen(box.at + box.size)));
    }
}

}  // namespace

void fit_canvas(Editor& editor) { editor.canvas.fit_wanted = true; }

void draw_canvas(Editor& editor) {
    Canvas& canvas = editor.canvas;
    canvas.lo = vec(ImGui::GetCursorScreenPos());
    const glm::dvec2 size = vec(ImGui::GetContentRegionAvail());
    if (std::exchange(canvas.size, size) != size && canvas.fitted) canvas.fit_wanted = true;
    if (canvas.size.x < 1 || canvas.size.y < 1) return;
    update_boxes(editor);
    if (canvas.fit_wanted) do_fit(canvas);
    ImGui::InvisibleButton("canvas", im(canvas.size), ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight |
                                                          ImGuiButtonFlags_MouseButtonMiddle);
    const bool hovered = ImGui::IsItemHovered() && !editor.start_page;
    std::vector<Wire> wires = wires_of(editor);
    const bool busy = canvas.drag != Canvas::Drag::none;
    // The map stays where it is while the hand drags in it.
    if (canvas.drag != Canvas::Drag::map) canvas.map = minimap_of(canvas);
    const Hit hit = hovered || busy ? hit_test(editor, wires, vec(ImGui::GetMousePos())) : Hit();
    if (hovered || busy) {
        handle_mouse(editor, hit, wires, hovered);
        show_tooltip(editor, hit, wires);
        update_boxes(editor);
        wires = wires_of(editor);
    }
    draw_graph(editor, wires, hit.wire < int(wires.size()) ? hit.wire : -1);
    mark_everything(editor);
}

}  // namespace voxloom::editor
