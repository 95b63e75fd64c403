// A transfer function over the histogram of the data that it is fitted to: points are dragged, added
// and removed. Opacity goes up with its cube root, since most of what is drawn is nearly transparent.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/editor/model/param_values.h"
#include "app/editor/view/picture.h"

namespace voxloom::editor {

namespace {

double height_of(double opacity) { return std::cbrt(std::clamp(opacity, 0.0, 1.0)); }
double opacity_at(double height) {
    const double h = std::clamp(height, 0.0, 1.0);
    return short_number(h * h * h);
}

// What the editor needs of its node, gathered anew for each frame.
struct Scene {
    Editor& editor;
    std::string id;
    const NodeType& type;
    bool editable = false;        // the points are what the function is made of
    bool relative = false;        // they count from 0 to 1 over the range
    ValueRange range{0, 1};
    Rows points{};
    TransferPtr function{};
    VolumePtr data{};
    std::shared_ptr<const Histogram> histogram{};
    std::string problem{};        // why there is no histogram
    ImVec2 lo{}, hi{};            // of the plot, in pixels

    double share(double value) const { return range.extent() > 0 ? (value - range.min) / range.extent() : 0.5; }
    double value(double share_of_range) const { return range.min + share_of_range * range.extent(); }
    double share_of_point(double v) const { return relative ? v : share(v); }
    double point_at(double s) const { return short_number(relative ? s : value(s)); }
    ImVec2 place(double s, double opacity) const {
        return {lo.x + float(s) * (hi.x - lo.x), hi.y - float(height_of(opacity)) * (hi.y - lo.y)};
    }
    void set_points(Rows rows) const {
        std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return a.front() < b.front(); });
        edit(editor, [&] { editor.work.document.set_param(id, "points", rows); });
    }
};

VolumePtr data_of(const Editor& editor, const GraphNode& node) {
    for (const GraphInput& input : node.inputs)
        for (const WireEnd& end : input.from)
            if (auto found = editor.live.volumes.find(end.node + "." + end.port); found != editor.live.volumes.end())
                if (VolumePtr volume = found->second.lock()) return volume;
    return nullptr;
}

Scene scene_of(Editor& editor, const GraphNode& node, const NodeType& type) {
    Scene s{editor, node.id, type};
    auto text = [&](const char* key) {
        const ParamSpec* spec = type.find_param(key);
        const ParamValue v = spec ? value_of(node, *spec) : ParamValue(std::string());
        const auto* t = std::get_if<std::string>(&v);
        return t ? *t : std::string();
    };
    s.editable = !type.find_param("preset") || text("preset") == "none";
    s.relative = text("domain") == "relative";
    s.points = std::get<Rows>(value_of(node, *type.find_param("points")));
    std::erase_if(s.points, [](const auto& row) { return row.size() != 2 && row.size() != 5; });
    for (const auto& [port, value] : editor.live.values)
        if (auto* f = std::get_if<TransferPtr>(&value.value); f && port.starts_with(node.id + ".")) s.function = *f;
    s.data = data_of(editor, node);
    if (const VolumePtr volume = s.data) {
        const auto found = editor.histograms.find({volume}, [volume](const std::stop_token& stop) {
            return std::make_shared<const Histogram>(histogram_of(*volume, stop));
        });
        s.histogram = found.made;
        s.problem = found.problem;
    }
    if (s.histogram && s.histogram->range.extent() > 0) s.range = s.histogram->range;
    else if (s.function && s.function->one.points.size() > 1)
        s.range = {s.function->one.points.front().value, s.function->one.points.back().value};
    // What is constant has no range of its own, but is seen beside the function.
    if (s.histogram && s.histogram->range.extent() <= 0)
        s.range = {std::min(s.range.min, s.histogram->range.min), std::max(s.range.max, s.histogram->range.max)};
    if (const ParamSpec* spec = type.find_param("range")) {
        const auto given = value_of(node, *spec);
        if (auto* r = std::get_if<std::vector<double>>(&given); r && r->size() == 2 && (*r)[0] < (*r)[1]) s.range = {(*r)[0], (*r)[1]};
    }
    return s;
}

void draw_reason(const Scene& s, const std::string& reason) {
    const float left = s.lo.x + ui(40);
    ImGui::GetWindowDrawList()->AddText(theme().body, theme().body->FontSize, {left, s.lo.y + ui(8)}, theme().bad, reason.c_str(), nullptr,
                                        std::max(s.hi.x - ui(8) - left, 1.f));
}

