#include "app/editor/window/kept_frame.h"

#define GLFW_INCLUDE_NONE
#include <GL/gl.h>
#include <GLFW/glfw3.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <string_view>

namespace voxloom::editor {

namespace {

std::vector<DrawnList> lists_of(const ImDrawData& data) {
    static_assert(sizeof(ImDrawIdx) == sizeof(std::uint16_t));
    std::vector<DrawnList> lists(std::size_t(data.CmdListsCount));
    for (std::size_t i = 0; i < lists.size(); ++i) {
        const ImDrawList& from = *data.CmdLists[i];
        DrawnList& to = lists[i];
        to.name = from._OwnerName ? from._OwnerName : "";
        to.vertices.resize(std::size_t(from.VtxBuffer.Size));
        std::transform(from.VtxBuffer.begin(), from.VtxBuffer.end(), to.vertices.begin(),
                       [](const ImDrawVert& v) { return DrawnVertex{{v.pos.x, v.pos.y}, {v.uv.x, v.uv.y}, v.col}; });
        to.indices.assign(from.IdxBuffer.begin(), from.IdxBuffer.end());
        for (const ImDrawCmd& c : from.CmdBuffer)
            to.commands.push_back({{c.ClipRect.x, c.ClipRect.y, c.ClipRect.z, c.ClipRect.w}, std::bit_cast<std::uintptr_t>(c.TextureId), c.VtxOffset, c.IdxOffset, c.ElemCount});
    }
    return lists;
}

// A part of a frame is cut at whole pixels, and so must be what is in it: cut between them, it would not fill its parts.
void snap_clips(ImDrawData& data) {
    for (int i = 0; i < data.CmdListsCount; ++i)
        for (ImDrawCmd& c : data.CmdLists[i]->CmdBuffer)
            c.ClipRect = {std::floor(c.ClipRect.x), std::floor(c.ClipRect.y), std::ceil(c.ClipRect.z), std::ceil(c.ClipRect.w)};
}

bool is_software(const GLubyte* renderer) {
    const std::string_view name = renderer ? reinterpret_cast<const char*>(renderer) : "";
    return name.find("llvmpipe") != name.npos || name.find("softpipe") != name.npos || name.find("swrast") != name.npos;
}

// Of a function that takes and gives what `F` says.
template <class F>
F function(const char* name) {
    return reinterpret_cast<F>(glfwGetProcAddress(name));
}

}  // namespace

KeptFrame::KeptFrame(GLFWwindow* window) : window_(window) {
    if (!is_software(glGetString(GL_RENDERER)) || !glfwExtensionSupported("GLX_MESA_copy_sub_buffer")) return;
    const auto display = function<void* (*)()>("glXGetCurrentDisplay");
    const auto drawable = function<unsigned long (*)()>("glXGetCurrentDrawable");
    copy_ = function<CopySubBuffer>("glXCopySubBufferMESA");
    if (!display || !drawable) copy_ = nullptr;
    if (!copy_) return;
    display_ = display();
    drawable_ = drawable();
}

bool KeptFrame::draw(ImDrawData& data, glm::ivec2 size, ImVec4 background) {
    if (size.x < 1 || size.y < 1) return false;
    if (size != size_) forget();
    size_ = size;
    snap_clips(data);
    std::vector<DrawnList> lists = lists_of(data);
    drawn_ = {{glm::ivec2(0), size}};
    if (!lists_.empty()) {
        const std::vector<Rect> damaged = damage(lists_, lists, size);
        if (damaged.empty()) return false;
        // Where a unit is not a pixel, rectangles are no pixels either.
        if (copy_ && data.FramebufferScale.x == 1 && data.FramebufferScale.y == 1) drawn_ = damaged;
    }
    lists_ = std::move(lists);
    const ImFontAtlas& fonts = *ImGui::GetIO().Fonts;
    painter_.load(lists_, {std::bit_cast<std::uintptr_t>(fonts.TexID), {fonts.TexUvWhitePixel.x, fonts.TexUvWhitePixel.y}}, size,
                  {data.FramebufferScale.x, data.FramebufferScale.y});
    for (const Rect& r : drawn_) painter_.draw(r, {background.x, background.y, background.z});
    return true;
}

void KeptFrame::show() const {
    if (!copy_) return glfwSwapBuffers(window_);
    for (const Rect& r : drawn_) copy_(display_, drawable_, r.lo.x, size_.y - r.hi.y, r.hi.x - r.lo.x, r.hi.y - r.lo.y);
}

}  // namespace voxloom::editor
