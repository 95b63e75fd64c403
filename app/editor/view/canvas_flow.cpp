// What flows: in words on the wires, and small on the nodes.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/editor/view/canvas_drawing.h"
#include "app/editor/view/picture.h"
#include "core/base/text.h"

namespace voxloom::editor {

namespace {

constexpr double kLeastZoomForWords = 0.6;

const ValueDesc* desc_of(const Editor& editor, const WireEnd& output, const NodeStatus& status) {
    const GraphNode* node = editor.work.graph().find(output.node);
    const NodeType* type = node ? editor.registry.find(node->type) : nullptr;
    const PortSpec* port = type ? type->find_output(output.port) : nullptr;
    const auto o = port ? std::size_t(port - type->outputs.data()) : status.outputs.size();
    return o < status.outputs.size() ? &status.outputs[o] : nullptr;
}

// "256×256×128" above "u8, 8.0 MiB"; a cube is "256³".
std::pair<std::string, std::string> flow_lines(const ValueDesc& desc, std::uint64_t bytes) {
    std::string size(name_of(desc.type)), type;
    if (const VolumeDesc* volume = desc.volume()) {
        const Index3 n = volume->dims;
        size = n.x == n.y && n.y == n.z ? fmt::format("{}³", n.x) : fmt::format("{}×{}×{}", n.x, n.y, n.z);
        type = name_of(volume->type);
        if (volume->components > 1) type += fmt::format("×{}", volume->components);
    } else if (const auto* image = std::get_if<ImageDesc>(&desc.detail)) {
        size = fmt::format("{}×{}", image->size.x, image->size.y);
    }
    constexpr std::uint64_t kWorthSaying = 4096;
    if (bytes >= kWorthSaying) type += (type.empty() ? "" : ", ") + human_bytes(double(bytes));
    return {size, type};
}

void draw_reason(const Pen& pen, const std::string& reason, const NodeBox& room) {
    if (!pen.readable()) return;
    pen.list.PushClipRect(pen.at(room.at), pen.at(room.at + room.size), true);
    pen.list.AddText(theme().body, pen.px(11), pen.at(room.at + glm::dvec2(4, 2)), pen.color(theme().bad), reason.c_str(), nullptr, pen.px(room.size.x - 8));
    pen.list.PopClipRect();
}

void draw_picture(const Pen& pen, const SmallPicture& small, const NodeBox& room) {
    if (!small.problem.empty()) return draw_reason(pen, small.problem, room);
    const double height = std::min(room.size.y, room.size.x / small.thumbnail->aspect);
    const glm::dvec2 size(height * small.thumbnail->aspect, height);
    const glm::dvec2 at = room.at + (room.size - size) * 0.5;
    pen.list.AddRectFilled(pen.at(room.at), pen.at(room.at + room.size), pen.color(IM_COL32(0, 0, 0, 255)), pen.readable() ? pen.px(3) : 0);
    pen.list.AddImage(texture_of(small.picture), pen.at(at), pen.at(at + size), {0, 0}, {1, 1}, pen.color(IM_COL32_WHITE));
}

// Opacity as height, with its cube root, and the colours below it.
void draw_function(const Pen& pen, const TransferFunction& f, const NodeBox& room) {
    if (f.one.points.empty()) return;
    const double lo = f.one.points.front().value, hi = f.one.points.back().value;
    const int columns = pen.readable() ? 58 : 6;
    pen.list.AddRectFilled(pen.at(room.at), pen.at(room.at + room.size), pen.color(theme().canvas), pen.readable() ? pen.px(3) : 0);
    for (int i = 0; i < columns; ++i) {
        const Emission e = f.one.at(lo + (hi - lo) * (i + 0.5) / columns);
        const glm::dvec3 c = glm::clamp(voxloom::color_of(e), 0.0, 1.0);
        const double height = std::cbrt(std::clamp(opacity_of(e.a, f.reference_length), 0.0, 1.0)) * room.size.y;
        const glm::dvec2 foot = room.at + glm::dvec2(room.size.x * i / columns, room.size.y);
        pen.list.AddRectFilled(pen.at(foot - glm::dvec2(0, height)), pen.at(foot + glm::dvec2(room.size.x / columns, 0)),
                               pen.color(IM_COL32(int(c.r * 255), int(c.g * 255), int(c.b * 255), 255)));
    }
}

std::string short_text(const Table::Cell& cell) {
    if (auto* i = std::get_if<std::int64_t>(&cell)) return std::to_string(*i);
    if (auto* d = std::get_if<double>(&cell)) return fmt::format("{:.4g}", *d);
    return std::get<std::string>(cell);
}

// The first rows and columns, as many as there is room for.
void draw_numbers(const Pen& pen, const Table& table, const NodeBox& room) {
    constexpr double kLine = 13, kSize = 10, kColumn = 58;
    const auto columns = std::min<std::size_t>(table.columns.size(), std::size_t(room.size.x / kColumn));
    for (std::size_t c = 0; c < columns; ++c) {
        glm::dvec2 at = room.at + glm::dvec2(double(c) * kColumn + 2, 0);
        pen.text(at, theme().accent, table.columns[c].name, kColumn - 6, kSize);
        for (std::size_t r = 0; r < table.rows.size() && double(r + 2) * kLine <= room.size.y; ++r)
            pen.text(at += glm::dvec2(0, kLine), theme().text, short_text(table.rows[r][c]), kColumn - 6, kSize);
    }
}

}  // namespace

std::string flow_text(const Editor& editor, const WireEnd& output) {
    const NodeStatus* status = status_of(editor, output.node);
    const ValueDesc* desc = status ? desc_of(editor, output, *status) : nullptr;
    if (!desc) return {};
    return summary(*desc) + (status->bytes > 0 ? ", " + human_bytes(double(status->bytes)) : "");
}

bool draw_flow(const Pen& pen, const Editor& editor, const Wire& wire) {
    if (pen.canvas.zoom < kLeastZoomForWords) return false;
    const NodeStatus* status = status_of(editor, wire.from.node);
    if (!status || (status->state != NodeState::done && status->state != NodeState::cached)) return false;
    const ValueDesc* desc = desc_of(editor, wire.from, *status);
    if (!desc) return false;
    constexpr double kSize = 10, kLine = 12;
    const auto [above, below] = flow_lines(*desc, status->bytes);
    const double width = std::max(pen.width_of(above, kSize), pen.width_of(below, kSize)) + 6;
    if (width > (wire.p[3].x - wire.p[0].x) / pen.zoom - 6) return false;  // it would lie on a node
    const glm::dvec2 middle = pen.canvas.to_canvas((wire.p[0] + 3.0 * wire.p[1] + 3.0 * wire.p[2] + wire.p[3]) / 8.0);
    const glm::dvec2 size(width, (below.empty() ? 1 : 2) * kLine + 2), lo = middle - size * 0.5;
    pen.list.AddRectFilled(pen.at(lo), pen.at(lo + size), faded(theme().canvas, 0.85f), pen.px(3));
    const ImU32 color = wire.known ? color_of(wire.type) : theme().muted;
    pen.text(middle + glm::dvec2(-pen.width_of(above, kSize) / 2, -size.y / 2), color, above, width, kSize);
    if (!below.empty()) pen.text(middle + glm::dvec2(-pen.width_of(below, kSize) / 2, size.y / 2 - kLine - 1), theme().muted, below, width, kSize);
    return true;
}

void draw_look(const Pen& pen, Editor& editor, const std::string& node, const NodePorts& ports, const NodeBox& room) {
    if (const SmallPicture* small = small_picture(editor, node, ports)) return draw_picture(pen, *small, room);
    for (const PortSpec& port : ports.outputs) {
        auto value = editor.live.values.find(node + "." + port.key);
        if (value == editor.live.values.end()) continue;
        if (auto* function = std::get_if<TransferPtr>(&value->second.value)) return draw_function(pen, **function, room);
        if (auto* table = std::get_if<TablePtr>(&value->second.value)) return draw_numbers(pen, **table, room);
    }
}

}  // namespace voxloom::editor