void draw_histogram(const Scene& s) {
    if (!s.problem.empty()) return draw_reason(s, s.problem);
    if (!s.histogram || s.histogram->counts.empty()) return;
    ImDrawList& list = *ImGui::GetWindowDrawList();
    const auto& counts = s.histogram->counts;
    const double most = std::log1p(*std::max_element(counts.begin(), counts.end()));
    if (most <= 0) return;
    const ValueRange r = s.histogram->range;
    const ImU32 color = faded(theme().muted, 0.35f);
    for (std::size_t i = 0; i < counts.size(); ++i) {
        if (counts[i] <= 0) continue;
        const double a = s.share(r.min + r.extent() * double(i) / double(counts.size()));
        const double b = s.share(r.min + r.extent() * double(i + 1) / double(counts.size()));
        const float left = std::max(s.place(a, 0).x, s.lo.x), right = std::min(s.place(b, 0).x, s.hi.x);
        const bool constant = r.extent() <= 0 && left == right;  // one bar, that can be seen
        if (left < right || constant)
            list.AddRectFilled({left, s.hi.y - float(std::log1p(counts[i]) / most) * (s.hi.y - s.lo.y)}, {right + (constant ? ui(3) : 1), s.hi.y}, color);
    }
}

// Value to the right, gradient upwards, the logarithm of how often both occur as brightness.
void draw_gradients(const Scene& s) {
    TransferEditor& state = s.editor.transfer;
    const VolumePtr volume = s.data;
    if (!s.problem.empty()) return draw_reason(s, s.problem);
    if (!state.gradients || !volume || !s.histogram) return;
    const ValueRange range = s.histogram->range;
    const auto found = s.editor.gradients.find({volume}, [volume, range](const std::stop_token& stop) {
        return std::make_shared<const GradientHistogram>(gradient_histogram_of(*volume, range, stop));
    });
    const auto& made = found.made;
    if (!made) return draw_reason(s, found.problem);
    if (made != state.shown) {
        const double most = std::log1p(*std::ranges::max_element(made->counts));
        std::vector<glm::u8vec4> pixels;
        for (std::size_t row = kGradientBins; row-- > 0;)
            for (std::size_t column = 0; column < kHistogramBins; ++column) {
                const double share = most > 0 ? std::log1p(made->counts[row * kHistogramBins + column]) / most : 0;
                pixels.emplace_back(190, 205, 225, std::uint8_t(share * 200));
            }
        upload(s.editor, state.picture, {int(kHistogramBins), int(kGradientBins)}, pixels);
        state.shown = made;
    }
    ImGui::GetWindowDrawList()->AddImage(texture_of(state.picture), {s.place(s.share(range.min), 0).x, s.lo.y}, {s.place(s.share(range.max), 0).x, s.hi.y});
}

// The function as it was evaluated: its opacity as a height, its colour below.
void draw_function(const Scene& s) {
    if (!s.function) return;
    ImDrawList& list = *ImGui::GetWindowDrawList();
    ImVec2 before{};
    const int columns = std::max(int((s.hi.x - s.lo.x) / 2), 1);
    for (int i = 0; i <= columns; ++i) {
        const double at = double(i) / columns;
        const Emission e = s.function->one.at(s.value(at));
        const ImVec2 p = s.place(at, opacity_of(e.a, s.function->reference_length));
        const glm::dvec3 c = glm::clamp(voxloom::color_of(e), 0.0, 1.0);
        const ImU32 color = IM_COL32(int(c.r * 255), int(c.g * 255), int(c.b * 255), 255);
        if (i > 0) {
            list.AddQuadFilled(before, p, {p.x, s.hi.y}, {before.x, s.hi.y}, faded(color, 0.55f));
            list.AddLine(before, p, color, std::max(ui(1.5), 1.f));
        }
        before = p;
    }
}

