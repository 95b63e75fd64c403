#include "app/editor/view/button_bar.h"

#include <fmt/format.h>

namespace voxloom::editor {

namespace {

constexpr const char* kMore = "»";

float width_of(const std::string& title) { return ImGui::CalcTextSize(title.c_str()).x + 2 * ImGui::GetStyle().FramePadding.x; }
float gap_before(const BarButton& button) { return ImGui::GetStyle().ItemSpacing.x + (button.apart ? ui(14) : 0); }

std::string tip_of(const BarButton& button) { return button.key.empty() ? button.doc : fmt::format("{}  ({})", button.doc, button.key); }

// How many fit from x on, with the menu's button behind them where they are not all.
std::size_t fitting(const std::vector<BarButton>& buttons, float x, float right) {
    const float more = ImGui::GetStyle().ItemSpacing.x + width_of(kMore);
    std::size_t count = 0;
    for (std::size_t i = 0; i < buttons.size(); ++i) {
        x += (i > 0 ? gap_before(buttons[i]) : 0) + width_of(buttons[i].title);
        if (x + more <= right) count = i + 1;
    }
    return x <= right ? buttons.size() : count;
}

void draw_menu(Editor& editor, const std::string& name, const std::vector<BarButton>& buttons, std::size_t from) {
    ImGui::PushID(name.c_str());
    if (ImGui::Button(kMore)) ImGui::OpenPopup("more");
    mark(editor, name);
    tooltip("What there is no room for.");
    if (ImGui::BeginPopup("more")) {
        for (std::size_t i = from; i < buttons.size(); ++i) {
            if (i > from && buttons[i].apart) ImGui::Separator();
            if (ImGui::MenuItem(buttons[i].title.c_str(), buttons[i].key.c_str(), false, buttons[i].possible)) buttons[i].run();
            mark(editor, buttons[i].name);
            tooltip(buttons[i].doc);
        }
        ImGui::EndPopup();
    }
    ImGui::PopID();
}

}  // namespace

void draw_button(Editor& editor, const BarButton& button) {
    ImGui::BeginDisabled(!button.possible);
    if (ImGui::Button(button.title.c_str())) button.run();
    ImGui::EndDisabled();
    mark(editor, button.name);
    tooltip(tip_of(button));
}

void button_bar(Editor& editor, const char* name, const std::vector<BarButton>& buttons, float right) {
    const std::size_t shown = fitting(buttons, ImGui::GetCursorScreenPos().x, right);
    for (std::size_t i = 0; i < shown; ++i) {
        if (i > 0) ImGui::SameLine(0, gap_before(buttons[i]));
        draw_button(editor, buttons[i]);
    }
    if (shown == buttons.size()) return;
    if (shown > 0) ImGui::SameLine();
    draw_menu(editor, name, buttons, shown);
}

}  // namespace voxloom::editor
