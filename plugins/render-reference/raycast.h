// The reference ray integrator: slow, in double precision, the truth that other pictures are
// measured against.
//
// Along a ray through one cell a trilinear field is an exact cubic. Where that can be used
// ("cells"), the ray is walked cell by cell; the cubic is cut where it turns and where it meets a
// control point of the transfer function, and on every piece the extinction is a cubic again: its
// integral, the optical depth, is exact, and the colour is a closed form (one colour) or an
// eight-point Gauss rule on stretches of little optical depth. Maxima and isosurfaces are those of
// the cubic itself. What is no cubic (other kernels, gradients in the extinction, closed forms) is
// sampled at the middles of short steps ("steps"), whose error falls with the square of the step.
#pragma once

#include <functional>
#include <glm/glm.hpp>
#include <optional>
#include <stop_token>
#include <vector>

#include "core/data/camera.h"
#include "core/data/image.h"
#include "core/data/transfer_function.h"
#include "plugins/render-reference/field.h"

namespace voxloom::reference {

struct Cubic;

enum class Compositing { emission_absorption, mip, x_ray, isosurface };
enum class Mode { automatic, cells, steps };

struct RaycastScene {
    VolumePtr volume;
    TransferPtr transfer;
    CameraPtr camera;
    Lights lights;
    glm::ivec2 size{512, 512};
    Reconstruction reconstruction = Reconstruction::trilinear;
    Compositing compositing = Compositing::emission_absorption;
    double iso_value = 0;
    bool shading = false;
    GradientStencil gradient = GradientStencil::isotropic;
    glm::dvec2 gradient_modulation{0.0};  // smoothstep from .x to .y; both 0: off
    int component = 0;
    glm::dvec4 background{0, 0, 0, 1};  // colour and opacity, not premultiplied
    bool closed_form = false;           // the volume's own formula instead of its voxels
    double step = 0.1;                  // of "steps", in voxels: of the smallest spacing
    Mode mode = Mode::automatic;
};

// Why "cells" cannot integrate the scene exactly, or null when it can.
const char* cells_problem(const RaycastScene& scene);

class Raycaster {
  public:
    // Reads the volume into memory where it is not. Throws Error for scenes that cannot be drawn.
    explicit Raycaster(RaycastScene scene, const std::stop_token& stop = {},
                       const std::function<void(double)>& progress = {});

    // Premultiplied colour along one ray, without the background. [any thread]
    glm::dvec4 trace(const Ray& ray) const;
    // The scene's picture, background under it. The same bytes whatever the number of threads.
    // progress(fraction) is called from any thread.
    Image image(const std::stop_token& stop = {},
                const std::function<void(double)>& progress = {}) const;
    bool uses_cells() const { return cells_; }

  private:
    // The part of a ray inside of the volume: index position p + t d at world distance t from where
    // it enters. Measured from there, so that a far-away eye costs no digits.
    struct Path {
        glm::dvec3 p, d;
        double length;
        glm::dvec3 view;  // world direction
        glm::dvec3 at(double t) const { return p + t * d; }
    };
    // The one sample that MIP and isosurfaces show.
    struct Hit {
        double t, value;
    };
    // What has been gathered so far, front to back. Optical depth, not alpha: nothing cancels.
    struct Composite {
        glm::dvec3 color{0.0};
        double depth = 0;
        // Less than 1e-26 comes through: no bit of the picture can change any more.
        bool saturated() const { return depth > 60; }
    };
    // The transfer function between two neighbouring control values, or beyond the outermost ones:
    // first + slope * (s - value) / (next value - value).
    struct Segment {
        double value = 0, per_value = 0;  // per_value 0: constant
        Emission first{0.0}, slope{0.0};
        bool transparent = false;
        bool one_color = false;  // everything on it has this colour
        glm::dvec3 color{0.0};
    };
    struct Cell;

    std::optional<Path> clip(const Ray& ray) const;
    Emission classify(glm::dvec3 p, double value) const;
    Emission lit(const Emission& emission, glm::dvec3 gradient, glm::dvec3 p,
                 const Path& path) const;
    glm::dvec4 show(const Hit& hit, const Path& path) const;

    // cells.cpp
    void build_segments();
    std::size_t segment_of(double value) const;
    bool is_transparent(double lo, double hi) const;
    template <class Visit>
    void walk(const Path& path, const Visit& visit) const;
    void emit_cells(const Path& path, Composite& out) const;
    void emit_piece(const Segment& segment, const Path& path, Cell& cell, const Cubic& f,
                    double from, double to, Composite& out) const;
    std::optional<Hit> maximum_cells(const Path& path) const;
    std::optional<Hit> surface_cells(const Path& path) const;

    // steps.cpp
    std::int64_t step_count(const Path& path) const;
    void emit_steps(const Path& path, Composite& out) const;
    std::optional<Hit> maximum_steps(const Path& path) const;
    std::optional<Hit> surface_steps(const Path& path) const;

    RaycastScene scene_;
    Field field_;
    bool cells_ = false;
    double step_length_ = 1;         // of "steps", in world units
    double flat_ = 0;                // gradient magnitudes up to it give no direction
    std::vector<double> knots_;      // values of the control points, each once
    std::vector<Segment> segments_;  // below, between and above the knots
};

}  // namespace voxloom::reference
