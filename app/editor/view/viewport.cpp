// The picture of an image port: fitted, or moved and magnified by the mouse.
#include <GL/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/editor/view/actions.h"
#include "app/editor/view/editor.h"
#include "core/base/text.h"

namespace voxloom::editor {

namespace {

#ifndef GL_CLAMP_TO_EDGE
#define GL_CLAMP_TO_EDGE 0x812F
#endif

std::vector<WireEnd> image_ports(const Editor& editor) {
    std::vector<WireEnd> ports;
    for (const GraphNode& node : editor.work.graph().nodes)
        if (const NodeType* type = editor.registry.find(node.type))
            for (const PortSpec& port : type->outputs)
                if (type_of(port) == PortType::image) ports.push_back({node.id, port.key, {}});
    return ports;
}

// Opaque, over black where the picture is transparent. Not a number is black.
std::vector<glm::u8vec4> pixels_of(const Image& image) {
    std::vector<glm::u8vec4> pixels(std::size_t(image.size().x) * std::size_t(image.size().y));
    if (image.format() == Image::Format::rgba8) {
        std::ranges::copy(image.rgba8(), pixels.begin());
        for (glm::u8vec4& p : pixels) p.a = 255;
        return pixels;
    }
    auto byte = [](float v) { return std::uint8_t(v > 0 ? std::min(v, 1.f) * 255 + 0.5f : 0.f); };
    std::ranges::transform(image.rgba32f(), pixels.begin(), [&](const glm::vec4& p) {
        return glm::u8vec4(byte(p.r), byte(p.g), byte(p.b), 255);
    });
    return pixels;
}

void upload(Viewport& view, const Image& image) {
    if (!view.texture) glGenTextures(1, &view.texture);
    const std::vector<glm::u8vec4> pixels = pixels_of(image);
    GLint before = 0;
    glGetIntegerv(GL_TEXTURE_BINDING_2D, &before);
    glBindTexture(GL_TEXTURE_2D, view.texture);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA, image.size().x, image.size().y, 0, GL_RGBA, GL_UNSIGNED_BYTE, pixels.data());
    glBindTexture(GL_TEXTURE_2D, GLuint(before));
    view.size = image.size();
}

void draw_port_choice(Editor& editor, const WireEnd& shown) {
    const std::string name = shown.node + "." + shown.port;
    ImGui::SetNextItemWidth(std::min(ui(220), ImGui::GetContentRegionAvail().x * 0.6f));
    if (ImGui::BeginCombo("##port", name.c_str())) {
        for (const WireEnd& port : image_ports(editor)) {
            const std::string text = port.node + "." + port.port;
            if (ImGui::Selectable(text.c_str(), text == name)) editor.viewport.port = port, editor.viewport.zoom = 0;
            mark(editor, "show:" + text);
        }
        ImGui::EndCombo();
    }
    mark(editor, "picture-port");
    tooltip("The picture that is shown; a double click on a node shows its picture, too.");
    ImGui::SameLine();
    action_button(editor, "fit-picture");
}

// What is said in the picture's corner: its size, its age, how fast it came.
std::string caption(const Editor& editor, const WireEnd& port, const LiveValue& value) {
    std::string text = fmt::format("{} x {}", editor.viewport.size.x, editor.viewport.size.y);
    if (const NodeStatus* status = status_of(editor, port.node)) {
        if (status->state == NodeState::failed) return text + ", not of this graph: the node failed";
        if (value.fresh && status->wall_seconds > 0) text += ", " + human_seconds(status->wall_seconds);
    }
    if (!value.fresh) text += editor.live.busy ? ", refining" : ", of an older graph";
    return text;
}

void handle_mouse(Viewport& view, glm::dvec2 middle, double scale) {
    const ImGuiIO& io = ImGui::GetIO();
    if (ImGui::IsItemHovered() && io.MouseWheel != 0) {
        const double zoom = std::clamp(scale * std::pow(1.15, double(io.MouseWheel)), 0.02, 64.0);
        const glm::dvec2 from_middle = vec(io.MousePos) - middle - view.offset;
        view.offset += from_middle * (1 - zoom / scale);
        view.zoom = zoom;
    }
    if (ImGui::IsItemActive()) {
        if (view.zoom == 0) view.zoom = scale;
        view.offset += vec(io.MouseDelta);
    }
}

}  // namespace

void draw_viewport(Editor& editor) {
    Viewport& view = editor.viewport;
    const Theme& t = theme();
    const glm::dvec2 lo = vec(ImGui::GetCursorScreenPos()), size = vec(ImGui::GetContentRegionAvail());
    ImDrawList& list = *ImGui::GetWindowDrawList();
    list.AddRectFilled(im(lo), im(lo + size), IM_COL32(0, 0, 0, 255));
    mark(editor, "picture", im(lo), im(lo + size));
    const WireEnd port = shown_port(editor);
    auto say_instead = [&](const char* text) {
        const ImVec2 extent = ImGui::CalcTextSize(text);
        list.AddText(im(lo + (size - vec(extent)) * 0.5), IM_COL32(148, 155, 167, 255), text);
    };
    if (port.node.empty()) return say_instead("A node that makes an image shows it here.");

    ImGui::SetCursorScreenPos(im(lo + glm::dvec2(0, ui(40))));
    ImGui::InvisibleButton("picture", {std::max(float(size.x), 1.f), std::max(float(size.y) - ui(40), 1.f)});
    auto found = editor.live.values.find(port.node + "." + port.port);
    const ImagePtr* image = found == editor.live.values.end() ? nullptr : std::get_if<ImagePtr>(&found->second.value);
    if (image) {
        if (found->second.serial != view.serial) {
            // A coarse picture takes the place of the whole one, so that nothing jumps.
            const glm::ivec2 before = view.size;
            upload(view, **image);
            if (view.zoom > 0 && before.x > 0 && view.size.x > 0) view.zoom *= double(before.x) / view.size.x;
            view.serial = found->second.serial;
        }
        const glm::dvec2 picture = glm::max(glm::dvec2(view.size), glm::dvec2(1));
        const double fitted = std::min(size.x / picture.x, size.y / picture.y);
        const glm::dvec2 middle = lo + size * 0.5;
        handle_mouse(view, middle, view.zoom > 0 ? view.zoom : fitted);
        const double scale = view.zoom > 0 ? view.zoom : fitted;
        const glm::dvec2 half = picture * scale * 0.5;
        list.PushClipRect(im(lo), im(lo + size), true);
        list.AddImage(reinterpret_cast<ImTextureID>(std::uintptr_t(view.texture)), im(middle + view.offset - half), im(middle + view.offset + half));
        const std::string text = caption(editor, port, found->second);
        const ImVec2 extent = ImGui::CalcTextSize(text.c_str());
        const ImVec2 at = im(lo + glm::dvec2(ui(12), size.y - extent.y - ui(10)));
        list.AddRectFilled({at.x - ui(6), at.y - ui(3)}, {at.x + extent.x + ui(6), at.y + extent.y + ui(3)}, IM_COL32(0, 0, 0, 150), ui(4));
        list.AddText(at, found->second.fresh ? IM_COL32(205, 210, 218, 255) : t.warn, text.c_str());
        list.PopClipRect();
    } else {
        const NodeStatus* status = status_of(editor, port.node);
        say_instead(status && status->state == NodeState::failed ? "The node failed; its sentence stands below."
                    : editor.live.busy                             ? "Computing…"
                                                                   : "No picture yet.");
    }
    ImGui::SetCursorScreenPos(im(lo + glm::dvec2(ui(8), ui(7))));
    draw_port_choice(editor, port);
}

}  // namespace voxloom::editor
