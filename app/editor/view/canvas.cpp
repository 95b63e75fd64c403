// The graph: nodes, ports and wires, and what the mouse does to them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "app/editor/view/canvas_drawing.h"
#include "app/editor/view/picture.h"
#include "core/base/error.h"

namespace voxloom::editor {

namespace {

constexpr double kPortReach = 9, kWireReach = 6;  // pixels, before scaling
constexpr double kLeastZoom = 0.08, kMostZoom = 3;

void update_boxes(Editor& editor) {
    Canvas& canvas = editor.canvas;
    if (canvas.text == editor.work.document.text()) return;
    canvas.text = editor.work.document.text();
    canvas.ports = ports_of(editor.work.graph(), editor.registry);
    canvas.boxes = boxes_of(editor.work.graph(), canvas.ports);
}

// What is under the pointer.
struct Hit {
    std::optional<WireEnd> port;
    bool port_is_output = false;
    int node = -1;
    int wire = -1;
};

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

Hit hit_test(const Editor& editor, const std::vector<Wire>& wires, glm::dvec2 mouse) {
    Hit hit;
    hit_ports(editor, mouse, hit);
    if (hit.port) return hit;
    const glm::dvec2 p = editor.canvas.to_canvas(mouse);
    for (std::size_t i = editor.canvas.boxes.size(); i-- > 0 && hit.node < 0;)
        if (editor.canvas.boxes[i].contains(p)) hit.node = int(i);
    if (hit.node >= 0) return hit;
    double nearest = kWireReach * theme().scale;
    for (std::size_t i = 0; i < wires.size(); ++i)
        if (const double d = distance_to(wires[i], mouse); d < nearest) {
            nearest = d;
            hit.wire = int(i);
        }
    return hit;
}

void zoom_about(Canvas& canvas, glm::dvec2 mouse, double factor) {
    const glm::dvec2 fixed = canvas.to_canvas(mouse);
    canvas.zoom = std::clamp(canvas.zoom * factor, kLeastZoom, kMostZoom);
    canvas.pan += fixed - canvas.to_canvas(mouse);
}

void do_fit(Canvas& canvas) {
    canvas.fit_wanted = false;
    if (canvas.boxes.empty()) {
        canvas.zoom = 1;
        canvas.pan = -canvas.size / (2.0 * double(theme().scale));
        return;
    }
    glm::dvec2 lo = canvas.boxes[0].at, hi = lo;
    for (const NodeBox& box : canvas.boxes) {
        lo = glm::min(lo, box.at);
        hi = glm::max(hi, box.at + box.size);
    }
    const glm::dvec2 room = canvas.size / double(theme().scale) - glm::dvec2(48);
    const glm::dvec2 ratio = glm::max(room, glm::dvec2(10)) / glm::max(hi - lo, glm::dvec2(1));
    canvas.zoom = std::clamp(std::min(ratio.x, ratio.y), kLeastZoom, 1.25);
    canvas.pan = (lo + hi - canvas.size / (canvas.zoom * double(theme().scale))) * 0.5;
}

// --- the mouse -----------------------------------------------------------------------------------

std::string other_end_problem(const Editor& editor, const Hit& hit) {
    const Canvas& canvas = editor.canvas;
    if (hit.port_is_output == canvas.wire_from_output)
        return canvas.wire_from_output ? "an output is wired to an input" : "an input is wired to an output";
    const WireEnd& from = canvas.wire_from_output ? canvas.wire : *hit.port;
    const WireEnd& to = canvas.wire_from_output ? *hit.port : canvas.wire;
    return why_not_wired(editor.work.graph(), editor.registry, from, to);
}

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

void drop_nodes(Editor& editor, const std::vector<Wire>& wires) {
    Canvas& canvas = editor.canvas;
    if (canvas.moved == glm::dvec2(0.0)) return;
    Document::Step step(editor.work.document);
    std::vector<std::pair<std::string, glm::dvec2>> places;
    int single = -1;
    for (std::size_t i = 0; i < canvas.boxes.size(); ++i)
        if (editor.work.selected.count(editor.work.graph().nodes[i].id)) {
            places.emplace_back(editor.work.graph().nodes[i].id, snapped(canvas.boxes[i].at + canvas.moved));
            single = int(i);
        }
    edit(editor, [&] {
        editor.work.document.move_nodes(places);
        if (places.size() != 1) return;
        // A node without wires that is dropped on one goes into it.
        const NodeBox& box = canvas.boxes[std::size_t(single)];
        const glm::dvec2 middle = canvas.to_screen(places[0].second + box.size * 0.5);
        const std::string& id = places[0].first;
        for (const Wire& wire : wires) {
            if (wire.from.node == id || wire.to.node == id) return;
            if (distance_to(wire, middle) > 24 * double(theme().scale) * canvas.zoom) continue;
            if (insert_on_wire(editor.work, editor.registry, id, wire.from, wire.to)) return;
        }
    });
}

void select_in_box(Editor& editor, glm::dvec2 a, glm::dvec2 b) {
    const glm::dvec2 lo = glm::min(a, b), hi = glm::max(a, b);
    if (!ImGui::GetIO().KeyShift) editor.work.selected.clear();
    for (std::size_t i = 0; i < editor.canvas.boxes.size(); ++i)
        if (editor.canvas.boxes[i].overlaps(lo, hi)) editor.work.selected.insert(editor.work.graph().nodes[i].id);
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
    if (hit.port) {
        canvas.drag = Canvas::Drag::wire;
        canvas.wire = *hit.port;
        canvas.wire_from_output = hit.port_is_output;
        if (!hit.port_is_output && !io.KeyShift) pick_up_wire(editor, *hit.port);
    } else if (hit.node >= 0) {
        const std::string& id = editor.work.graph().nodes[std::size_t(hit.node)].id;
        if (io.KeyShift || io.KeyCtrl) {
            if (!editor.work.selected.erase(id)) editor.work.selected.insert(id);
            return;
        }
        if (!editor.work.selected.count(id)) editor.work.selected = {id};
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

void handle_mouse(Editor& editor, const Hit& hit, const std::vector<Wire>& wires, bool hovered) {
    Canvas& canvas = editor.canvas;
    const ImGuiIO& io = ImGui::GetIO();
    const glm::dvec2 mouse = vec(io.MousePos);
    if (hovered && io.MouseWheel != 0) zoom_about(canvas, mouse, std::pow(1.15, double(io.MouseWheel)));
    const bool panning = ImGui::IsMouseDown(ImGuiMouseButton_Middle) ||
                         (ImGui::IsMouseDown(ImGuiMouseButton_Right) && ImGui::IsMouseDragging(ImGuiMouseButton_Right, 4));
    if (canvas.drag == Canvas::Drag::none && hovered) {
        if (ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left)) {
            if (hit.node >= 0) show_in_viewport(editor, hit.node);
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
            if (!panning) canvas.drag = Canvas::Drag::none;
            return;
        case Canvas::Drag::nodes: {
            const glm::dvec2 by = at - canvas.grabbed;
            if (glm::length(by) * canvas.zoom > 4) canvas.moved = snapped(by);
            break;
        }
        case Canvas::Drag::box:
        case Canvas::Drag::wire: break;
    }
    if (ImGui::IsMouseDown(ImGuiMouseButton_Left)) return;
    const Canvas::Drag ended = std::exchange(canvas.drag, Canvas::Drag::none);
    if (ended == Canvas::Drag::wire) drop_wire(editor, hit, mouse);
    if (ended == Canvas::Drag::nodes) drop_nodes(editor, wires);
    if (ended == Canvas::Drag::box) select_in_box(editor, canvas.grabbed, at);
    canvas.moved = glm::dvec2(0.0);
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
    else if (hit.wire >= 0) text = wire_tooltip(editor, wires[std::size_t(hit.wire)]);
    // A tooltip over every node would be in the way: what lies under a resting pointer only.
    static double still_since = 0;
    if (ImGui::GetIO().MouseDelta.x != 0 || ImGui::GetIO().MouseDelta.y != 0) still_since = ImGui::GetTime();
    if (ImGui::GetTime() - still_since < 0.4 || text.empty()) return;
    ImGui::BeginTooltip();
    ImGui::PushTextWrapPos(ui(340));
    ImGui::TextUnformatted(text.c_str());
    ImGui::PopTextWrapPos();
    if (!hit.port && hit.node >= 0)
        draw_thumbnail(editor, editor.work.graph().nodes[std::size_t(hit.node)].id, editor.canvas.ports[std::size_t(hit.node)], ui(180));
    ImGui::EndTooltip();
}

void mark_everything(Editor& editor) {
    const Canvas& canvas = editor.canvas;
    const double reach = 4 * theme().scale;
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
}

}  // namespace

void fit_canvas(Editor& editor) { editor.canvas.fit_wanted = true; }

void draw_canvas(Editor& editor) {
    Canvas& canvas = editor.canvas;
    canvas.lo = vec(ImGui::GetCursorScreenPos());
    canvas.size = vec(ImGui::GetContentRegionAvail());
    if (canvas.size.x < 1 || canvas.size.y < 1) return;
    update_boxes(editor);
    if (canvas.fit_wanted) do_fit(canvas);
    ImGui::InvisibleButton("canvas", im(canvas.size), ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight |
                                                          ImGuiButtonFlags_MouseButtonMiddle);
    const bool hovered = ImGui::IsItemHovered() && !editor.start_page;
    std::vector<Wire> wires = wires_of(editor);
    const bool busy = canvas.drag != Canvas::Drag::none;
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
