#include "app/editor/view/theme.h"

#include <cfloat>
#include <cmath>
#include <filesystem>
#include <string>

namespace voxloom::editor {

namespace {

Theme current;

constexpr ImU32 rgb(unsigned hex, unsigned alpha = 255) {
    return IM_COL32(hex >> 16 & 255, hex >> 8 & 255, hex & 255, alpha);
}

void dark_colors() {
    current.canvas = rgb(0x15171b);
    current.grid = rgb(0x23262c);
    current.panel = rgb(0x1c1f24);
    current.node = rgb(0x292d34);
    current.header = rgb(0x343a43);
    current.border = rgb(0x444b56);
    current.text = rgb(0xdde1e7);
    current.muted = rgb(0x949ba7);
    current.accent = rgb(0x5aa9e6);
    current.good = rgb(0x7fc98b);
    current.warn = rgb(0xe9b44c);
    current.bad = rgb(0xec6a6a);
}

void light_colors() {
    current.canvas = rgb(0xf1f2f4);
    current.grid = rgb(0xdfe2e6);
    current.panel = rgb(0xfafbfc);
    current.node = rgb(0xffffff);
    current.header = rgb(0xe6e9ee);
    current.border = rgb(0xb9c0ca);
    current.text = rgb(0x22262c);
    current.muted = rgb(0x666e7a);
    current.accent = rgb(0x1f78c1);
    current.good = rgb(0x2f8a46);
    current.warn = rgb(0xa86a00);
    current.bad = rgb(0xc23434);
}

ImVec4 v4(ImU32 color) { return ImGui::ColorConvertU32ToFloat4(color); }
ImVec4 mixed(ImU32 a, ImU32 b, float t) {
    const ImVec4 x = v4(a), y = v4(b);
    return {x.x + (y.x - x.x) * t, x.y + (y.y - x.y) * t, x.z + (y.z - x.z) * t, 1};
}

void style_widgets() {
    ImGuiStyle& style = ImGui::GetStyle();
    style = ImGuiStyle();
    current.dark ? ImGui::StyleColorsDark() : ImGui::StyleColorsLight();
    style.WindowRounding = 0;
    style.ChildRounding = 4;
    style.FrameRounding = 4;
    style.PopupRounding = 6;
    style.GrabRounding = 4;
    style.ScrollbarRounding = 6;
    style.ScrollbarSize = 11;
    style.WindowPadding = {12, 10};
    style.FramePadding = {8, 4};
    style.ItemSpacing = {8, 6};
    style.ItemInnerSpacing = {6, 4};
    style.WindowBorderSize = 0;
    style.PopupBorderSize = 1;
    style.ScaleAllSizes(current.scale);
    ImVec4* c = style.Colors;
    c[ImGuiCol_Text] = v4(current.text);
    c[ImGuiCol_TextDisabled] = v4(current.muted);
    c[ImGuiCol_WindowBg] = v4(current.panel);
    c[ImGuiCol_ChildBg] = ImVec4(0, 0, 0, 0);
    c[ImGuiCol_PopupBg] = mixed(current.panel, current.node, 0.6f);
    c[ImGuiCol_Border] = v4(current.border);
    c[ImGuiCol_Separator] = mixed(current.panel, current.border, 0.6f);
    c[ImGuiCol_FrameBg] = mixed(current.panel, current.header, 0.8f);
    c[ImGuiCol_FrameBgHovered] = mixed(current.header, current.accent, 0.15f);
    c[ImGuiCol_FrameBgActive] = mixed(current.header, current.accent, 0.25f);
    c[ImGuiCol_Button] = mixed(current.panel, current.header, 0.9f);
    c[ImGuiCol_ButtonHovered] = mixed(current.header, current.accent, 0.3f);
    c[ImGuiCol_ButtonActive] = mixed(current.header, current.accent, 0.5f);
    c[ImGuiCol_Header] = mixed(current.panel, current.accent, 0.25f);
    c[ImGuiCol_HeaderHovered] = mixed(current.panel, current.accent, 0.35f);
    c[ImGuiCol_HeaderActive] = mixed(current.panel, current.accent, 0.45f);
    c[ImGuiCol_SliderGrab] = mixed(current.header, current.accent, 0.8f);
    c[ImGuiCol_SliderGrabActive] = v4(current.accent);
    c[ImGuiCol_CheckMark] = v4(current.accent);
    c[ImGuiCol_ScrollbarBg] = ImVec4(0, 0, 0, 0);
    c[ImGuiCol_ScrollbarGrab] = v4(current.border);
    c[ImGuiCol_ModalWindowDimBg] = ImVec4(0, 0, 0, 0.45f);
}

// DejaVu Sans where it is installed, for it has arrows, Greek and mathematics; else ImGui's own.
ImFont* load_font(const char* name, float size) {
    static const ImWchar ranges[] = {0x20, 0x24f, 0x370, 0x3ff, 0x400, 0x4ff, 0x2010, 0x203a, 0x2070, 0x209f,
                                     0x2190, 0x21ff, 0x2200, 0x22ff, 0x25a0, 0x25ff, 0x2713, 0x2717, 0};
    const std::string file = std::string("/usr/share/fonts/truetype/dejavu/") + name;
    ImFontAtlas& fonts = *ImGui::GetIO().Fonts;
    std::error_code error;
    if (std::filesystem::exists(file, error))
        if (ImFont* font = fonts.AddFontFromFileTTF(file.c_str(), size, nullptr, ranges)) return font;
    ImFontConfig config;
    config.SizePixels = size;
    return fonts.AddFontDefault(&config);
}

}  // namespace

const Theme& theme() { return current; }

bool apply_theme(bool dark, float scale) {
    const bool fonts = !current.body || scale != current.scale;
    current.dark = dark;
    current.scale = scale;
    dark ? dark_colors() : light_colors();
    style_widgets();
    if (!fonts) return false;
    ImGui::GetIO().Fonts->Clear();
    current.body = load_font("DejaVuSans.ttf", std::round(14 * scale));
    current.title = load_font("DejaVuSans-Bold.ttf", std::round(20 * scale));
    current.mono = load_font("DejaVuSansMono.ttf", std::round(13 * scale));
    return true;
}

ImU32 color_of(PortType type) {
    static constexpr ImU32 dark[kPortTypes] = {
        rgb(0x6cb2eb), rgb(0x63c7b2), rgb(0xf2a65a), rgb(0xb8c26b), rgb(0xe57399),
        rgb(0xc792ea), rgb(0x8bd17c), rgb(0xf6d55c), rgb(0xef6f6c), rgb(0xa9b4c2)};
    static constexpr ImU32 light[kPortTypes] = {
        rgb(0x2779bd), rgb(0x1f8f7a), rgb(0xc46f14), rgb(0x7d8627), rgb(0xb83b66),
        rgb(0x8a4fb5), rgb(0x3f8f2e), rgb(0xa8860a), rgb(0xc23c39), rgb(0x667282)};
    return (current.dark ? dark : light)[std::size_t(type)];
}

ImU32 color_of(NodeState state) {
    switch (state) {
        case NodeState::running: return current.accent;
        case NodeState::done:
        case NodeState::cached: return current.good;
        case NodeState::failed: return current.bad;
        case NodeState::waiting:
        case NodeState::not_run: return current.warn;
        case NodeState::not_asked:
        case NodeState::cancelled: break;
    }
    return current.muted;
}

ImU32 faded(ImU32 color, float alpha) {
    const auto a = ImU32(float(color >> IM_COL32_A_SHIFT & 255) * alpha);
    return (color & ~IM_COL32_A_MASK) | a << IM_COL32_A_SHIFT;
}

void text_in(ImU32 color, const char* text) {
    ImGui::PushStyleColor(ImGuiCol_Text, color);
    ImGui::TextUnformatted(text);
    ImGui::PopStyleColor();
}

void wrapped_in(ImU32 color, const std::string& text) {
    ImGui::PushTextWrapPos(0);
    text_in(color, text.c_str());
    ImGui::PopTextWrapPos();
}

void tooltip(const std::string& text) {
    if (text.empty() || !ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled)) return;
    ImGui::BeginTooltip();
    ImGui::PushTextWrapPos(ui(340));
    ImGui::TextUnformatted(text.c_str());
    ImGui::PopTextWrapPos();
    ImGui::EndTooltip();
}

std::string shortened(const std::string& text, float width, ImFont* font, float size) {
    auto fits = [&](const std::string& s) { return font->CalcTextSizeA(size, FLT_MAX, 0, s.c_str()).x <= width; };
    if (fits(text)) return text;
    std::string cut = text;
    while (!cut.empty() && !fits(cut + "…")) {
        // Never within a character of several bytes.
        while (!cut.empty() && (static_cast<unsigned char>(cut.back()) & 0xc0) == 0x80) cut.pop_back();
        if (!cut.empty()) cut.pop_back();
    }
    return cut + "…";
}

std::string wrapped(const std::string& text, float width, ImFont* font, float size) {
    auto width_of = [&](const std::string& line) { return font->CalcTextSizeA(size, FLT_MAX, 0, line.c_str()).x; };
    std::string all, line;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t end = std::min(text.find_first_of(" /\n", at), text.size() - 1) + 1;
        const std::string word = text.substr(at, end - at);
        if (!line.empty() && width_of(line + word) > width) {
            all += line + "\n";
            line.clear();
        }
        line += word;
        if (word.back() == '\n') all += std::exchange(line, {});
        at = end;
    }
    return all + line;
}

}  // namespace voxloom::editor
