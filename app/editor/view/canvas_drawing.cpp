#include "app/editor/view/canvas_drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/base/text.h"

namespace voxloom::editor {

namespace {

// Below this zoom names cannot be read and are left out.
constexpr double kReadable = 0.38;

void draw_grid(const Pen& pen, glm::dvec2 lo, glm::dvec2 size) {
    double step = 40;
    while (step * pen.zoom < 24) step *= 4;
    const glm::dvec2 first = glm::ceil(pen.canvas.to_canvas(lo) / step) * step;
    const glm::dvec2 end = pen.canvas.to_canvas(lo + size);
    for (double y = first.y; y < end.y; y += step)
        for (double x = first.x; x < end.x; x += step) {
            const ImVec2 p = pen.at({x, y});
            pen.list.AddRectFilled({p.x - 1, p.y - 1}, {p.x + 1, p.y + 1}, theme().grid);
        }
}

void draw_wire(const Pen& pen, const Wire& w, float thickness, float alpha) {
    // A curve lies within the hull of its four points.
    const glm::dvec2 lo = glm::min(glm::min(w.p[0], w.p[1]), glm::min(w.p[2], w.p[3]));
    const glm::dvec2 hi = glm::max(glm::max(w.p[0], w.p[1]), glm::max(w.p[2], w.p[3]));
    if (!pen.sees({pen.canvas.to_canvas(lo), (hi - lo) / pen.zoom})) return;
    const ImU32 color = faded(w.known ? color_of(w.type) : theme().muted, alpha);
    // Seen from far, a straight wire is a row of pixels: three rows that fade out are most of what hundreds of wires cost.
    if (!pen.readable() && hi.y - lo.y < 0.5 && w.p[0].x < w.p[3].x) {
        const float y = std::floor(float(w.p[0].y));
        return pen.list.AddRectFilled({float(w.p[0].x), y}, {float(w.p[3].x), y + std::max(std::round(thickness), 1.f)}, color);
    }
    pen.list.AddBezierCubic(im(w.p[0]), im(w.p[1]), im(w.p[2]), im(w.p[3]), color, thickness);
}

void shape_curve(Wire& w) {
    const double reach = std::clamp(std::abs(w.p[3].x - w.p[0].x) * 0.5, 30.0 * theme().scale, 140.0 * theme().scale);
    w.p[1] = w.p[0] + glm::dvec2(reach, 0);
    w.p[2] = w.p[3] - glm::dvec2(reach, 0);
}

std::string footer_text(const NodeStatus& s) {
    switch (s.state) {
        case NodeState::not_asked: return s.message.empty() ? "" : "off";
        case NodeState::waiting: return "stale";
        case NodeState::running: {
            if (s.fraction < 0) return "running";
            std::string text = fmt::format("{:.0f} %", s.fraction * 100);
            if (s.seconds_left >= 0) text += ", " + human_seconds(s.seconds_left) + " left";
            return text;
        }
        case NodeState::done: return human_seconds(s.wall_seconds) + "  " + human_bytes(double(s.bytes));
        case NodeState::cached: return "kept  " + human_bytes(double(s.bytes));
        case NodeState::failed: return s.message;
        case NodeState::not_run: return "not run";
        case NodeState::cancelled: return "stopped";
    }
    return "";
}

void draw_port(const Pen& pen, glm::dvec2 at, const PortSpec& port, const NodePorts& ports, bool wired, bool output) {
    ImU32 color = theme().muted;
    if (ports.type)
        for (int t = 0; t < kPortTypes; ++t)
            if (port.types.has(PortType(t))) {
                color = color_of(PortType(t));
                break;
            }
    const float radius = std::max(pen.px(4.5), 1.5f);
    if (!pen.readable()) {  // seen from far a circle is a dot, and hundreds of them are many triangles
        const ImVec2 p = pen.at(at);
        return pen.list.AddRectFilled({p.x - radius, p.y - radius}, {p.x + radius, p.y + radius}, pen.color(color));
    }
    pen.list.AddCircleFilled(pen.at(at), radius, pen.color(wired || output ? color : theme().node), 12);
    pen.list.AddCircle(pen.at(at), radius, pen.color(color), 12, std::max(pen.px(1.5), 1.f));
    // Optional inputs are quieter; what must be wired is not.
    const ImU32 text = wired || output || !port.optional ? theme().text : theme().muted;
    if (!output) return pen.text(at + glm::dvec2(10, -8), text, port.key, kNodeWidth * 0.52);
    const double room = kNodeWidth * 0.52;
    const double width = std::min(pen.width_of(port.key), room);
    pen.text(at - glm::dvec2(10 + width, 8), text, port.key, room + 1);
}

// A line straight through the node, where it passes what comes in on; a cross where it is taken away.
void draw_use(const Pen& pen, const GraphNode& node, const NodePorts& ports, const NodeBox& box) {
    const float width = std::max(pen.px(2), 1.f);
    if (node.use == GraphNode::Use::bypassed && !ports.inputs.empty() && !ports.outputs.empty()) {
        const glm::dvec2 from = box.input(0), to = box.output(0), reach(box.size.x * 0.4, 0);
        pen.list.AddBezierCubic(pen.at(from), pen.at(from + reach), pen.at(to - reach), pen.at(to), theme().warn, width);
    } else if (node.use == GraphNode::Use::disabled) {
        const glm::dvec2 hi = box.at + box.size;
        pen.list.AddLine(pen.at({box.at.x, box.at.y + kHeaderHeight}), pen.at(hi), theme().muted, width);
        pen.list.AddLine(pen.at({hi.x, box.at.y + kHeaderHeight}), pen.at({box.at.x, hi.y}), theme().muted, width);
    }
}

void draw_node(Pen pen, Editor& editor, std::size_t i, glm::dvec2 moved) {
    const Theme& t = theme();
    const GraphNode& node = editor.work.graph().nodes[i];
    const NodePorts& ports = editor.canvas.ports[i];
    NodeBox box = editor.canvas.boxes[i];
    box.at += moved;
    if (!pen.sees(box)) return;
    ImVec2 lo = pen.at(box.at), hi = pen.at(box.at + box.size);
    const bool near = pen.readable();
    const float round = near ? pen.px(6) : 0;
    const bool selected = editor.work.selected.count(node.id) > 0;
    const NodeStatus* status = status_of(editor, node.id);
    const bool failed = status && status->state == NodeState::failed;
    const ImU32 edge = selected ? t.accent : failed ? t.bad : t.border;

    const bool used = node.use == GraphNode::Use::normal;
    if (!used || (status && status->state == NodeState::not_asked && !status->message.empty())) pen.alpha = 0.5f;
    if (near) pen.list.AddRectFilled({lo.x + pen.px(2), lo.y + pen.px(3)}, {hi.x + pen.px(2), hi.y + pen.px(3)}, pen.color(IM_COL32(0, 0, 0, t.dark ? 70 : 28)), round);
    // Seen from far, an edge is what a rectangle below shows of itself: fewer triangles than a line around.
    const bool framed = !near && pen.alpha == 1;
    if (framed) {
        const float width = selected ? 2 : 1;
        pen.list.AddRectFilled(lo, hi, edge);
        lo = {lo.x + width, lo.y + width};
        hi = {hi.x - width, hi.y - width};
    }
    pen.list.AddRectFilled(lo, hi, pen.color(t.node), round);
    pen.list.AddRectFilled(lo, {hi.x, lo.y + pen.px(kHeaderHeight)}, pen.color(t.header), round, ImDrawFlags_RoundCornersTop);
    pen.text(box.at + glm::dvec2(12, 5), ports.type ? t.text : t.bad, node.id, kNodeWidth - 40);
    if (status) {
        const ImVec2 dot = pen.at(box.at + glm::dvec2(kNodeWidth - 14, kHeaderHeight / 2));
        if (!near) pen.list.AddRectFilled({dot.x - pen.px(6), dot.y - pen.px(6)}, {dot.x + pen.px(6), dot.y + pen.px(6)}, color_of(status->state));
        else if (status->state == NodeState::not_asked) pen.list.AddCircle(dot, pen.px(4), pen.color(t.muted), 12);
        else pen.list.AddCircleFilled(dot, pen.px(4), color_of(status->state), 12);
    }
    auto wired = [&](const std::string& key) {
        return std::any_of(node.inputs.begin(), node.inputs.end(), [&](const GraphInput& in) { return in.port == key && !in.from.empty(); });
    };
    for (std::size_t k = 0; k < ports.inputs.size(); ++k) draw_port(pen, box.input(int(k)), ports.inputs[k], ports, wired(ports.inputs[k].key), false);
    for (std::size_t k = 0; k < ports.outputs.size(); ++k) draw_port(pen, box.output(int(k)), ports.outputs[k], ports, true, true);

    const double foot = box.at.y + box.size.y - kFooterHeight;
    if (const double height = picture_height(ports); height > 0)
        draw_look(pen, editor, node.id, ports, {{box.at.x + 8, foot - height + 2}, {kNodeWidth - 16, height - 4}});
    if (status) {
        if (status->state == NodeState::running && status->fraction >= 0) {
            const float end = lo.x + (hi.x - lo.x) * float(std::clamp(status->fraction, 0.0, 1.0));
            pen.list.AddRectFilled({lo.x, hi.y - pen.px(3)}, {end, hi.y}, t.accent);
        }
        const ImU32 color = status->state == NodeState::failed ? t.bad : status->state == NodeState::running ? t.accent : t.muted;
        const bool off = !used && status->state == NodeState::not_asked;
        if (near) pen.text({box.at.x + 12, foot + 2}, color, off ? std::string(name_of(node.use)) : footer_text(*status), kNodeWidth - 24);
    }
    draw_use(pen, node, ports, box);
    if (!framed) pen.list.AddRect(lo, hi, edge, round, 0, selected ? std::max(pen.px(2), 1.5f) : 1.f);
}

// The whole graph, small, with what is seen of it; only where not all of it is seen.
void draw_minimap(Editor& editor) {
    const Canvas& canvas = editor.canvas;
    if (!canvas.map) return;
    const Minimap& map = *canvas.map;
    ImDrawList& list = *ImGui::GetWindowDrawList();
    auto place = [&](glm::dvec2 p) { return im(map.to_screen(p)); };
    list.AddRectFilled(im(map.lo - glm::dvec2(ui(4))), im(map.lo + map.size + glm::dvec2(ui(4))), faded(theme().panel, 0.85f), ui(4));
    for (std::size_t i = 0; i < canvas.boxes.size(); ++i) {
        const NodeStatus* status = status_of(editor, editor.work.graph().nodes[i].id);
        list.AddRectFilled(place(canvas.boxes[i].at), place(canvas.boxes[i].at + canvas.boxes[i].size),
                           status ? faded(color_of(status->state), 0.7f) : theme().border);
    }
    // While it is dragged, what is seen may reach beyond it.
    const glm::dvec2 seen_hi = canvas.to_canvas(canvas.lo + canvas.size);
    list.AddRect(im(glm::max(map.to_screen(canvas.pan), map.lo)), im(glm::min(map.to_screen(seen_hi), map.lo + map.size)), theme().accent);
}

}  // namespace

Pen::Pen(const Canvas& c) : list(*ImGui::GetWindowDrawList()), canvas(c), zoom(c.zoom * double(theme().scale)) {}

bool Pen::readable() const { return canvas.zoom >= kReadable; }

bool Pen::sees(const NodeBox& box) const {
    const glm::dvec2 a = canvas.to_screen(box.at), b = canvas.to_screen(box.at + box.size), end = canvas.lo + canvas.size;
    return b.x >= canvas.lo.x && b.y >= canvas.lo.y && a.x <= end.x && a.y <= end.y;
}

void Pen::text(glm::dvec2 p, ImU32 c, const std::string& s, double width, double height) const {
    if (!readable() || s.empty()) return;
    const std::string cut = shortened(s, px(width), theme().body, px(height));
    list.AddText(theme().body, px(height), at(p), color(c), cut.c_str());
}

double Pen::width_of(const std::string& s, double height) const {
    return double(theme().body->CalcTextSizeA(px(height), FLT_MAX, 0, s.c_str()).x) / zoom;
}

std::pair<glm::dvec2, glm::dvec2> bounds_of(const Canvas& canvas) {
    glm::dvec2 lo(1e300), hi(-1e300);
    for (const auto* boxes : {&canvas.boxes, &canvas.group_boxes, &canvas.comment_boxes})
        for (const NodeBox& box : *boxes) {
            lo = glm::min(lo, box.at);
            hi = glm::max(hi, box.at + box.size);
        }
    return {lo, hi};
}

std::optional<Minimap> minimap_of(const Canvas& canvas) {
    if (canvas.boxes.empty() && canvas.comment_boxes.empty()) return std::nullopt;
    const auto [lo, hi] = bounds_of(canvas);
    const glm::dvec2 seen_lo = canvas.pan, seen_hi = canvas.to_canvas(canvas.lo + canvas.size);
    if (glm::all(glm::lessThanEqual(seen_lo, lo)) && glm::all(glm::greaterThanEqual(seen_hi, hi))) return std::nullopt;
    const glm::dvec2 all_lo = glm::min(lo, seen_lo), all = glm::max(hi, seen_hi) - all_lo;
    const glm::dvec2 ratio = glm::dvec2(ui(150), ui(100)) / all;
    const double scale = std::min(ratio.x, ratio.y);
    return Minimap{canvas.lo + canvas.size - all * scale - glm::dvec2(ui(10)), all * scale, all_lo, scale};
}

std::vector<Wire> wires_of(const Editor& editor) {
    const Canvas& canvas = editor.canvas;
    const Graph& graph = editor.work.graph();
    std::map<std::string_view, std::size_t> index;
    for (std::size_t i = 0; i < graph.nodes.size(); ++i) index.emplace(graph.nodes[i].id, i);
    auto shift = [&](std::size_t i) {
        const bool moving = canvas.drag == Canvas::Drag::nodes && editor.work.selected.count(graph.nodes[i].id);
        return moving ? canvas.moved : glm::dvec2(0.0);
    };
    std::vector<Wire> wires;
    for (std::size_t i = 0; i < graph.nodes.size(); ++i)
        for (const GraphInput& input : graph.nodes[i].inputs)
            for (const WireEnd& end : input.from) {
                auto found = index.find(end.node);
                if (found == index.end()) continue;
                const std::size_t j = found->second;
                const int in = canvas.ports[i].input(input.port), out = canvas.ports[j].output(end.port);
                if (in < 0 || out < 0) continue;
                Wire w;
                w.from = end;
                w.to = {graph.nodes[i].id, input.port, {}};
                w.known = canvas.ports[j].type != nullptr;
                if (w.known) w.type = type_of(canvas.ports[j].outputs[std::size_t(out)]);
                w.p[0] = canvas.to_screen(canvas.boxes[j].output(out) + shift(j));
                w.p[3] = canvas.to_screen(canvas.boxes[i].input(in) + shift(i));
                shape_curve(w);
                wires.push_back(std::move(w));
            }
    return wires;
}

// To the nearest of the curve's chords.
double distance_to(const Wire& w, glm::dvec2 point) {
    constexpr int kChords = 24;
    double nearest = 1e30;
    glm::dvec2 before = w.p[0];
    for (int i = 1; i <= kChords; ++i) {
        const double t = double(i) / kChords, s = 1 - t;
        const glm::dvec2 next = s * s * s * w.p[0] + 3 * s * s * t * w.p[1] + 3 * s * t * t * w.p[2] + t * t * t * w.p[3];
        const glm::dvec2 along = next - before;
        const double length2 = glm::dot(along, along);
        const double u = length2 > 0 ? std::clamp(glm::dot(point - before, along) / length2, 0.0, 1.0) : 0.0;
        nearest = std::min(nearest, glm::distance(point, before + u * along));
        before = next;
    }
    return nearest;
}

void draw_graph(Editor& editor, const std::vector<Wire>& wires, int hovered_wire) {
    const Canvas& canvas = editor.canvas;
    const Theme& t = theme();
    Pen pen(canvas);
    const ImVec2 lo = im(canvas.lo), hi = im(canvas.lo + canvas.size);
    pen.list.PushClipRect(lo, hi, true);
    draw_grid(pen, canvas.lo, canvas.size);
    draw_notes(pen, editor);
    for (std::size_t i = 0; i < wires.size(); ++i) {
        const bool strong = int(i) == hovered_wire || editor.work.selected.count(wires[i].from.node) || editor.work.selected.count(wires[i].to.node);
        draw_wire(pen, wires[i], std::max(pen.px(strong ? 3 : 2), 1.f), strong ? 1.f : 0.65f);
    }
    std::set<std::pair<std::string_view, std::string_view>> said;  // the wires of one output say it once
    for (const Wire& wire : wires)
        if (const std::pair<std::string_view, std::string_view> output{wire.from.node, wire.from.port};
            !said.count(output) && draw_flow(pen, editor, wire))
            said.insert(output);
    for (std::size_t i = 0; i < canvas.boxes.size(); ++i) {
        const bool moving = canvas.drag == Canvas::Drag::nodes && editor.work.selected.count(editor.work.graph().nodes[i].id);
        draw_node(pen, editor, i, moving ? canvas.moved : glm::dvec2(0.0));
    }
    if (canvas.drag == Canvas::Drag::wire) {
        Wire w;
        const int i = [&] {
            for (std::size_t k = 0; k < canvas.boxes.size(); ++k)
                if (editor.work.graph().nodes[k].id == canvas.wire.node) return int(k);
            return -1;
        }();
        if (i >= 0) {
            const NodePorts& ports = canvas.ports[std::size_t(i)];
            const int k = canvas.wire_from_output ? ports.output(canvas.wire.port) : ports.input(canvas.wire.port);
            const glm::dvec2 mouse = vec(ImGui::GetMousePos());
            const glm::dvec2 fixed = canvas.to_screen(canvas.wire_from_output ? canvas.boxes[std::size_t(i)].output(k) : canvas.boxes[std::size_t(i)].input(k));
            w.p[0] = canvas.wire_from_output ? fixed : mouse;
            w.p[3] = canvas.wire_from_output ? mouse : fixed;
            w.known = ports.type && canvas.wire_from_output && k >= 0;
            if (w.known) w.type = type_of(ports.outputs[std::size_t(k)]);
            shape_curve(w);
            draw_wire(pen, w, std::max(pen.px(2.5), 1.f), 1);
        }
    }
    if (canvas.drag == Canvas::Drag::box) {
        const ImVec2 a = pen.at(canvas.grabbed), b = ImGui::GetMousePos();
        pen.list.AddRectFilled({std::min(a.x, b.x), std::min(a.y, b.y)}, {std::max(a.x, b.x), std::max(a.y, b.y)}, faded(t.accent, 0.12f));
        pen.list.AddRect({std::min(a.x, b.x), std::min(a.y, b.y)}, {std::max(a.x, b.x), std::max(a.y, b.y)}, t.accent);
    }
    draw_minimap(editor);
    pen.list.PopClipRect();
    if (canvas.boxes.empty() && canvas.comments.empty() && !editor.start_page) {
        const char* hint = "Tab, or a double click, adds a node.  F1 shows everything else.";
        const ImVec2 size = ImGui::CalcTextSize(hint);
        pen.list.AddText({(lo.x + hi.x - size.x) / 2, (lo.y + hi.y - size.y) / 2}, t.muted, hint);
    }
}

}  // namespace voxloom::editor