void draw_axes(const Scene& s) {
    ImDrawList& list = *ImGui::GetWindowDrawList();
    const Theme& t = theme();
    const float size = t.body->FontSize * 0.8f;
    for (double opacity : {0.001, 0.01, 0.1, 1.0}) {
        const float y = s.place(0, opacity).y;
        list.AddLine({s.lo.x, y}, {s.hi.x, y}, faded(t.border, 0.6f));
        list.AddText(t.body, size, {s.lo.x + ui(3), y + 1}, t.muted, fmt::format("{:g}", opacity).c_str());
    }
    const std::string left = fmt::format("{:.5g}", s.range.min), right = fmt::format("{:.5g}", s.range.max);
    list.AddText(t.body, size, {s.lo.x, s.hi.y + ui(3)}, t.muted, left.c_str());
    list.AddText(t.body, size, {s.hi.x - t.body->CalcTextSizeA(size, FLT_MAX, 0, right.c_str()).x, s.hi.y + ui(3)}, t.muted, right.c_str());
}

int nearest_point(const Scene& s, ImVec2 mouse) {
    int nearest = -1;
    double best = ui(10);
    for (std::size_t i = 0; i < s.points.size(); ++i)
        if (const double d = glm::distance(vec(s.place(s.share_of_point(s.points[i].front()), s.points[i].back())), vec(mouse)); d < best) {
            best = d;
            nearest = int(i);
        }
    return nearest;
}

void add_point(const Scene& s, double share, double opacity) {
    Rows rows = s.points;
    std::vector<double> row{s.point_at(share), opacity};
    const bool colored = std::any_of(rows.begin(), rows.end(), [](const auto& r) { return r.size() == 5; });
    if (colored && s.function) {
        const glm::dvec3 c = glm::clamp(voxloom::color_of(s.function->one.at(s.value(share))), 0.0, 1.0);
        row = {row[0], short_number(c.r), short_number(c.g), short_number(c.b), opacity};
    }
    rows.push_back(row);
    s.set_points(std::move(rows));
}

void handle_mouse(const Scene& s) {
    TransferEditor& state = s.editor.transfer;
    const ImVec2 mouse = ImGui::GetMousePos();
    const double share = std::clamp(double((mouse.x - s.lo.x) / (s.hi.x - s.lo.x)), 0.0, 1.0);
    const double opacity = opacity_at((s.hi.y - mouse.y) / (s.hi.y - s.lo.y));
    const int near = nearest_point(s, mouse);
    if (ImGui::IsItemHovered()) {
        if (ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left) && near < 0) {
            add_point(s, share, opacity);
            return;
        }
        if (ImGui::IsMouseClicked(ImGuiMouseButton_Left)) {
            state.dragged = near;
            if (near >= 0) state.chosen = near;
        }
        if (ImGui::IsMouseClicked(ImGuiMouseButton_Right) && near >= 0 && s.points.size() > 1) {
            Rows rows = s.points;
            rows.erase(rows.begin() + near);
            state.chosen = -1;
            s.set_points(std::move(rows));
            return;
        }
    }
    if (!ImGui::IsMouseDown(ImGuiMouseButton_Left)) state.dragged = -1;
    if (state.dragged < 0 || state.dragged >= int(s.points.size())) return;
    s.editor.moving = true;
    if (ImGui::GetIO().MouseDelta.x == 0 && ImGui::GetIO().MouseDelta.y == 0) return;
    Rows rows = s.points;
    auto& row = rows[std::size_t(state.dragged)];
    // Between its neighbours, so that it stays the point that is in the hand.
    const double lo = state.dragged > 0 ? rows[std::size_t(state.dragged - 1)].front() : s.point_at(0);
    const double hi = state.dragged + 1 < int(rows.size()) ? rows[std::size_t(state.dragged + 1)].front() : s.point_at(1);
    row.front() = std::clamp(s.point_at(share), std::min(lo, hi), std::max(lo, hi));
    row.back() = opacity;
    s.set_points(std::move(rows));
}

void draw_points(const Scene& s) {
    ImDrawList& list = *ImGui::GetWindowDrawList();
    for (std::size_t i = 0; i < s.points.size(); ++i) {
        const ImVec2 p = s.place(s.share_of_point(s.points[i].front()), s.points[i].back());
        list.AddCircleFilled(p, ui(4.5), int(i) == s.editor.transfer.chosen ? theme().accent : theme().text, 12);
        list.AddCircle(p, ui(4.5), theme().node, 12);
        mark(s.editor, fmt::format("point:{}.{}", s.id, i), {p.x - ui(4), p.y - ui(4)}, {p.x + ui(4), p.y + ui(4)});
    }
}

