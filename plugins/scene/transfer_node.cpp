#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/text.h"
#include "plugins/scene/data_range.h"
#include "plugins/scene/materials.h"
#include "plugins/scene/nodes.h"
#include "plugins/scene/presets.h"

namespace voxloom::scene {

namespace {

// A surface's opacity is that of a peak crossed where the values change by this share of their
// range within one reference length. A fixed rate, so that narrower peaks are proportionally denser
// and the picture tends to that of infinitely thin shells.
constexpr double kSurfaceRate = 0.1;

// Anything but infinity.
constexpr double kMost = std::numeric_limits<double>::max();

constexpr const char* kMethod = R"(
Opacities are given for a reference length d0 and stored as extinction per world length,
tau = -ln(1 - opacity)/d0; between points tau and the premultiplied colour tau c are linear. So the
picture does not depend on the number of slices or steps. `reference_length: 0` takes one voxel of
the volume wired to `fit` (its smallest spacing): an opacity of 0.1 then hides a tenth of the light
per voxel. An opacity of 1 is read as 1 - 2^-24. `opacity_scale` makes everything denser.

`domain: relative` places 0 at the data's smallest and 1 at its largest value, or at the ends of
`range` where that is given; `domain: values` takes values as the volume has them.

**preset**

* `none`: the `points`, [value, opacity] in the colours of `colormap`, or [value, r, g, b, opacity].
  Two points of one value make a step, at which the later one holds.
* `ramp`: opacity rises from `ramp_start` to `ramp_end`.
* `isosurfaces`: thin semi-transparent shells at `iso_values`, or at `iso_count` evenly spread values.
  The peaks keep their integral whatever `iso_width` is: `iso_opacity` is what a ray gains on
  crossing one where the values change by a tenth of their range per reference length. Steeper
  borders look thinner. The narrower the peaks, the more a renderer must get right: this is the scene
  in which errors of sampling and classification are compared.
* `materials`: for data that nobody has looked at yet. Three boundaries part the values into four
  classes (Otsu's criterion on the square root of the histogram); the first two are drawn as
  translucent skins, what lies above the third is nearly solid. `domain` has no effect on it.
* `ct-bone`, `ct-soft-tissue`, `ct-lung`, `ct-vessels` are in Hounsfield units whatever `domain` is;
  where the scanner stored values from 0, set `value_offset: 1024`. `mr-head` is relative.

**Two dimensions.** `widgets` classifies by value and gradient magnitude, which tells a border between
two materials from the inside of a third one with the same value. A row is a box
[v0, v1, g0, g1, r, g, b, opacity] or a trapezoid [v0, v1, v2, v3, g0, g1, r, g, b, opacity] from
v0..v1 at gradient g0 to v2..v3 at g1 (a triangle where v0 = v1). Where shapes overlap their
extinctions add up. With `domain: relative` a gradient of 1 is a change by the whole range of values
within one voxel; with `domain: values` it is value per world length. Two dimensions cannot be
pre-integrated exactly, and gradients of noise are noise: prefer one where one suffices.

References: N. Max, Optical models for direct volume rendering, IEEE TVCG 1995; J. Kniss, G. Kindlmann,
C. Hansen, Interactive volume rendering using multi-dimensional transfer functions, IEEE Vis 2001.
)";

// Values of the user's domain to values of the volume.
struct Axis {
    bool relative;
    ValueRange range;
    double offset;
    double operator()(double v) const {
        if (!relative) return v + offset;
        return std::clamp(std::lerp(range.min, range.max, v), -kMost, kMost);
    }
};

bool is_relative(const Params& p) { return p.text("domain") == "relative"; }

bool range_is_given(const Params& p) {
    const auto& range = p.numbers("range");
    return range[0] < range[1];
}

// Explicit values need no knowledge of the data: then no voxel is read.
bool needs_range(const Params& p) {
    const Preset* preset = find_preset(p.text("preset"));
    bool one_needs = preset ? preset->relative
                            : is_relative(p) || p.text("preset") == "isosurfaces" ||
                                  p.text("preset") == "materials";
    return one_needs || !p.rows("widgets").empty();
}

ValueRange range_for(Evaluation& ev) {
    const Params& p = ev.params();
    if (range_is_given(p)) return {p.numbers("range")[0], p.numbers("range")[1]};
    if (!needs_range(p)) return {0, 1};
    if (is_empty(ev.value("fit"))) {
        ev.warn("no data is wired to 'fit' and no 'range' is set, so the data is taken to lie between "
                "0 and 1; wire the volume to 'fit'");
        return {0, 1};
    }
    ValueRange range = data_range(ev.value("fit"), std::size_t(p.integer("range_steps")), ev.stop(),
                                  [&](double done) { ev.progress(done, "range of values"); });
    // No wider than what can be measured: the extent must be finite.
    range = {std::max(range.min, -kMost / 4), std::min(range.max, kMost / 4)};
    if (range.min < range.max) return range;
    ev.warn(fmt::format("all values of the data are {}, which is taken as the lower end of the range",
                        shortest(range.min)));
    return {range.min, range.min + std::max(1.0, std::abs(range.min) * 1e-6)};
}

std::vector<ControlPoint> points_of(const Params& p, const Axis& axis) {
    std::vector<ControlPoint> points;
    for (const auto& row : p.rows("points")) {
        ControlPoint point{axis(row.front()), row.back(), {}};
        if (row.size() == 5) point.color = glm::dvec3(row[1], row[2], row[3]);
        points.push_back(point);
    }
    return points;
}

std::vector<ControlPoint> ramp_of(const Params& p, const Axis& axis) {
    return {{axis(p.real("ramp_start")), 0, {}},
            {axis(p.real("ramp_end")), p.real("ramp_opacity"), {}}};
}

// A translucent skin at each boundary but the last, nearly solid above that one.
std::vector<ControlPoint> materials(Evaluation& ev, const ValueRange& range) {
    const std::vector<double> ends = material_boundaries(ev.value("fit"), range, 3, ev.stop());
    const glm::dvec3 colors[] = {{0.85, 0.50, 0.36}, {0.95, 0.72, 0.45}, {1.0, 0.97, 0.90}};
    const double skin[] = {0.035, 0.10, 0.45};
    const double inside[] = {0.0015, 0.012, 0.45};
    std::vector<ControlPoint> points;
    for (std::size_t i = 0; i < ends.size(); ++i) {
        const double below = i > 0 ? ends[i - 1] : range.min;
        const double above = i + 1 < ends.size() ? ends[i + 1] : range.max;
        const double half = 0.35 * std::min(ends[i] - below, above - ends[i]);
        const double before = i > 0 ? inside[i - 1] : 0;
        const glm::dvec3 color_before = i > 0 ? colors[i - 1] : colors[0];
        points.push_back({ends[i] - half, before, color_before});
        points.push_back({ends[i], skin[i], colors[i]});
        points.push_back({ends[i] + half, inside[i], colors[i]});
        ev.measure(fmt::format("boundary_{}", i + 1), ends[i]);
    }
    return points;
}

std::vector<ControlPoint> preset_points(const Preset& preset, const Axis& axis) {
    std::vector<ControlPoint> points = preset.points;
    for (ControlPoint& point : points) point.value = axis(point.value);
    return points;
}

// The map is laid over the range; explicit values without one are their own range.
Coloring coloring_of(const Params& p, const ValueRange& range,
                     const std::vector<ControlPoint>& points) {
    Coloring coloring{&color_map(p.text("colormap")), p.boolean("colormap_reversed"), range};
    if (!is_relative(p) && !range_is_given(p) && !points.empty()) {
        auto by_value = [](const auto& a, const auto& b) { return a.value < b.value; };
        auto [lo, hi] = std::minmax_element(points.begin(), points.end(), by_value);
        coloring.span = {lo->value, hi->value};
    }
    return coloring;
}

TransferFunction1D isosurfaces(const Params& p, const Axis& axis, const Density& density) {
    std::vector<double> values;
    for (double v : p.numbers("iso_values")) values.push_back(axis(v));
    if (values.empty()) {
        const auto n = double(p.integer("iso_count"));
        for (int i = 0; i < int(n); ++i)
            values.push_back(std::lerp(axis.range.min, axis.range.max, (i + 1) / (n + 1)));
    }
    const Coloring coloring{&color_map(p.text("colormap")), p.boolean("colormap_reversed"), axis.range};
    const double extent = axis.range.extent();
    const double width = axis.relative ? p.real("iso_width") * extent : p.real("iso_width");
    // Crossing takes width/(rate extent) reference lengths, at half of the tip's extinction.
    const double sharpness = 2 * kSurfaceRate * extent / width;
    const double tau = std::min(density.extinction(p.real("iso_opacity")) * sharpness, kMaxExtinction);
    std::vector<Peak> peaks;
    for (double value : values)
        peaks.push_back({value, width, Emission(tau * coloring.at(value), tau)});
    return sum_of_peaks(peaks);
}

Shape shape_of(const std::vector<double>& row, const Axis& value, const Axis& gradient,
               const Params& p, const Density& density) {
    const bool box = row.size() == 8;
    const double* g = &row[box ? 2 : 4];
    const double* color = g + 2;
    Shape shape;
    shape.bottom = {value(row[0]), value(row[1])};
    shape.top = box ? shape.bottom : ValueRange{value(row[2]), value(row[3])};
    shape.gradient = {gradient(g[0]), gradient(g[1])};
    double tau = density.extinction(color[3]);
    shape.emission = Emission(tau * glm::dvec3(color[0], color[1], color[2]), tau);
    shape.edge = p.real("widget_edge");
    return shape;
}

std::shared_ptr<const TransferFunction2D> two_dimensional(Evaluation& ev, const Axis& axis,
                                                          double voxel, const Density& density) {
    const Params& p = ev.params();
    if (p.rows("widgets").empty()) return nullptr;
    const double steepest = axis.range.extent() / voxel;
    const Axis gradient{axis.relative, {0, steepest}, 0};
    Domain domain{{-kMost, kMost}, {0, kMost}};
    // Data that was looked at has no other values, and no difference of neighbours is steeper.
    if (!is_empty(ev.value("fit")) && !range_is_given(p)) domain = {axis.range, {0, steepest}};
    std::vector<Shape> shapes;
    for (const auto& row : p.rows("widgets"))
        shapes.push_back(shape_of(row, axis, gradient, p, density));
    return std::make_shared<TransferFunction2D>(
        rasterize(shapes, domain, p.size2("table"), ev.stop()));
}

// The first thing wrong with a row's numbers, or empty.
std::string problem_with_point(const std::vector<double>& row) {
    if (row.size() != 2 && row.size() != 5)
        return fmt::format("has {} numbers; write [value, opacity] or [value, r, g, b, opacity]",
                           row.size());
    for (std::size_t i = 1; i < row.size(); ++i)
        if (row[i] < 0 || row[i] > 1)
            return fmt::format("has {} {}, which must be between 0 and 1",
                               i + 1 == row.size() ? "the opacity" : "a colour of", shortest(row[i]));
    return {};
}

std::string problem_with_widget(const std::vector<double>& row) {
    if (row.size() != 8 && row.size() != 10)
        return fmt::format("has {} numbers; write [v0, v1, g0, g1, r, g, b, opacity] or "
                           "[v0, v1, v2, v3, g0, g1, r, g, b, opacity]", row.size());
    const std::size_t g = row.size() - 6;
    for (std::size_t i = 0; i < g; i += 2)
        if (row[i] > row[i + 1])
            return fmt::format("has values from {} down to {}; swap them", shortest(row[i]),
                               shortest(row[i + 1]));
    if (row[0] == row[1] && row[g - 2] == row[g - 1]) return "has no extent in value; widen it";
    if (row[g] < 0 || row[g] >= row[g + 1])
        return fmt::format("has gradients from {} to {}, which must rise from 0 or above",
                           shortest(row[g]), shortest(row[g + 1]));
    for (std::size_t i = g + 2; i < row.size(); ++i)
        if (row[i] < 0 || row[i] > 1)
            return fmt::format("has {} {}, which must be between 0 and 1",
                               i + 1 == row.size() ? "the opacity" : "a colour of", shortest(row[i]));
    return {};
}

void describe_transfer(Description& d) {
    const Params& p = d.params();
    auto check_rows = [&](const char* key, auto problem_with) {
        const Rows& rows = p.rows(key);
        for (std::size_t i = 0; i < rows.size(); ++i)
            if (std::string problem = problem_with(rows[i]); !problem.empty())
                return d.problem(fmt::format("row {} {}", i + 1, problem), key);
    };
    check_rows("points", problem_with_point);
    check_rows("widgets", problem_with_widget);
    if (p.text("preset") == "none" && p.rows("points").empty())
        d.problem("there is no point; give at least one, [value, opacity]", "points");
    if (p.text("preset") == "materials" && !d.input("fit"))
        d.problem("preset materials looks at the data: wire it to 'fit'", "preset");
    const auto& range = p.numbers("range");
    if (range[0] > range[1])
        d.problem(fmt::format("goes from {} down to {}; swap them", shortest(range[0]),
                              shortest(range[1])), "range");
}

void evaluate_transfer(Evaluation& ev) {
    const Params& p = ev.params();
    const std::string& name = p.text("preset");
    const Preset* preset = find_preset(name);
    if (name != "none" && p.was_set("points"))
        ev.warn(fmt::format("'points' are not used with preset {}; set preset: none to use them", name));

    const ValueRange range = range_for(ev);
    const bool relative = preset ? preset->relative : is_relative(p);
    const Axis axis{relative, range, p.real("value_offset")};
    const double spacing = voxel_spacing(ev.value("fit"));
    const double voxel = spacing > 0 ? spacing : 1;

    TransferFunction f;
    f.reference_length = p.real("reference_length") > 0 ? p.real("reference_length") : voxel;
    const Density density{f.reference_length, p.real("opacity_scale")};
    if (name == "isosurfaces") {
        f.one = isosurfaces(p, axis, density);
    } else {
        const auto points = preset           ? preset_points(*preset, axis)
                            : name == "ramp" ? ramp_of(p, axis)
                            : name == "materials" ? materials(ev, range)
                                             : points_of(p, axis);
        f.one = through_points(points, coloring_of(p, range, points), density);
    }
    f.two = two_dimensional(ev, {is_relative(p), range, p.real("value_offset")}, voxel, density);

    if (needs_range(p)) {
        ev.measure("range_min", range.min);
        ev.measure("range_max", range.max);
    }
    ev.measure("reference_length", f.reference_length, "world");
    ev.output("transfer", std::make_shared<TransferFunction>(std::move(f)));
}

std::vector<std::string> preset_names() {
    std::vector<std::string> names{"none", "ramp", "isosurfaces", "materials"};
    for (const Preset& preset : presets()) names.emplace_back(preset.name);
    return names;
}

}  // namespace

NodeType transfer_node() {
    NodeType node;
    node.id = "scene.transfer";
    node.title = "Transfer function";
    node.doc = "Says what each value looks like: its colour, and how opaque it is per length.";
    node.keywords = {"classification", "colour map", "color map", "opacity", "extinction", "viridis",
                     "isosurfaces", "preset", "Hounsfield", "2-D", "gradient"};
    node.inputs = {{"fit", {PortType::volume, PortType::bricks, PortType::series},
                    "The data whose range of values and voxel spacing are taken.", true}};
    node.outputs = {{"transfer", PortType::transfer, "The transfer function."}};
    const std::vector<std::string> with_map{"none", "ramp", "isosurfaces"};
    node.params = {
        param::choice("preset", preset_names(), "none", "Where the opacities come from."),
        param::choice("domain", {"relative", "values"}, "relative",
                      "Whether values from 0 to 1 stand for the data's range, or for themselves."),
        param::vector("range", {0, 0},
                      "Values that 0 and 1 stand for; both the same: the smallest and largest of the "
                      "data.")
            .range(-kMost, kMost).in_group("Domain"),
        param::integer("range_steps", 0,
                       "How many steps of a series are read for its range; 0 reads all of them.")
            .range(0, 1e9).slider(0, 32).in_group("Domain").is_quality().for_experts(),
        param::real("value_offset", 0,
                    "Added to values of points that are not relative; 1024 where CT was stored from 0.")
            .range(-1e9, 1e9).slider(-1024, 1024).in_group("Domain"),
        param::rows("points", 0, {{0, 0}, {0.1, 0}, {1, 0.2}},
                    "Control points, [value, opacity] or [value, r, g, b, opacity].")
            .range(-kMost, kMost).in_group("Points").shown_if("preset", {"none"}),
        param::choice("colormap", color_map_names(), "viridis",
                      "Colours of what has none of its own, laid over the range.")
            .in_group("Colour").shown_if("preset", with_map),
        param::boolean("colormap_reversed", false, "Turns the colour map around.")
            .in_group("Colour").shown_if("preset", with_map),
        param::real("ramp_start", 0.1, "Where the ramp begins to be seen.")
            .range(-kMost, kMost).slider(0, 1).in_group("Ramp").shown_if("preset", {"ramp"}),
        param::real("ramp_end", 1, "From where on it has its full opacity; may lie below the start.")
            .range(-kMost, kMost).slider(0, 1).in_group("Ramp").shown_if("preset", {"ramp"}),
        param::real("ramp_opacity", 0.2, "Opacity at the upper end of the ramp.")
            .range(0, 1).slider(0, 1).in_group("Ramp").shown_if("preset", {"ramp"}),
        param::list("iso_values", {}, "Values of the surfaces; empty: iso_count evenly spread ones.")
            .range(-kMost, kMost).in_group("Isosurfaces").shown_if("preset", {"isosurfaces"}),
        param::integer("iso_count", 4, "How many surfaces there are when no values are given.")
            .range(1, 256).slider(1, 16).in_group("Isosurfaces").shown_if("preset", {"isosurfaces"}),
        param::real("iso_width", 0.02, "Width of each surface's peak in value, in units of the domain.")
            .range(1e-9, 1e9).slider(0.001, 0.2, Scale::logarithmic).in_group("Isosurfaces")
            .shown_if("preset", {"isosurfaces"}),
        param::real("iso_opacity", 0.3, "Opacity of one surface where values change at a tenth of their "
                                        "range per reference length.")
            .range(0, 1).slider(0, 1).in_group("Isosurfaces").shown_if("preset", {"isosurfaces"}),
        param::real("reference_length", 0,
                    "World length for which opacities are given; 0: one voxel of the fitted data, or 1 "
                    "where there is none.")
            .range(0, 1e30).in_unit("world").in_group("Opacity"),
        param::real("opacity_scale", 1, "Multiplies the extinction: 2 is twice as dense.")
            .range(0, 1e6).slider(0.01, 100, Scale::logarithmic).in_group("Opacity"),
        param::rows("widgets", 0, {},
                    "Shapes over value and gradient magnitude, boxes [v0, v1, g0, g1, r, g, b, opacity] "
                    "or trapezoids [v0, v1, v2, v3, g0, g1, r, g, b, opacity]; they replace the points.")
            .range(-kMost, kMost).in_group("Two dimensions"),
        param::real("widget_edge", 1,
                    "Share of the way from a shape's border to its middle over which it fades in; 0 is "
                    "a hard border.")
            .range(0, 1).slider(0, 1).in_group("Two dimensions"),
        param::vector("table", {256, 128}, "Samples of the table over value and gradient magnitude.")
            .range(4, 2048).whole().in_group("Two dimensions").is_quality().for_experts(),
    };
    node.method = kMethod;
    node.describe = describe_transfer;
    node.evaluate = evaluate_transfer;
    return node;
}

}  // namespace voxloom::scene
