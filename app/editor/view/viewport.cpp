// Pictures and tables: one of them, several side by side, or two of them over each other.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "app/editor/model/camera_control.h"
#include "app/editor/view/actions.h"
#include "app/editor/view/picture.h"
#include "core/base/text.h"

namespace voxloom::editor {

namespace {

using Mode = Viewport::Mode;

std::string name_of_port(const WireEnd& port) { return port.node + "." + port.port; }

const LiveValue* value_at(const Editor& editor, const WireEnd& port) {
    auto found = editor.live.values.find(name_of_port(port));
    return found == editor.live.values.end() ? nullptr : &found->second;
}

const Camera* camera_seen(const Editor& editor, const std::optional<std::string>& camera) {
    if (!camera) return nullptr;
    for (const auto& [port, value] : editor.live.values)
        if (auto* now = std::get_if<CameraPtr>(&value.value); now && port.starts_with(*camera + ".")) return now->get();
    return nullptr;
}

// --- what stands above the pictures ---------------------------------------------------------------

void draw_port_choice(Editor& editor, std::size_t k, const WireEnd* shown, float width) {
    const std::string name = shown ? name_of_port(*shown) : "Choose…";
    ImGui::PushID(int(k));
    ImGui::SetNextItemWidth(width);
    const std::string seen = shortened(name, width - ImGui::GetFrameHeight() - ui(12), theme().body, theme().body->FontSize);
    if (ImGui::BeginCombo("##port", seen.c_str())) {
        for (const WireEnd& port : ports_to_look_at(editor)) {
            const std::string text = name_of_port(port);
            if (ImGui::Selectable(text.c_str(), text == name)) editor.viewport.pictures[k].port = port;
            mark(editor, "show:" + text);
        }
        ImGui::EndCombo();
    }
    mark(editor, fmt::format("picture-port:{}", k));
    tooltip("What is shown; a double click on a node shows its picture, too.");
    ImGui::PopID();
}

void draw_mode_choice(Editor& editor) {
    Viewport& view = editor.viewport;
    static const std::pair<Mode, const char*> modes[] = {{Mode::single, "One"}, {Mode::two, "Two"}, {Mode::four, "Four"},
                                                         {Mode::wipe, "Wipe"}, {Mode::flicker, "Flicker"}, {Mode::difference, "Difference"}};
    const char* now = "";
    for (auto& [mode, name] : modes)
        if (mode == view.mode) now = name;
    ImGui::SetNextItemWidth(ui(104));
    if (ImGui::BeginCombo("##mode", now)) {
        for (auto& [mode, name] : modes) {
            if (ImGui::Selectable(name, mode == view.mode)) view.mode = mode;
            mark(editor, std::string("mode:") + name);
        }
        ImGui::EndCombo();
    }
    mark(editor, "mode");
    tooltip("One picture, or several to compare: side by side, one wiped over the other, in turns, or their difference.  (C)");
    if (view.mode != Mode::difference) return;
    ImGui::SameLine();
    ImGui::SetNextItemWidth(ui(90));
    float scale = float(view.difference.scale);
    if (ImGui::SliderFloat("##scale", &scale, 1, 256, "x %.0f", ImGuiSliderFlags_Logarithmic)) view.difference.scale = double(scale);
    tooltip("Differences are drawn this many times as large.");
}

// --- the mouse -----------------------------------------------------------------------------------

// The picture itself under the glass.
void move_picture(Viewport& view, glm::dvec2 middle, double scale, double wheel, bool dragged) {
    const ImGuiIO& io = ImGui::GetIO();
    if (wheel != 0) {
        const double zoom = std::clamp(scale * std::pow(1.15, wheel), 0.02, 64.0);
        view.offset += (vec(io.MousePos) - middle - view.offset) * (1 - zoom / scale);
        view.zoom = zoom;
    }
    if (!dragged) return;
    if (view.zoom == 0) view.zoom = scale;
    view.offset += vec(io.MouseDelta);
}

// The cameras of all the pictures, so that they keep showing the same.
void move_cameras(Editor& editor, const std::set<std::string>& cameras, double picture_height, double wheel, bool orbiting, bool panning) {
    const glm::dvec2 delta = vec(ImGui::GetIO().MouseDelta) / std::max(picture_height, 1.0);
    if (wheel != 0) editor.moving_until = ImGui::GetTime() + 0.25;
    if (orbiting || panning) editor.moving = true;
    if (wheel == 0 && delta == glm::dvec2(0.0)) return;
    edit(editor, [&] {
        Document::Step step(editor.work.document);
        for (const std::string& camera : cameras) {
            if (wheel != 0) magnify(editor.work, editor.registry, camera, std::pow(1.15, wheel));
            // Half a turn across the picture's height, whatever its size on the screen.
            if (orbiting) orbit(editor.work, editor.registry, camera, delta * 180.0);
            if (const Camera* now = camera_seen(editor, camera); panning && now) pan(editor.work, editor.registry, camera, delta, *now);
        }
    });
}

void handle_mouse(Editor& editor, glm::dvec2 middle, double scale, double picture_height) {
    const ImGuiIO& io = ImGui::GetIO();
    const double wheel = ImGui::IsItemHovered() ? double(io.MouseWheel) : 0;
    const bool held = ImGui::IsItemActive();
    if (!held && wheel == 0) return;
    std::set<std::string> cameras;
    for (const WireEnd& port : shown_ports(editor))
        if (auto camera = camera_of(editor.work.graph(), editor.registry, port.node)) cameras.insert(*camera);
    if (cameras.empty()) return move_picture(editor.viewport, middle, scale, wheel, held);
    const bool left = held && ImGui::IsMouseDown(ImGuiMouseButton_Left);
    const bool middle_button = held && ImGui::IsMouseDown(ImGuiMouseButton_Middle);
    const bool right = held && ImGui::IsMouseDown(ImGuiMouseButton_Right);
    move_cameras(editor, cameras, picture_height * scale, io.KeyCtrl ? 0 : wheel, left && !io.KeyShift, middle_button || (left && io.KeyShift));
    move_picture(editor.viewport, middle, scale, io.KeyCtrl ? wheel : 0, right);
}

// --- one cell ------------------------------------------------------------------------------------

void say_in(glm::dvec2 lo, glm::dvec2 size, const std::string& text) {
    const ImVec2 extent = ImGui::CalcTextSize(text.c_str(), nullptr, false, float(size.x) - ui(24));
    ImGui::GetWindowDrawList()->AddText(theme().body, theme().body->FontSize, im(lo + (size - vec(extent)) * 0.5),
                                        IM_COL32(148, 155, 167, 255), text.c_str(), nullptr, float(size.x) - ui(24));
}

// What is said in the corner: the picture's size, its age, how fast it came.
std::string caption(const Editor& editor, const WireEnd& port, const LiveValue& value, glm::ivec2 size) {
    std::string text = fmt::format("{} x {}", size.x, size.y);
    if (const NodeStatus* status = status_of(editor, port.node)) {
        if (status->state == NodeState::failed) return text + ", not of this graph: the node failed";
        if (value.fresh && status->wall_seconds > 0) text += ", " + human_seconds(status->wall_seconds);
    }
    if (!value.fresh) text += editor.live.busy ? ", refining" : ", of an older graph";
    return text;
}

// Parts beside each other as far as there is room, else below each other.
void draw_caption(glm::dvec2 lo, glm::dvec2 size, const std::vector<std::string>& parts, bool fresh) {
    ImDrawList& list = *ImGui::GetWindowDrawList();
    const float room = float(size.x) - ui(32);
    std::vector<std::string> lines;
    for (const std::string& part : parts) {
        const std::string longer = lines.empty() ? part : lines.back() + "   " + part;
        if (lines.empty() || ImGui::CalcTextSize(longer.c_str()).x > room) lines.push_back(part);
        else lines.back() = longer;
    }
    for (std::string& line : lines) line = shortened(line, room, theme().body, theme().body->FontSize);
    const std::string text = join(lines, "\n");
    const ImVec2 extent = ImGui::CalcTextSize(text.c_str());
    const ImVec2 at = im(lo + glm::dvec2(ui(12), size.y - extent.y - ui(10)));
    list.AddRectFilled({at.x - ui(6), at.y - ui(3)}, {at.x + extent.x + ui(6), at.y + extent.y + ui(3)}, IM_COL32(0, 0, 0, 150), ui(4));
    list.AddText(at, fresh ? IM_COL32(205, 210, 218, 255) : theme().warn, text.c_str());
}

std::string text_of(const Table::Cell& cell) {
    if (auto* i = std::get_if<std::int64_t>(&cell)) return std::to_string(*i);
    if (auto* d = std::get_if<double>(&cell)) return fmt::format("{:.5g}", *d);
    return std::get<std::string>(cell);
}

void draw_table(const Table& table, glm::dvec2 lo, glm::dvec2 size) {
    ImGui::SetCursorScreenPos(im(lo + glm::dvec2(ui(8), ui(42))));
    const ImVec2 room{float(size.x) - ui(16), float(size.y) - ui(50)};
    const auto columns = int(std::min<std::size_t>(table.columns.size(), 64));
    if (columns == 0) return say_in(lo, size, "The table has no columns.");
    if (!ImGui::BeginTable("table", columns, ImGuiTableFlags_ScrollX | ImGuiTableFlags_ScrollY | ImGuiTableFlags_RowBg | ImGuiTableFlags_BordersInnerV |
                                                 ImGuiTableFlags_SizingFixedFit, room)) return;
    ImGui::TableSetupScrollFreeze(0, 1);
    for (int c = 0; c < columns; ++c) {
        const Table::Column& column = table.columns[std::size_t(c)];
        ImGui::TableSetupColumn((column.name + (column.unit.empty() ? "" : ", " + column.unit)).c_str());
    }
    ImGui::TableHeadersRow();
    ImGuiListClipper clipper;
    clipper.Begin(int(table.rows.size()));
    while (clipper.Step())
        for (int r = clipper.DisplayStart; r < clipper.DisplayEnd; ++r) {
            ImGui::TableNextRow();
            for (int c = 0; c < columns; ++c) {
                ImGui::TableSetColumnIndex(c);
                ImGui::TextUnformatted(text_of(table.rows[std::size_t(r)][std::size_t(c)]).c_str());
            }
        }
    ImGui::EndTable();
}

std::string why_empty(const Editor& editor, const WireEnd& port) {
    const NodeStatus* status = status_of(editor, port.node);
    if (status && (status->state == NodeState::failed || status->state == NodeState::not_run)) return status->message;
    return editor.live.busy ? "Computing…" : "Nothing here yet.";
}

// For the status line: nothing until it is known, and why where it never will be.
void ask_what_is_seen(Editor& editor, const WireEnd& port, const LiveValue& value, const ImagePtr& image, glm::dvec2 at) {
    const glm::ivec2 pixel(glm::floor(at)), size = image->size();
    if (!value.fresh || pixel.x < 0 || pixel.y < 0 || pixel.x >= size.x || pixel.y >= size.y) return;
    std::optional<PickScene> scene = pick_scene(editor.work.graph(), editor.registry, port.node, editor.live);
    if (!scene) return;
    // What cannot be read by region is loaded once, as long as it is the same one.
    if (const VolumePtr volume = scene->volume; !volume->reads_by_region()) {
        const auto loaded = editor.loaded.find({volume}, [volume](const std::stop_token& stop) { return in_memory(volume, stop); });
        editor.loaded_kept.use(ImGui::GetTime());
        editor.picked = loaded.problem;
        if (!loaded.made) return;
        scene->volume = loaded.made;
    }
    const std::string unit = scene->volume->desc().unit;
    const double number = double(pixel.y) * size.x + pixel.x;
    const auto picked = editor.picks.find({image, {}, number}, [scene = std::move(*scene), pixel, size](const std::stop_token& stop) {
        return pick(scene, pixel, size, stop);
    });
    editor.picked = picked.made ? text_of(*picked.made, unit) : picked.problem;
}

// A rectangle of the window with the pictures `shown` in it: one, or two over each other.
struct Cell {
    glm::dvec2 lo, size;
    std::vector<std::size_t> shown;
};

void draw_cell(Editor& editor, const Cell& cell, const std::vector<WireEnd>& ports) {
    Viewport& view = editor.viewport;
    if (cell.shown.front() >= ports.size()) return say_in(cell.lo, cell.size, "Any picture or table of the graph can be shown here.");
    const WireEnd& port = ports[cell.shown.front()];
    const LiveValue* value = value_at(editor, port);
    if (cell.shown.size() == 1 && value && std::holds_alternative<TablePtr>(value->value))
        return draw_table(*std::get<TablePtr>(value->value), cell.lo, cell.size);

    ImGui::PushID(int(cell.shown.front()));
    ImGui::SetCursorScreenPos(im(cell.lo + glm::dvec2(0, ui(40))));
    ImGui::InvisibleButton("picture", {std::max(float(cell.size.x), 1.f), std::max(float(cell.size.y) - ui(40), 1.f)},
                           ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonMiddle | ImGuiButtonFlags_MouseButtonRight);
    ImGui::PopID();
    const bool hovered = ImGui::IsItemHovered();

    const std::size_t a = cell.shown.front(), b = cell.shown.back();
    std::size_t seen = a;
    const LiveValue* other = value_at(editor, ports[b]);
    std::string why;
    Picture* picture = &view.pictures[a];
    bool there = update_picture(editor, *picture, value);
    const bool other_there = b != a && update_picture(editor, view.pictures[b], other);
    if (view.mode == Mode::difference) {
        there = update_difference(editor, value, other, why);
        picture = &view.difference.picture;
    } else if (view.mode == Mode::flicker && other_there) {
        const double halves = std::floor(2 * ImGui::GetTime());
        if (std::fmod(halves, 2) == 1) seen = b, picture = &view.pictures[b];
        changes_at(editor, (halves + 1) / 2);
    }
    if (!there) return say_in(cell.lo, cell.size, why.empty() ? why_empty(editor, port) : why);

    // Sizes are those that the picture has when it is whole, so that a coarse one takes the same place.
    const glm::dvec2 whole = glm::max(glm::dvec2(whole_size(editor, port, picture->size)), glm::dvec2(1));
    const double fitted = std::min(cell.size.x / whole.x, cell.size.y / whole.y);
    const glm::dvec2 middle = cell.lo + cell.size * 0.5;
    if (view.held == Viewport::Handle::none) handle_mouse(editor, middle, view.zoom > 0 ? view.zoom : fitted, whole.y);
    const double scale = view.zoom > 0 ? view.zoom : fitted;
    const glm::dvec2 half = whole * scale * 0.5, lo = middle + view.offset - half, hi = middle + view.offset + half;
    ImDrawList& list = *ImGui::GetWindowDrawList();
    list.PushClipRect(im(cell.lo), im(cell.lo + cell.size), true);
    list.AddImage(texture_of(*picture), im(lo), im(hi));
    if (view.mode == Mode::wipe && other_there) {
        if (hovered && !ImGui::IsItemActive()) view.wipe = std::clamp((double(ImGui::GetMousePos().x) - lo.x) / (hi.x - lo.x), 0.0, 1.0);
        const double x = lo.x + view.wipe * (hi.x - lo.x);
        list.AddImage(texture_of(view.pictures[b]), im({x, lo.y}), im(hi), {float(view.wipe), 0}, {1, 1});
        list.AddLine(im({x, lo.y}), im({x, hi.y}), theme().accent, std::max(ui(1), 1.f));
    }
    const WireEnd& seen_port = ports[seen];
    const LiveValue& seen_value = seen == a ? *value : *other;
    const Camera* camera = camera_seen(editor, camera_of(editor.work.graph(), editor.registry, seen_port.node));
    draw_plane_gizmo(editor, seen_port, camera, lo, hi, hovered);
    std::vector<std::string> texts{view.mode == Mode::difference ? fmt::format("difference x {:.0f}", view.difference.scale)
                                                                 : caption(editor, seen_port, seen_value, picture->size)};
    // Those that take turns look alike, so that it must be said which one it is.
    if (view.mode == Mode::flicker) texts.insert(texts.begin(), seen_port.node);
    if (hovered && view.mode != Mode::difference) {
        const ImagePtr& image = std::get<ImagePtr>(seen_value.value);
        const glm::dvec2 at = (vec(ImGui::GetMousePos()) - lo) / (hi - lo) * glm::dvec2(image->size());
        for (std::string& part : pixel_texts(*image, at, camera)) texts.push_back(std::move(part));
        ask_what_is_seen(editor, seen_port, seen_value, image, at);
    }
    draw_caption(cell.lo, cell.size, texts, seen_value.fresh);
    list.PopClipRect();
}

// Beside and below each other, so that pictures of this size are shown as large as can be.
std::vector<Cell> grid_of(glm::dvec2 lo, glm::dvec2 size, std::size_t count, glm::dvec2 picture) {
    const double gap = ui(3);
    auto each_of = [&](std::size_t columns) {
        const glm::dvec2 n(double(columns), double((count + columns - 1) / columns));
        return glm::max((size - gap * (n - 1.0)) / n, glm::dvec2(1));
    };
    auto scale_of = [&](std::size_t columns) {
        const glm::dvec2 ratio = each_of(columns) / picture;
        return std::min(ratio.x, ratio.y);
    };
    std::size_t columns = count;
    for (std::size_t fewer = count; fewer-- > 1;)
        if (scale_of(fewer) > scale_of(columns)) columns = fewer;
    std::vector<Cell> cells;
    for (std::size_t k = 0; k < count; ++k)
        cells.push_back({lo + (each_of(columns) + gap) * glm::dvec2(double(k % columns), double(k / columns)), each_of(columns), {k}});
    return cells;
}

bool beside_each_other(Mode mode) { return mode == Mode::two || mode == Mode::four; }

std::vector<Cell> cells_of(const Editor& editor, glm::dvec2 lo, glm::dvec2 size, const std::vector<WireEnd>& ports) {
    const Mode mode = editor.viewport.mode;
    if (!beside_each_other(mode)) {
        std::vector<Cell> cells{{lo, size, {0}}};
        if (mode != Mode::single && ports.size() > 1) cells[0].shown.push_back(1);
        return cells;
    }
    // One more, to choose what is shown in it.
    const std::size_t count = std::min(ports.size() + 1, most_shown(mode));
    return grid_of(lo, size, count, glm::max(glm::dvec2(whole_size(editor, ports.front(), glm::ivec2(1))), glm::dvec2(1)));
}

void draw_port_choices(Editor& editor, const Cell& cell, const std::vector<WireEnd>& ports, double taken) {
    const float width = std::min(ui(200), float(cell.size.x - taken) / float(cell.shown.size()) - ui(10));
    ImGui::SetCursorScreenPos(im(cell.lo + glm::dvec2(ui(8), ui(7))));
    for (std::size_t k : cell.shown) {
        draw_port_choice(editor, k, k < ports.size() ? &ports[k] : nullptr, std::max(width, ui(80)));
        ImGui::SameLine();
    }
}

}  // namespace

void draw_viewport(Editor& editor) {
    const glm::dvec2 lo = vec(ImGui::GetCursorScreenPos()), room = vec(ImGui::GetContentRegionAvail());
    const double strip = compare_strip_height(editor, room.y);
    const glm::dvec2 size = room - glm::dvec2(0, strip);
    ImGui::GetWindowDrawList()->AddRectFilled(im(lo), im(lo + size), theme().dark ? IM_COL32(8, 9, 11, 255) : IM_COL32(40, 43, 48, 255));
    mark(editor, "picture", im(lo), im(lo + size));
    const std::vector<WireEnd> ports = shown_ports(editor);
    if (ports.empty()) return say_in(lo, size, "A node that makes an image shows it here.");
    // Above pictures that share the width there is a bar; else its buttons stand in the picture, beside the lists.
    const Mode mode = editor.viewport.mode;
    const bool beside = beside_each_other(mode);
    const glm::dvec2 bar(0, beside ? ui(36) : 0);
    const std::vector<Cell> cells = cells_of(editor, lo + bar, size - bar, ports);
    for (const Cell& cell : cells) {
        ImGui::GetWindowDrawList()->AddRectFilled(im(cell.lo), im(cell.lo + cell.size), IM_COL32(0, 0, 0, 255));
        draw_cell(editor, cell, ports);
        mark(editor, fmt::format("picture:{}", cell.shown.front()), im(cell.lo), im(cell.lo + cell.size));
    }
    for (const Cell& cell : cells) draw_port_choices(editor, cell, ports, beside ? ui(8) : mode == Mode::difference ? ui(370) : ui(270));
    if (beside) ImGui::SetCursorScreenPos(im(lo + glm::dvec2(ui(8), ui(5))));
    draw_mode_choice(editor);
    ImGui::SameLine();
    button_bar(editor, "more:picture", {button_of(editor, "fit-picture"), button_of(editor, "large")}, float(lo.x + size.x) - ui(8));
    if (strip > 0) draw_compare_strip(editor, lo + glm::dvec2(0, size.y), {size.x, strip});
}

}  // namespace voxloom::editor