// The colour of the chosen point; without one it is the colour map's.
void draw_chosen(const Scene& s) {
    const int i = s.editor.transfer.chosen;
    if (i < 0 || i >= int(s.points.size())) return;
    const auto& row = s.points[std::size_t(i)];
    glm::dvec3 c(1);
    if (row.size() == 5) c = {row[1], row[2], row[3]};
    else if (s.function) c = voxloom::color_of(s.function->one.at(s.relative ? s.value(row[0]) : row[0]));
    float rgb[3] = {float(c.r), float(c.g), float(c.b)};
    ImGui::SetNextItemWidth(ui(220));
    if (ImGui::ColorEdit3("Point's colour", rgb, ImGuiColorEditFlags_Float)) {
        Rows rows = s.points;
        auto rounded = [](float x) { return std::round(std::clamp(double(x), 0.0, 1.0) * 1e4) / 1e4; };
        rows[std::size_t(i)] = {row.front(), rounded(rgb[0]), rounded(rgb[1]), rounded(rgb[2]), row.back()};
        s.editor.moving = ImGui::IsMouseDown(ImGuiMouseButton_Left);
        s.set_points(std::move(rows));
    }
    mark(s.editor, "point-colour");
}

// The function of a preset as points that can be dragged; what is drawn stays the same.
void turn_into_points(const Scene& s) {
    Rows rows;
    for (const auto& point : s.function->one.points) {
        const glm::dvec3 c = glm::clamp(voxloom::color_of(point.emission), 0.0, 1.0);
        rows.push_back({short_number(point.value), short_number(c.r), short_number(c.g), short_number(c.b),
                        short_number(opacity_of(point.emission.a, s.function->reference_length))});
    }
    edit(s.editor, [&] {
        Document& document = s.editor.work.document;
        Document::Step step(document);
        document.set_param(s.id, "points", rows);
        if (s.type.find_param("domain")) document.set_param(s.id, "domain", std::string("values"));
        if (s.type.find_param("preset")) document.set_param(s.id, "preset", std::string("none"));
        for (const char* key : {"opacity_scale", "value_offset"})
            if (s.type.find_param(key)) document.reset_param(s.id, key);
    });
}

// Above the plot, where they are seen however low the panel is.
void draw_choices(const Scene& s) {
    if (!s.editable && s.function) {
        if (ImGui::Button("Turn into points")) turn_into_points(s);
        mark(s.editor, "into-points");
        tooltip("Writes the preset's function as points that can be dragged; the picture stays the same.");
        ImGui::SameLine();
    }
    ImGui::Checkbox("Gradients", &s.editor.transfer.gradients);
    mark(s.editor, "gradients");
    tooltip("Behind the function: how often each value occurs, or each value (to the right) with each gradient (upwards, from a "
            "thousandth of the range a voxel to all of it); boundaries between materials are arcs.");
}

}  // namespace

bool has_transfer_editor(const NodeType& type) {
    const ParamSpec* points = type.find_param("points");
    return points && points->kind == ParamKind::rows &&
           std::any_of(type.outputs.begin(), type.outputs.end(), [](const PortSpec& port) { return type_of(port) == PortType::transfer; });
}

void draw_transfer_editor(Editor& editor, const std::string& id, const NodeType& type) {
    const GraphNode* node = editor.work.graph().find(id);
    if (!node) return;
    if (editor.transfer.node != id) {
        editor.transfer.node = id;
        editor.transfer.dragged = editor.transfer.chosen = -1;
    }
    Scene s = scene_of(editor, *node, type);
    draw_choices(s);
    const float width = ImGui::GetContentRegionAvail().x, height = ui(150);
    s.lo = ImGui::GetCursorScreenPos();
    s.hi = {s.lo.x + width, s.lo.y + height};
    ImGui::InvisibleButton("transfer", {width, height});
    mark(editor, "transfer:" + id);
    ImGui::GetWindowDrawList()->AddRectFilled(s.lo, s.hi, theme().canvas, ui(4));
    if (s.editable) handle_mouse(s);
    ImGui::GetWindowDrawList()->PushClipRect(s.lo, s.hi, true);
    editor.transfer.gradients ? draw_gradients(s) : draw_histogram(s);
    draw_function(s);
    ImGui::GetWindowDrawList()->PopClipRect();
    draw_axes(s);
    if (s.editable) draw_points(s);
    ImGui::Dummy({0, ui(14)});
    if (!s.editable) return;
    draw_chosen(s);
    wrapped_in(theme().muted, "Drag points; a double click adds one, a right click removes it.");
}

}  // namespace voxloom::editor
