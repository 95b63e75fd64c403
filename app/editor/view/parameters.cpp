// The parameters of the selected node, made from its description alone.
#include <fmt/format.h>
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <cmath>

#include "app/editor/model/knobs.h"
#include "app/editor/model/param_values.h"
#include "app/editor/view/actions.h"
#include "app/editor/view/editor.h"
#include "core/base/error.h"
#include "core/base/text.h"
#include "core/graph/graph_text.h"

namespace voxloom::editor {

namespace {

// The value of a parameter as the document has it, or its default. A text that is no value of it is
// shown as it is, with the reason.
struct Shown {
    ParamValue value;
    bool set = false;
    std::string problem;
};

Shown shown_value(const GraphNode& node, const ParamSpec& spec) {
    const GraphParam* param = find_param(node, spec.key);
    if (!param) return {spec.initial, false, {}};
    std::string reason;
    if (auto value = parse_param(spec, param->yaml, reason)) return {*value, true, {}};
    return {spec.initial, true, reason};
}

std::string text_of(const ParamValue& value) {
    if (auto* text = std::get_if<std::string>(&value)) return *text;
    return to_yaml(value);
}

struct Row {
    Editor& editor;
    const GraphNode& node;
    const ParamSpec& spec;
    Shown shown;
    std::string name() const { return node.id + "." + spec.key; }

