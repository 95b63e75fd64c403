#include "app/editor/view/canvas_mouse.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/error.h"

namespace voxloom::editor {

namespace {

constexpr double kPortReach = 9, kWireReach = 6;  // pixels, before scaling

// The port nearest to the pointer, within reach. While a wire is drawn, a whole row is its port's.
void hit_ports(const Editor& editor, glm::dvec2 mouse, Hit& hit) {
    const Canvas& canvas = editor.canvas;
    double nearest = kPortReach * theme().scale;
    auto consider = [&](std::size_t i, const PortSpec& port, glm::dvec2 at, bool output) {
        const double distance = glm::distance(canvas.to_screen(at), mouse);
        if (distance >= nearest) return;
        nearest = distance;
        hit.port = WireEnd{editor.work.graph().nodes[i].id, port.key, {}};
        hit.port_is_output = output;
    };
    for (std::size_t i = 0; i < canvas.boxes.size(); ++i) {
        const NodePorts& ports = canvas.ports[i];
        for (std::size_t k = 0; k < ports.inputs.size(); ++k)
            consider(i, ports.inputs[k], canvas.boxes[i].input(int(k)), false);
        for (std::size_t k = 0; k < ports.outputs.size(); ++k)
            consider(i, ports.outputs[k], canvas.boxes[i].output(int(k)), true);
    }
    if (hit.port || canvas.drag != Canvas::Drag::wire) return;
    const glm::dvec2 p = canvas.to_canvas(mouse);
    for (std::size_t i = 0; i < canvas.boxes.size(); ++i) {
        if (!canvas.boxes[i].contains(p)) continue;
        const auto& ports = canvas.wire_from_output ? canvas.ports[i].inputs : canvas.ports[i].outputs;
        const double row = (p.y - canvas.boxes[i].at.y - kHeaderHeight) / kRowHeight;
        if (ports.empty()) continue;
        const auto k = std::size_t(std::clamp(std::floor(row), 0.0, double(ports.size() - 1)));
        hit.port = WireEnd{editor.work.graph().nodes[i].id, ports[k].key, {}};
        hit.port_is_output = !canvas.wire_from_output;
    }
}

}  // namespace

Hit hit_test(const Editor& editor, const std::vector<Wire>& wires, glm::dvec2 mouse) {
    Hit hit;
    hit.map = editor.canvas.map && editor.canvas.map->contains(mouse) && editor.canvas.drag == Canvas::Drag::none;
    if (hit.map) return hit;
    hit_ports(editor, mouse, hit);
    if (hit.port) return hit;
    const glm::dvec2 p = editor.canvas.to_canvas(mouse);
    auto last_at = [&](const std::vector<NodeBox>& boxes) {
        std::size_t i = boxes.size();
        while (i > 0 && !boxes[i - 1].contains(p)) --i;
        return int(i) - 1;
    };
    if ((hit.node = last_at(editor.canvas.boxes)) >= 0) return hit;
    if ((hit.comment = last_at(editor.canvas.comment_boxes)) >= 0) return hit;
    std::vector<NodeBox> titles = editor.canvas.group_boxes;
    for (NodeBox& box : titles) box.size.y = kGroupTitle;
    if ((hit.group = last_at(titles)) >= 0) return hit;
    double nearest = kWireReach * theme().scale;
    for (std::size_t i = 0; i < wires.size(); ++i)
        if (const double d = distance_to(wires[i], mouse); d < nearest) {
            nearest = d;
            hit.wire = int(i);
        }
    return hit;
}

namespace {

void zoom_about(Canvas& canvas, glm::dvec2 mouse, double factor) {
    const glm::dvec2 fixed = canvas.to_canvas(mouse);
    canvas.zoom = std::clamp(canvas.zoom * factor, kLeastZoom, kMostZoom);
    canvas.pan += fixed - canvas.to_canvas(mouse);
    canvas.fitted = false;
}

}  // namespace

std::string other_end_problem(const Editor& editor, const Hit& hit) {
    const Canvas& canvas = editor.canvas;
    if (hit.port_is_output == canvas.wire_from_output)
        return canvas.wire_from_output ? "an output is wired to an input" : "an input is wired to an output";
    const WireEnd& from = canvas.wire_from_output ? canvas.wire : *hit.port;
    const WireEnd& to = canvas.wire_from_output ? *hit.port : canvas.wire;
    return why_not_wired(editor.work.graph(), editor.registry, from, to);
}

namespace {

// A wire dropped into empty space asks for what fits its end.
void ask_for_fitting(Editor& editor, glm::dvec2 at) {
    const Canvas& canvas = editor.canvas;
    const GraphNode* node = editor.work.graph().find(canvas.wire.node);
    const NodeType* type = node ? editor.registry.find(node->type) : nullptr;
    open_add_menu(editor, at);
    editor.add.end = canvas.wire;
    editor.add.end_is_output = canvas.wire_from_output;
    if (!type) return;
    if (canvas.wire_from_output) {
        if (const PortSpec* port = type->find_output(canvas.wire.port))
            editor.add.fits = nodes_taking(editor.registry, type_of(*port));
    } else if (const PortSpec* port = type->find_input(canvas.wire.port)) {
        editor.add.fits = nodes_giving(editor.registry, port->types);
    }
}

void drop_wire(Editor& editor, const Hit& hit, glm::dvec2 mouse) {
    Canvas& canvas = editor.canvas;
    const glm::dvec2 at = canvas.to_canvas(mouse);
    if (!hit.port) {
        if (hit.node < 0 && glm::distance(at, canvas.grabbed) > 20) ask_for_fitting(editor, at);
        return;
    }
    if (hit.port->node == canvas.wire.node && hit.port->port == canvas.wire.port) return;
    if (std::string problem = other_end_problem(editor, hit); !problem.empty()) return say(editor, problem, true);
    edit(editor, [&] {
        if (canvas.wire_from_output)
            connect(editor.work, editor.registry, canvas.wire, *hit.port);
        else
            connect(editor.work, editor.registry, *hit.port, canvas.wire);
    });
}

template <class T>
void choose_alone(Workspace& work, std::set<T>& selected, const T& pressed) {
    work.selected.clear();
    work.selected_comments.clear();
    selected.insert(pressed);
}

// One of several that was pressed and not moved is then the only one.
void choose_clicked(Editor& editor, const Hit& hit) {
    if (hit.node >= 0) choose_alone(editor.work, editor.work.selected, editor.work.graph().nodes[std::size_t(hit.node)].id);
    else if (hit.comment >= 0) choose_alone(editor.work, editor.work.selected_comments, std::size_t(hit.comment));
}

void drop_nodes(Editor& editor, const Hit& hit, const std::vector<Wire>& wires, glm::dvec2 mouse) {
    Canvas& canvas = editor.canvas;
    if (canvas.moved == glm::dvec2(0.0)) return choose_clicked(editor, hit);
    Document::Step step(editor.work.document);
    edit(editor, [&] {
        move_selected(editor.work, canvas.boxes, canvas.moved);
        if (!editor.work.single()) return;
        // A node without wires that is dropped on one goes into it: the hand that holds it is there, or its middle.
        const std::string id = editor.work.single()->id;
        const auto& nodes = editor.work.graph().nodes;
        const auto i = std::size_t(editor.work.single() - nodes.data());
        const glm::dvec2 middle = canvas.to_screen(*nodes[i].at + canvas.boxes[i].size * 0.5);
        for (const Wire& wire : wires) {
            if (wire.from.node == id || wire.to.node == id) return;
            const double scale = double(theme().scale);
            if (distance_to(wire, mouse) > 16 * scale && distance_to(wire, middle) > 24 * scale * canvas.zoom) continue;
            if (insert_on_wire(editor.work, editor.registry, id, wire.from, wire.to)) return;
        }
    });
}

void select_in_box(Editor& editor, glm::dvec2 a, glm::dvec2 b) {
    const glm::dvec2 lo = glm::min(a, b), hi = glm::max(a, b);
    if (!ImGui::GetIO().KeyShift) {
        editor.work.selected.clear();
        editor.work.selected_comments.clear();
    }
    for (std::size_t i = 0; i < editor.canvas.boxes.size(); ++i)
        if (editor.canvas.boxes[i].overlaps(lo, hi)) editor.work.selected.insert(editor.work.graph().nodes[i].id);
    for (std::size_t i = 0; i < editor.canvas.comment_boxes.size(); ++i)
        if (editor.canvas.comment_boxes[i].overlaps(lo, hi)) editor.work.selected_comments.insert(i);
}

// Adds to what is selected, or takes away from it, where a key is held that says so; false where it is
// not held, and then what was pressed is selected, alone unless it was selected already.
template <class T>
bool choose(Workspace& work, std::set<T>& selected, const T& pressed) {
    const ImGuiIO& io = ImGui::GetIO();
    if (io.KeyShift || io.KeyCtrl) {
        if (!selected.erase(pressed)) selected.insert(pressed);
        return true;
    }
    if (!selected.count(pressed)) choose_alone(work, selected, pressed);
    return false;
}

// A group is its nodes, and the comments that lie in it.
void select_group(Editor& editor, std::size_t group) {
    Workspace& work = editor.work;
    const NodeBox& box = editor.canvas.group_boxes[group];
    if (!ImGui::GetIO().KeyShift) {
        work.selected.clear();
        work.selected_comments.clear();
    }
    work.selected.insert(editor.canvas.groups[group].nodes.begin(), editor.canvas.groups[group].nodes.end());
    for (std::size_t i = 0; i < editor.canvas.comment_boxes.size(); ++i)
        if (const NodeBox& c = editor.canvas.comment_boxes[i]; box.contains(c.at) && box.contains(c.at + c.size)) work.selected_comments.insert(i);
}

// Pulls the wire off an input that has one; its other end is then in the hand.
bool pick_up_wire(Editor& editor, const WireEnd& to) {
    const GraphNode* node = editor.work.graph().find(to.node);
    for (const GraphInput& input : node->inputs) {
        if (input.port != to.port || input.from.empty()) continue;
        editor.canvas.wire = input.from.back();
        editor.canvas.wire_from_output = true;
        edit(editor, [&] { disconnect(editor.work, editor.canvas.wire, to); });
        return true;
    }
    return false;
}

void press(Editor& editor, const Hit& hit, const std::vector<Wire>& wires, glm::dvec2 mouse) {
    Canvas& canvas = editor.canvas;
    canvas.grabbed = canvas.to_canvas(mouse);
    canvas.moved = glm::dvec2(0.0);
    const ImGuiIO& io = ImGui::GetIO();
    if (hit.map) {
        canvas.drag = Canvas::Drag::map;
    } else if (hit.port) {
        canvas.drag = Canvas::Drag::wire;
        canvas.wire = *hit.port;
        canvas.wire_from_output = hit.port_is_output;
        if (!hit.port_is_output && !io.KeyShift) pick_up_wire(editor, *hit.port);
    } else if (hit.node >= 0) {
        const std::string& id = editor.work.graph().nodes[std::size_t(hit.node)].id;
        canvas.held_at = canvas.boxes[std::size_t(hit.node)].at;
        if (!choose(editor.work, editor.work.selected, id)) canvas.drag = Canvas::Drag::nodes;
    } else if (hit.comment >= 0) {
        canvas.held_at = canvas.comment_boxes[std::size_t(hit.comment)].at;
        if (!choose(editor.work, editor.work.selected_comments, std::size_t(hit.comment))) canvas.drag = Canvas::Drag::nodes;
    } else if (hit.group >= 0) {
        select_group(editor, std::size_t(hit.group));
        canvas.held_at = canvas.group_boxes[std::size_t(hit.group)].at;
        canvas.drag = Canvas::Drag::nodes;
    } else if (hit.wire >= 0 && io.KeyAlt) {
        edit(editor, [&] { disconnect(editor.work, wires[std::size_t(hit.wire)].from, wires[std::size_t(hit.wire)].to); });
    } else {
        canvas.drag = Canvas::Drag::box;
    }
}

void show_in_viewport(Editor& editor, int node) {
    const NodePorts& ports = editor.canvas.ports[std::size_t(node)];
    for (const PortSpec& port : ports.outputs)
        if (ports.type && (type_of(port) == PortType::image || type_of(port) == PortType::table)) {
            editor.viewport.pictures[0].port = {editor.work.graph().nodes[std::size_t(node)].id, port.key, {}};
            return;
        }
}

}  // namespace

void handle_mouse(Editor& editor, const Hit& hit, const std::vector<Wire>& wires, bool hovered) {
    Canvas& canvas = editor.canvas;
    const ImGuiIO& io = ImGui::GetIO();
    const glm::dvec2 mouse = vec(io.MousePos);
    if (hovered && io.MouseWheel != 0) zoom_about(canvas, mouse, std::pow(1.15, double(io.MouseWheel)));
    const bool panning = ImGui::IsMouseDown(ImGuiMouseButton_Middle) ||
                         (ImGui::IsMouseDown(ImGuiMouseButton_Right) && ImGui::IsMouseDragging(ImGuiMouseButton_Right, 4));
    if (canvas.drag == Canvas::Drag::none && hovered) {
        if (ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left) && !hit.map) {
            if (hit.node >= 0) show_in_viewport(editor, hit.node);
            else if (hit.comment >= 0) open_note(editor, NoteEditor::Kind::comment, std::size_t(hit.comment));
            else if (hit.group >= 0) open_note(editor, NoteEditor::Kind::group, std::size_t(hit.group));
            else if (!hit.port) open_add_menu(editor, canvas.to_canvas(mouse));
        } else if (ImGui::IsMouseClicked(ImGuiMouseButton_Left)) {
            press(editor, hit, wires, mouse);
        } else if (panning) {
            canvas.drag = Canvas::Drag::pan;
        } else if (ImGui::IsMouseReleased(ImGuiMouseButton_Right)) {
            open_add_menu(editor, canvas.to_canvas(mouse));
        }
    }
    const glm::dvec2 at = canvas.to_canvas(mouse);
    switch (canvas.drag) {
        case Canvas::Drag::none: return;
        case Canvas::Drag::pan:
            canvas.pan -= vec(io.MouseDelta) / (canvas.zoom * double(theme().scale));
            canvas.fitted = false;
            if (!panning) canvas.drag = Canvas::Drag::none;
            return;
        case Canvas::Drag::nodes: {
            const glm::dvec2 by = at - canvas.grabbed;
            if (glm::length(by) * canvas.zoom > 4 || canvas.moved != glm::dvec2(0.0)) canvas.moved = snapped(canvas.held_at + by) - canvas.held_at;
            break;
        }
        case Canvas::Drag::map: {
            // No farther than the graph is.
            const auto [lo, hi] = bounds_of(canvas);
            const glm::dvec2 middle = glm::clamp(canvas.map->to_canvas(mouse), lo, hi);
            canvas.pan = middle - canvas.size / (canvas.zoom * double(theme().scale)) * 0.5;
            canvas.fitted = false;
            break;
        }
        case Canvas::Drag::box:
        case Canvas::Drag::wire: break;
    }
    if (ImGui::IsMouseDown(ImGuiMouseButton_Left)) return;
    const Canvas::Drag ended = std::exchange(canvas.drag, Canvas::Drag::none);
    if (ended == Canvas::Drag::wire) drop_wire(editor, hit, mouse);
    if (ended == Canvas::Drag::nodes) drop_nodes(editor, hit, wires, mouse);
    if (ended == Canvas::Drag::box) select_in_box(editor, canvas.grabbed, at);
    canvas.moved = glm::dvec2(0.0);
}

}  // namespace voxloom::editor
