// A cutting plane's handles in its picture: the square moves it along its normal, the round one turns it.
#include <algorithm>
#include <cmath>

#include "app/editor/model/plane_control.h"
#include "app/editor/view/picture.h"

namespace voxloom::editor {

namespace {

constexpr double kArrow = 64, kReach = 10;  // pixels, before scaling

// From the world to the screen, and lengths back, for a picture that fills lo..hi.
struct Projection {
    const Camera& camera;
    glm::dvec2 lo, hi;

    double world_per_pixel(glm::dvec3 p) const {
        const double depth = camera.projection == Camera::Projection::perspective ? glm::dot(p - camera.eye, camera.forward()) : 1;
        return camera.unit_height() * std::max(depth, 1e-12) / std::max(hi.y - lo.y, 1.0);
    }
    glm::dvec2 place(glm::dvec3 p) const {
        const glm::dvec3 d = p - camera.eye;
        return (lo + hi) * 0.5 + glm::dvec2(glm::dot(d, camera.right()), -glm::dot(d, camera.true_up())) / world_per_pixel(p);
    }
};

}  // namespace

bool draw_plane_gizmo(Editor& editor, const WireEnd& port, const Camera* camera, glm::dvec2 lo, glm::dvec2 hi, bool hovered) {
    Viewport::Handle& held = editor.viewport.held;
    const bool down = ImGui::IsMouseDown(ImGuiMouseButton_Left);
    if (!down) held = Viewport::Handle::none;
    if (!camera) return false;
    const std::optional<std::string> node = plane_of(editor.work.graph(), editor.registry, port.node);
    if (!node) return false;
    const std::optional<Plane> plane = plane_now(editor.work.graph(), editor.registry, *node, editor.live);
    if (!plane) return false;

    const Projection projection{*camera, lo, hi};
    const double pixel = projection.world_per_pixel(plane->point), length = pixel * kArrow * double(theme().scale);
    const glm::dvec2 foot = projection.place(plane->point), tip = projection.place(plane->point + plane->normal * length);
    const glm::dvec2 mouse = vec(ImGui::GetMousePos()), delta = vec(ImGui::GetIO().MouseDelta);
    const double reach = kReach * double(theme().scale);
    const bool over_tip = glm::distance(mouse, tip) < reach, over_foot = !over_tip && glm::distance(mouse, foot) < reach;
    if (hovered && ImGui::IsMouseClicked(ImGuiMouseButton_Left))
        held = over_tip ? Viewport::Handle::turn : over_foot ? Viewport::Handle::move : Viewport::Handle::none;

    const bool turns = held == Viewport::Handle::turn, moves = held == Viewport::Handle::move;
    if (turns || moves) editor.moving = true;
    if ((turns || moves) && delta != glm::dvec2(0.0)) {
        const glm::dvec2 along = tip - foot;
        // Seen from its end the normal has no direction on the screen; then up is towards the eye.
        const double share = glm::dot(along, along) > 25 ? glm::dot(delta, along) / glm::dot(along, along) : -delta.y / kArrow;
        const glm::dvec3 by = (camera->right() * delta.x - camera->true_up() * delta.y) * pixel;
        edit(editor, [&] {
            if (moves) move_plane(editor.work, *node, *plane, share * length);
            else turn_plane(editor.work, *node, plane->normal * length + by);
        });
    }
    ImDrawList& list = *ImGui::GetWindowDrawList();
    const ImU32 color = turns || moves ? theme().warn : theme().accent;
    const float r = ui(5);
    list.AddLine(im(foot), im(tip), IM_COL32(0, 0, 0, 160), ui(4));
    list.AddLine(im(foot), im(tip), color, ui(2));
    list.AddRectFilled(im(foot - glm::dvec2(r)), im(foot + glm::dvec2(r)), over_foot || moves ? theme().warn : color);
    list.AddCircleFilled(im(tip), r, over_tip || turns ? theme().warn : color, 16);
    mark(editor, "plane:move", im(foot - glm::dvec2(r)), im(foot + glm::dvec2(r)));
    mark(editor, "plane:turn", im(tip - glm::dvec2(r)), im(tip + glm::dvec2(r)));
    if (hovered && (over_tip || over_foot) && !down) ImGui::SetTooltip("%s", over_tip ? "Drag: turns the cutting plane." : "Drag: moves the cutting plane along its normal.");
    return turns || moves;
}

}  // namespace voxloom::editor