    void set(ParamValue value) const {
        if (std::string problem = problem_with(spec, value); !problem.empty())
            return say(editor, fmt::format("{} {}", spec.key, problem), true);
        const std::string id = node.id;  // the edit replaces the graph that `node` is of
        edit(editor, [&] { editor.work.document.set_param(id, spec.key, value); });
    }
};

bool has_slider(const ParamSpec& spec) { return spec.slider_min < spec.slider_max; }

// A number's field: a slider over the soft range where there is one, else a field to drag. Ctrl+click
// types a number, which may lie outside of the soft range, but not of the hard one.
bool number_field(const char* label, const ParamSpec& spec, double& v, bool whole) {
    const char* format = whole ? "%.0f" : "%.5g";
    if (has_slider(spec)) {
        ImGuiSliderFlags flags = spec.scale == Scale::logarithmic ? ImGuiSliderFlags_Logarithmic : 0;
        double lo = spec.slider_min, hi = spec.slider_max;
        return ImGui::SliderScalar(label, ImGuiDataType_Double, &v, &lo, &hi, format, flags);
    }
    const float speed = whole ? 0.2f : float(std::max(std::abs(v), 1.0) * 0.005);
    return ImGui::DragScalar(label, ImGuiDataType_Double, &v, speed, nullptr, nullptr, format);
}

// Inside the hard range and whole where it must be: what a drag gives is mended, not refused.
double mended(const ParamSpec& spec, double v, bool whole) {
    if (whole) v = std::round(v);
    return std::clamp(v, spec.min, spec.max);
}

void draw_number(const Row& row, bool whole) {
    double v = std::holds_alternative<std::int64_t>(row.shown.value) ? double(std::get<std::int64_t>(row.shown.value))
                                                                     : std::get<double>(row.shown.value);
    const double before = v;
    if (!number_field("##value", row.spec, v, whole)) return;
    v = mended(row.spec, v, whole);
    if (v == before || std::isnan(v)) return;
    if (whole)
        row.set(std::int64_t(v));
    else
        row.set(v);
}

void draw_vector(const Row& row) {
    std::vector<double> v = std::get<std::vector<double>>(row.shown.value);
    const float gap = ImGui::GetStyle().ItemInnerSpacing.x;
    const std::size_t columns = v.size() == 4 ? 4 : std::min<std::size_t>(v.size(), 3);
    const float width = (ImGui::CalcItemWidth() - gap * float(columns - 1)) / float(std::max<std::size_t>(columns, 1));
    bool changed = false;
    for (std::size_t i = 0; i < v.size(); ++i) {
        if (i % columns) ImGui::SameLine(0, gap);
        ImGui::PushID(int(i));
        ImGui::SetNextItemWidth(width);
        double now = v[i];
        if (number_field("##value", row.spec, now, row.spec.integral)) {
            now = mended(row.spec, now, row.spec.integral);
            changed = changed || now != v[i];
            v[i] = now;
        }
        mark(row.editor, fmt::format("param:{}.{}", row.name(), i));
        ImGui::PopID();
    }
    if (changed) row.set(v);
}

void draw_color(const Row& row) {
    const auto& v = std::get<std::vector<double>>(row.shown.value);
    float c[3] = {float(v[0]), float(v[1]), float(v[2])};
    if (!ImGui::ColorEdit3("##value", c, ImGuiColorEditFlags_Float)) return;
    // Four digits are more than a screen shows, and read better in the file.
    auto rounded = [](float x) { return std::round(std::clamp(double(x), 0.0, 1.0) * 1e4) / 1e4; };
    row.set(std::vector<double>{rounded(c[0]), rounded(c[1]), rounded(c[2])});
}

void draw_choice(const Row& row) {
    const std::string now = text_of(row.shown.value);
    if (!ImGui::BeginCombo("##value", now.c_str(), ImGuiComboFlags_HeightLarge)) return;
    std::string chosen = now;
    for (const std::string& choice : row.spec.choices) {
        if (ImGui::Selectable(choice.c_str(), choice == now)) chosen = choice;
        mark(row.editor, "choice:" + choice);
    }
    ImGui::EndCombo();
    if (chosen != now) row.set(chosen);
}

// Texts, paths and lists are typed, and taken when the field is left.
void draw_text(const Row& row) {
    const bool plain = std::holds_alternative<std::string>(row.shown.value);
    const GraphParam* param = find_param(row.node, row.spec.key);
    const std::string now = !row.shown.problem.empty() && param ? to_text(param->yaml) : text_of(row.shown.value);
    const std::string name = row.name();
    auto typed = row.editor.texts.find(name);
    std::string text = typed != row.editor.texts.end() ? typed->second : now;
    ImGui::InputText("##value", &text);
    if (ImGui::IsItemActive()) {
        row.editor.texts[name] = text;
        return;
    }
    if (typed == row.editor.texts.end()) return;
    const std::string entered = typed->second;
    row.editor.texts.erase(typed);
    if (entered == now) return;
    if (plain) return row.set(entered);
    GraphParam::Yaml yaml;
    std::string reason = "must be a list such as [1, 2]";
    if (parse_yaml_value(entered, yaml))
        if (auto value = parse_param(row.spec, yaml, reason)) return row.set(*value);
    say(row.editor, row.spec.key + " " + reason, true);
}

void draw_path(const Row& row) {
    const float button = ImGui::GetFrameHeight() + ui(4), gap = ImGui::GetStyle().ItemInnerSpacing.x;
    ImGui::SetNextItemWidth(ImGui::CalcItemWidth() - button - gap);
    Editor& editor = row.editor;
    const std::string id = row.node.id, key = row.spec.key;
    draw_text(row);  // may replace the graph that row.node is of
    mark(editor, "param:" + id + "." + key);
    ImGui::SameLine(0, gap);
    if (ImGui::Button("…", {button, 0})) {
        const std::filesystem::path folder = editor.work.graph().folder();
        open_file_dialog(editor, FileDialog::Purpose::parameter, folder / text_of(row.shown.value),
                         [&editor, id, key](const std::filesystem::path& file) {
                             // Relative where it lies below the graph, so that the folder can be moved.
                             const auto relative = file.lexically_proximate(editor.work.graph().folder());
                             const bool below = !editor.work.file.empty() && relative.string().substr(0, 2) != "..";
                             edit(editor, [&] { editor.work.document.set_param(id, key, below ? relative.string() : file.string()); });
                         });
    }
    tooltip("Choose a file.");
}

void draw_value(const Row& row) {
    switch (row.spec.kind) {
        case ParamKind::boolean: {
            bool on = std::get<bool>(row.shown.value);
            if (ImGui::Checkbox("##value", &on)) row.set(on);
            return;
        }
        case ParamKind::integer: return draw_number(row, true);
        case ParamKind::real: return draw_number(row, false);
        case ParamKind::choice: return draw_choice(row);
        case ParamKind::vector: return draw_vector(row);
        case ParamKind::color: return draw_color(row);
        case ParamKind::path_in:
        case ParamKind::path_out: return draw_path(row);
        case ParamKind::text:
        case ParamKind::list:
        case ParamKind::rows:
        case ParamKind::texts: return draw_text(row);
    }
}

// Where it may lie. Bounds beyond all use are there for arithmetic's sake, and tell nobody anything.
std::string range_text(const ParamSpec& spec) {
    const bool least = spec.min > -1e100 && (spec.min == 0 || std::abs(spec.min) > 1e-100), most = spec.max < 1e100;
    if (least && most) return fmt::format("{} to {}", shortest(spec.min), shortest(spec.max));
    if (least) return "at least " + shortest(spec.min);
    return most ? "at most " + shortest(spec.max) : "";
}

std::string spec_tooltip(const Row& row) {
    const ParamSpec& spec = row.spec;
    std::string text = spec.doc;
    std::vector<std::string> facts{"default " + to_yaml(spec.initial)};
    if (std::string range = range_text(spec); !range.empty()) facts.push_back(std::move(range));
    if (!spec.unit.empty()) facts.push_back("in " + spec.unit);
    if (spec.quality) facts.emplace_back("trades speed for error");
    if (spec.affects == Affects::cost) facts.emplace_back("changes the cost only, not the result");
    return text + "\n" + join(facts, ", ") + "\nRight click: reset, or copy as --set.";
}

void draw_row(Editor& editor, const std::string& id, const ParamSpec& spec) {
    const GraphNode* node = editor.work.graph().find(id);
    if (!node) return;
    Row row{editor, *node, spec, shown_value(*node, spec)};
    const Theme& t = theme();
    ImGui::PushID(spec.key.c_str());
    const float left = ImGui::GetCursorPosX();
    const float full = ImGui::GetContentRegionAvail().x, label = std::clamp(full * 0.38f, ui(90), ui(190));
    std::string title = spec.key;
    std::replace(title.begin(), title.end(), '_', ' ');
    if (!spec.unit.empty() && spec.unit.size() < 9) title += ", " + spec.unit;
    if (spec.quality) title += " ◆";
    const std::string cut = shortened(title, label - ui(8), t.body, t.body->FontSize);
    // All of the room beside the value is the name's.
    const ImVec2 at = ImGui::GetCursorScreenPos();
    ImGui::GetWindowDrawList()->AddText({at.x, at.y + ImGui::GetStyle().FramePadding.y},
                                        !row.shown.problem.empty() ? t.bad : row.shown.set ? t.text : t.muted, cut.c_str());
    ImGui::InvisibleButton("name", {label - ui(8), ImGui::GetFrameHeight()});
    mark(editor, "name:" + row.name());
    tooltip(spec_tooltip(row));
    if (ImGui::BeginPopupContextItem("more")) {
        if (ImGui::MenuItem("Reset", nullptr, false, row.shown.set)) edit(editor, [&] { editor.work.document.reset_param(id, spec.key); });
        if (ImGui::MenuItem("Copy as --set")) {
            const bool list = spec.kind >= ParamKind::vector;
            const std::string value = list ? to_yaml(row.shown.value) : text_of(row.shown.value);
            ImGui::SetClipboardText(fmt::format("--set '{}={}'", row.name(), value).c_str());
            say(editor, "Copied");
        }
        ImGui::EndPopup();
    }
    ImGui::SameLine(left + label);
    const float reset = ImGui::GetFrameHeight();
    ImGui::BeginGroup();
    ImGui::PushItemWidth(full - label - reset - ImGui::GetStyle().ItemSpacing.x);
    const bool path = spec.kind == ParamKind::path_in || spec.kind == ParamKind::path_out;
    const std::string name = "param:" + row.name();
    const bool set = row.shown.set;
    const std::string problem = row.shown.problem;
    draw_value(row);  // may replace the graph: `node` and `row` are not looked at any more
    ImGui::PopItemWidth();
    ImGui::EndGroup();
    if (!path) mark(editor, name);
    if (ImGui::IsItemActive()) editor.moving = ImGui::IsMouseDown(ImGuiMouseButton_Left);
    if (set) {
        ImGui::SameLine(left + full - reset);
        ImGui::PushStyleColor(ImGuiCol_Button, ImVec4(0, 0, 0, 0));
        if (ImGui::Button("↺", {reset, reset})) edit(editor, [&] { editor.work.document.reset_param(id, spec.key); });
        ImGui::PopStyleColor();
        mark(editor, "reset:" + id + "." + spec.key);
        tooltip("Back to the default, " + to_yaml(spec.initial) + ".");
    }
    if (!problem.empty()) wrapped_in(t.bad, spec.key + " " + problem);
    ImGui::PopID();
}

// The node's name, which may be changed, and what it is.
void draw_heading(Editor& editor, const std::string& id, const NodeType* type) {
    const Theme& t = theme();
    if (editor.id_of != id) {
        editor.id_of = id;
        editor.id_text = id;
    }
    ImGui::PushFont(t.title);
    ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
    ImGui::PushStyleColor(ImGuiCol_FrameBg, ImVec4(0, 0, 0, 0));
    ImGui::InputText("##id", &editor.id_text);
    ImGui::PopStyleColor();
    ImGui::PopFont();
    mark(editor, "id");
    tooltip("The node's name: lower-case letters, digits, '_' and '-'.");
    if (ImGui::IsItemDeactivatedAfterEdit() && editor.id_text != id) {
        const std::string to = editor.id_text;
        edit(editor, [&] {
            rename_node(editor.work, id, to);
        });
        editor.id_of.clear();
    }
    if (!type) return wrapped_in(t.bad, "This kind of node is not known here; it is kept as it is.");
    wrapped_in(t.muted, type->title + ". " + type->doc);
}

void draw_state(Editor& editor, const std::string& id) {
    const NodeStatus* status = status_of(editor, id);
    if (!status) return;
    const Theme& t = theme();
    if (!status->message.empty()) wrapped_in(status->state == NodeState::failed ? t.bad : t.warn, status->message);
    for (const std::string& warning : status->warnings) wrapped_in(t.warn, warning);
}

// Buttons side by side, in as many rows as they need.
void draw_action_row(Editor& editor, const std::vector<const char*>& ids) {
    const float end = ImGui::GetCursorScreenPos().x + ImGui::GetContentRegionAvail().x;
    for (std::size_t i = 0; i < ids.size(); ++i) {
        const float width = ImGui::CalcTextSize(action(ids[i]).title).x + 2 * ImGui::GetStyle().FramePadding.x;
        if (i > 0 && ImGui::GetItemRectMax().x + ImGui::GetStyle().ItemSpacing.x + width < end) ImGui::SameLine();
        action_button(editor, ids[i]);
    }
}

void draw_measurements(Editor& editor, const std::string& id) {
    const NodeStatus* status = status_of(editor, id);
    if (!status || status->measurements.empty()) return;
    const Theme& t = theme();
    ImGui::Dummy({0, ui(2)});
    text_in(t.accent, "Measured");
    ImGui::Separator();
    for (const auto& [name, m] : status->measurements) {
        std::string title = name;
        std::replace(title.begin(), title.end(), '_', ' ');
        text_in(t.muted, title.c_str());
        ImGui::SameLine(ui(190));
        ImGui::TextUnformatted(fmt::format("{:.5g} {}", m.first, m.second).c_str());
    }
}

void draw_groups(Editor& editor, const std::string& id, const NodeType& type) {
    std::vector<std::string> groups;
    for (const ParamSpec& spec : type.params)
        if (std::find(groups.begin(), groups.end(), spec.group) == groups.end()) groups.push_back(spec.group);
    std::stable_partition(groups.begin(), groups.end(), [](const std::string& g) { return g.empty(); });
    bool experts = false;
    for (const std::string& group : groups) {
        std::vector<const ParamSpec*> rows;
        const GraphNode* node = editor.work.graph().find(id);
        if (!node) return;
        for (const ParamSpec& spec : type.params) {
            if (spec.group != group || !is_in_use(*node, type, spec)) continue;
            experts = experts || spec.expert;
            if (!spec.expert || editor.show_expert || find_param(*node, spec.key)) rows.push_back(&spec);
        }
        if (rows.empty()) continue;
        if (!group.empty()) {
            ImGui::Dummy({0, ui(2)});
            text_in(theme().accent, group.c_str());
            ImGui::Separator();
        }
        for (const ParamSpec* spec : rows) draw_row(editor, id, *spec);
    }
    if (!experts) return;
    ImGui::Dummy({0, ui(2)});
    if (ImGui::Button(editor.show_expert ? "Fewer parameters" : "Parameters for experts…")) editor.show_expert = !editor.show_expert;
    tooltip(action("expert").doc);
    mark(editor, "expert");
}

void draw_outputs(Editor& editor, const std::string& id, const NodeType& type) {
    if (type.outputs.empty()) return;
    ImGui::Dummy({0, ui(2)});
    text_in(theme().accent, "Results of the graph");
    ImGui::Separator();
    for (const PortSpec& port : type.outputs) {
        const WireEnd end{id, port.key, {}};
        bool on = is_output(editor.work.graph(), end);
        if (ImGui::Checkbox(port.key.c_str(), &on)) edit(editor, [&] { set_output(editor.work, end, on); });
        mark(editor, "output:" + id + "." + port.key);
        tooltip(port.doc + "\nMarked outputs are what the graph is run for; without any, all that nobody takes.");
    }
}

// What trades speed for error, in the nodes that are selected, or else in those that make what is looked at.
void update_knobs(Editor& editor) {
    KnobList& list = editor.knobs;
    const Graph& graph = editor.work.graph();
    const std::vector<std::string> selected(editor.work.selected.begin(), editor.work.selected.end());
    const std::vector<WireEnd> shown = selected.empty() ? shown_ports(editor) : std::vector<WireEnd>();
    if (list.text == editor.work.document.text() && list.selected == selected && list.all == editor.show_expert &&
        std::ranges::equal(list.shown, shown, same_end)) return;
    list.text = editor.work.document.text(), list.selected = selected, list.shown = shown, list.all = editor.show_expert;
    list.knobs = knobs_of(graph, editor.registry, selected.empty() ? nodes_of(graph, shown) : selected, editor.show_expert);
}

void draw_knobs(Editor& editor) {
    constexpr std::size_t kMost = 40;
    update_knobs(editor);
    const std::vector<Knob>& knobs = editor.knobs.knobs;
    if (knobs.empty()) return;
    ImGui::Dummy({0, ui(2)});
    text_in(theme().accent, "Speed against error");
    tooltip("The parameters that trade one for the other, of the selected nodes, or of all that make what is shown.");
    ImGui::Separator();
    for (std::size_t i = 0; i < std::min(knobs.size(), kMost); ++i) {
        const std::string& id = knobs[i].node;
        ImGui::PushID(id.c_str());
        if (i == 0 || knobs[i - 1].node != id) {
            text_in(theme().text, id.c_str());
            if (ImGui::IsItemClicked()) editor.work.selected = {id};
            mark(editor, "knobs:" + id);
            tooltip("Click: selects the node, to see all its parameters.");
        }
        draw_row(editor, id, *knobs[i].spec);
        ImGui::PopID();
    }
    if (knobs.size() > kMost) wrapped_in(theme().muted, fmt::format("And {} more; select the nodes that are of interest.", knobs.size() - kMost));
}

}  // namespace

void draw_parameters(Editor& editor) {
    const GraphNode* node = editor.work.single();
    if (!node) {
        const std::size_t n = editor.work.selected.size();
        wrapped_in(theme().muted, n == 0 ? "Select a node to see its parameters." : fmt::format("{} nodes are selected.", n));
        if (n == 0) draw_action_row(editor, {"comment"});
        else draw_action_row(editor, {"bypass", "disable", "group", "ungroup", "align", "duplicate", "delete"});
        return draw_knobs(editor);
    }
    const std::string id = node->id;
    const NodeType* type = editor.registry.find(node->type);
    ImGui::PushID(id.c_str());
    draw_heading(editor, id, type);
    draw_state(editor, id);
    draw_action_row(editor, {"bypass", "disable", "group", "ungroup", "duplicate", "delete"});
    node = editor.work.graph().find(id);
    if (!node) return ImGui::PopID();
    ImGui::Dummy({0, ui(2)});
    if (type) {
        if (has_transfer_editor(*type)) draw_transfer_editor(editor, id, *type);
        draw_groups(editor, id, *type);
        if (editor.work.graph().find(id)) draw_outputs(editor, id, *type);
        draw_measurements(editor, id);
    } else {
        for (const GraphParam& param : node->params) {
            text_in(theme().muted, param.key.c_str());
            ImGui::SameLine(ui(150));
            ImGui::TextUnformatted(to_text(param.yaml).c_str());
        }
    }
    ImGui::PopID();
}

}  // namespace voxloom::editor
