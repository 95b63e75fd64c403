#include "core/data/value.h"

#include <fmt/format.h>

#include "core/base/text.h"
#include "core/data/selection.h"

namespace voxloom {

std::string_view name_of(PortType type) {
    constexpr std::string_view names[] = {"Volume",           "Series", "Bricks", "Lattice",
                                          "Selection",        "TransferFunction",
                                          "Camera",           "Lights", "Image",  "Table"};
    return names[std::size_t(type)];
}

std::string PortTypes::text() const {
    std::vector<std::string> names;
    for (int i = 0; i < kPortTypes; ++i)
        if (has(PortType(i))) names.emplace_back(name_of(PortType(i)));
    return join(names, " or ");
}

namespace {
template <class... F>
struct Overloaded : F... {
    using F::operator()...;
};
template <class... F>
Overloaded(F...) -> Overloaded<F...>;
}  // namespace

std::uint64_t resident_bytes(const Value& value) {
    return std::visit(
        Overloaded{[](std::monostate) { return std::uint64_t(0); },
                   [](const VolumePtr& v) { return v->resident_bytes(); },
                   [](const BricksPtr& v) { return v->resident_bytes(); },
                   [](const SeriesPtr& v) { return v->resident_bytes(); },
                   [](const ImagePtr& v) {
                       return std::uint64_t(v->bytes().size() + v->depth.size() * sizeof(float));
                   },
                   [](const LatticePtr& v) {
                       std::uint64_t sum = 0;
                       for (const Value& grid : v->grids()) sum += resident_bytes(grid);
                       return sum;
                   },
                   [](const SelectionPtr& v) {
                       return std::uint64_t(v->bricks.size() * sizeof(SelectedBrick));
                   },
                   [](const auto&) { return std::uint64_t(1024); }},
        value);
}

ValueDesc::ValueDesc(SeriesDesc d)
    : type(PortType::series), detail(std::make_shared<const SeriesDesc>(std::move(d))) {}
ValueDesc::ValueDesc(LatticeDesc d)
    : type(PortType::lattice), detail(std::make_shared<const LatticeDesc>(std::move(d))) {}

const VolumeDesc* ValueDesc::volume() const {
    if (auto* v = std::get_if<VolumeDesc>(&detail)) return v;
    if (auto* b = std::get_if<BricksDesc>(&detail)) return &b->volume;
    if (auto* s = std::get_if<std::shared_ptr<const SeriesDesc>>(&detail))
        return (*s)->step.volume();
    if (auto* l = std::get_if<std::shared_ptr<const LatticeDesc>>(&detail))
        return (*l)->grids.empty() ? nullptr : (*l)->grids.front().grid.volume();
    return nullptr;
}

std::string summary(const ValueDesc& desc) {
    std::string text(name_of(desc.type));
    if (auto* image = std::get_if<ImageDesc>(&desc.detail))
        return text + fmt::format(" {} x {}", image->size.x, image->size.y);
    if (auto* s = std::get_if<std::shared_ptr<const SeriesDesc>>(&desc.detail))
        text += fmt::format(" of {} steps", (*s)->times.size());
    if (auto* b = std::get_if<BricksDesc>(&desc.detail))
        text += fmt::format(" of {} levels", b->levels.size());
    if (const VolumeDesc* volume = desc.volume()) text.append(" ").append(summary(*volume));
    return text;
}

ValueDesc describe(const Value& value) {
    return std::visit(Overloaded{[](std::monostate) { return ValueDesc(); },
                                 [](const VolumePtr& v) { return ValueDesc(v->desc()); },
                                 [](const BricksPtr& v) { return ValueDesc(v->desc()); },
                                 [](const SeriesPtr& v) { return ValueDesc(v->desc()); },
                                 [](const LatticePtr& v) { return ValueDesc(v->desc()); },
                                 [](const ImagePtr& v) { return ValueDesc(ImageDesc{v->size()}); },
                                 [&](const auto&) { return ValueDesc(type_of(value)); }},
                      value);
}

}  // namespace voxloom
