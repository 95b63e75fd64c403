// Below compared pictures: the numbers of their branches, and a plot of all the settings that were tried, to go
// back to any of them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "app/editor/view/actions.h"
#include "app/editor/view/compare_strip.h"
#include "core/base/error.h"
#include "core/base/text.h"

namespace voxloom::editor {

ImU32 color_of_branch(std::size_t k) {
    const Theme& t = theme();
    const ImU32 colors[] = {t.accent, t.warn, t.good, t.bad};
    return colors[k % 4];
}

void say_at(ImVec2 at, ImU32 color, const std::string& text, double width) {
    const std::string cut = shortened(text, ui(width), theme().body, ui(kStripText));
    ImGui::GetWindowDrawList()->AddText(theme().body, ui(kStripText), at, color, cut.c_str());
}

namespace {

constexpr double kText = kStripText, kLine = kStripLine, kButtons = 26;

// Time against error, over the range of what was tried.
struct Plot {
    ImVec2 lo, hi;
    double t0 = 0, t1 = 1, p0 = 0, p1 = 1;  // log10 of seconds, decibels
    double exact = 1;                       // where what is without error stands: a little above all others

    double finite(double psnr) const { return std::min(psnr, exact); }
    ImVec2 place(const Tried& t) const {
        const double x = (std::log10(std::max(t.seconds, 1e-9)) - t0) / (t1 - t0), y = (finite(t.psnr) - p0) / (p1 - p0);
        return {lo.x + float(x) * (hi.x - lo.x), hi.y - float(y) * (hi.y - lo.y)};
    }
};

Plot plot_of(const std::vector<Tried>& tried, ImVec2 lo, ImVec2 hi) {
    Plot plot{lo, hi};
    if (tried.empty()) return plot;
    plot.exact = 0;
    for (const Tried& t : tried)
        if (std::isfinite(t.psnr)) plot.exact = std::max(plot.exact, t.psnr + 6);
    plot.t0 = plot.p0 = 1e300;
    plot.t1 = plot.p1 = -1e300;
    for (const Tried& t : tried) {
        const double x = std::log10(std::max(t.seconds, 1e-9)), y = plot.finite(t.psnr);
        plot.t0 = std::min(plot.t0, x), plot.t1 = std::max(plot.t1, x);
        plot.p0 = std::min(plot.p0, y), plot.p1 = std::max(plot.p1, y);
    }
    const double dt = std::max((plot.t1 - plot.t0) * 0.08, 0.05), dp = std::max((plot.p1 - plot.p0) * 0.08, 0.5);
    plot.t0 -= dt, plot.t1 += dt, plot.p0 -= dp, plot.p1 += dp;
    return plot;
}

std::string text_of(const Tried& t) {
    std::string text = fmt::format("{}: {}, {}", t.codec, human_seconds(t.seconds), std::isfinite(t.psnr) ? fmt::format("{:.4g} dB", t.psnr) : "without error");
    for (const GraphParam& param : t.params)
        if (param.yaml.kind != GraphParam::Yaml::Kind::list) text += fmt::format("\n{}: {}", param.key, param.yaml.text);
    return text + "\nClick: back to these parameters.";
}

void draw_tried(Editor& editor, const std::vector<Branch>& branches, ImVec2 lo, ImVec2 hi) {
    ImDrawList& list = *ImGui::GetWindowDrawList();
    const Theme& t = theme();
    list.AddRectFilled(lo, hi, t.canvas, ui(4));
    const Plot plot = plot_of(editor.tried, {lo.x + ui(34), lo.y + ui(8)}, {hi.x - ui(8), hi.y - ui(20)});
    list.AddRect(plot.lo, plot.hi, faded(t.border, 0.6f));
    say_at({lo.x + ui(3), plot.lo.y}, t.muted, editor.tried.empty() ? "dB" : fmt::format("{:.0f}", plot.p1), 30);
    say_at({lo.x + ui(3), plot.hi.y - ui(kText)}, t.muted, editor.tried.empty() ? "" : fmt::format("{:.0f}", plot.p0), 30);
    const std::string right = editor.tried.empty() ? "" : human_seconds(std::pow(10, plot.t1));
    say_at({plot.lo.x, plot.hi.y + ui(3)}, t.muted, editor.tried.empty() ? "time" : human_seconds(std::pow(10, plot.t0)), 60);
    const float width = t.body->CalcTextSizeA(ui(kText), FLT_MAX, 0, right.c_str()).x;
    say_at({plot.hi.x - width, plot.hi.y + ui(3)}, t.muted, right, 60);
    say_at({plot.lo.x + ui(6), plot.hi.y - ui(kText + 4)}, faded(t.muted, 0.8f), "dB, encode time", double(plot.hi.x - plot.lo.x) / double(t.scale) - 10);

    ImGui::SetCursorScreenPos(lo);
    const bool clicked = ImGui::InvisibleButton("tried", {std::max(hi.x - lo.x, 1.f), std::max(hi.y - lo.y, 1.f)});
    int near = -1;
    double best = ui(9);
    for (std::size_t i = 0; i < editor.tried.size(); ++i) {
        const Tried& tried = editor.tried[i];
        const auto branch = std::ranges::find_if(branches, [&](const Branch& b) { return b.codec == tried.codec; });
        const ImVec2 p = plot.place(tried);
        const NodeStatus* status = status_of(editor, tried.codec);
        const bool now = status && status->key == tried.key;
        const ImU32 color = branch == branches.end() ? t.muted : color_of_branch(std::size_t(branch - branches.begin()));
        list.AddCircleFilled(p, ui(now ? 5 : 3.5), color, 12);
        if (now) list.AddCircle(p, ui(7), t.text, 16);
        mark(editor, fmt::format("tried:{}", i), {p.x - ui(4), p.y - ui(4)}, {p.x + ui(4), p.y + ui(4)});
        if (const double d = glm::distance(vec(p), vec(ImGui::GetMousePos())); ImGui::IsItemHovered() && d < best) best = d, near = int(i);
    }
    if (near < 0) return tooltip("Every setting that was looked at: the time of encoding against the error of the volume.");
    const Tried chosen = editor.tried[std::size_t(near)];
    ImGui::SetTooltip("%s", text_of(chosen).c_str());
    if (clicked) edit(editor, [&] { bring_back(editor.work.document, chosen, editor.registry); });
}

void draw_buttons(Editor& editor, const std::vector<Branch>& branches, float right) {
    const Action& numbers = action("numbers");
    if (ImGui::Button(editor.viewport.numbers ? "Hide numbers" : "Show numbers")) numbers.run(editor);
    mark(editor, "numbers");
    tooltip(fmt::format("{}  ({})", numbers.doc, key_text(numbers)));
    ImGui::SameLine();
    if (editor.viewport.numbers) {
        draw_against(editor);
        ImGui::SameLine();
    }
    if (editor.sweep) {
        const std::string text = fmt::format("Stop, {} of {}", std::min(editor.sweep->next, editor.sweep->values.size()), editor.sweep->values.size());
        if (ImGui::Button(text.c_str())) editor.sweep.reset();
        mark(editor, "sweep-stop");
        return;
    }
    std::vector<BarButton> sweeps;
    std::set<std::string> codecs;
    for (const Branch& branch : branches) {
        if (branch.codec.empty() || !codecs.insert(branch.codec).second) continue;
        const std::optional<Sweep> sweep = sweep_of(editor.work.graph(), editor.registry, branch.codec);
        const std::string doc = sweep ? fmt::format("Tries {} values of {}; the graph stays as it is.", sweep->values.size(), sweep->param)
                                      : "It has no parameter in use that trades speed for error.";
        sweeps.push_back({"Sweep " + branch.codec, "", doc, "sweep:" + branch.codec, sweep.has_value(),
                          [&editor, sweep] { editor.sweep = sweep, editor.viewport.numbers = true; }});
    }
    button_bar(editor, "more:sweeps", sweeps, right);
}

}  // namespace

double compare_strip_height(const Editor& editor, double room) {
    if (editor.viewport.mode == Viewport::Mode::single) return 0;
    // The pictures keep more than half of the height.
    const double buttons = double(ui(kButtons)), all = buttons + double(ui(kNumberRows * kLine + 6));
    return editor.viewport.numbers && room > 2 * all ? all : room > 4 * buttons ? buttons : 0;
}

void draw_compare_strip(Editor& editor, glm::dvec2 lo, glm::dvec2 size) {
    const std::vector<Branch>& branches = editor.branches;
    ImGui::GetWindowDrawList()->AddRectFilled(im(lo), im(lo + size), theme().panel);
    ImGui::SetCursorScreenPos(im(lo + glm::dvec2(ui(8), ui(2))));
    ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, ImVec2(ui(7), ui(2)));
    draw_buttons(editor, branches, float(lo.x + size.x) - ui(8));
    ImGui::PopStyleVar();
    if (size.y < double(ui(kButtons + kLine))) return;
    const glm::dvec2 table = lo + glm::dvec2(ui(10), ui(kButtons));
    draw_numbers(editor, im(table));
    const double left = lo.x + double(ui(numbers_width(branches.size()) + 16));
    if (left + double(ui(110)) > lo.x + size.x) return;  // no room for a plot
    draw_tried(editor, branches, {float(left), float(table.y)}, {float(lo.x + size.x - ui(8)), float(lo.y + size.y - ui(6))});
}

}  // namespace voxloom::editor
