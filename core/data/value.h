// What flows through a graph: the port types, the values, and their descriptions.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/data/bricks.h"
#include "core/data/camera.h"
#include "core/data/image.h"
#include "core/data/transfer_function.h"
#include "core/data/volume.h"

namespace voxloom {

class Series;
class Lattice;
struct Selection;
using SelectionPtr = std::shared_ptr<const Selection>;
using SeriesPtr = std::shared_ptr<const Series>;
using LatticePtr = std::shared_ptr<const Lattice>;

enum class PortType : std::uint8_t {
    volume, series, bricks, lattice, selection, transfer, camera, lights, image, table
};
inline constexpr int kPortTypes = 10;
std::string_view name_of(PortType type);  // "Volume", "Series", ...

// A set of port types: what an input accepts.
class PortTypes {
  public:
    constexpr PortTypes() = default;
    constexpr PortTypes(PortType type) : bits_(1u << unsigned(type)) {}
    constexpr PortTypes(std::initializer_list<PortType> types) {
        for (PortType t : types) bits_ |= 1u << unsigned(t);
    }
    constexpr bool has(PortType type) const { return bits_ >> unsigned(type) & 1u; }
    std::string text() const;  // "Volume or Bricks"
    friend constexpr bool operator==(PortTypes, PortTypes) = default;

  private:
    unsigned bits_ = 0;
};

// Alternatives stand in the order of PortType, after the empty one.
using Value = std::variant<std::monostate, VolumePtr, SeriesPtr, BricksPtr, LatticePtr, SelectionPtr,
                           TransferPtr, CameraPtr, LightsPtr, ImagePtr, TablePtr>;
inline bool is_empty(const Value& v) { return v.index() == 0; }
inline PortType type_of(const Value& v) { return PortType(v.index() - 1); }
std::uint64_t resident_bytes(const Value& v);  // memory that keeping it costs

// What is known of a value before it is computed. monostate: nothing beyond its type.
struct SeriesDesc;
struct LatticeDesc;
struct ImageDesc {
    glm::ivec2 size{0};
};
struct ValueDesc {
    PortType type = PortType::volume;
    std::variant<std::monostate, VolumeDesc, BricksDesc, ImageDesc,
                 std::shared_ptr<const SeriesDesc>, std::shared_ptr<const LatticeDesc>>
        detail;
    // A volume that holds no voxels: they are read, decoded or computed where somebody asks for them.
    bool by_region = false;

    ValueDesc() = default;
    ValueDesc(PortType t) : type(t) {}
    ValueDesc(VolumeDesc d) : type(PortType::volume), detail(std::move(d)) {}
    ValueDesc(BricksDesc d) : type(PortType::bricks), detail(std::move(d)) {}
    ValueDesc(ImageDesc d) : type(PortType::image), detail(d) {}
    ValueDesc(SeriesDesc d);
    ValueDesc(LatticeDesc d);
    // The volume behind it: the volume itself, level 0 of bricks, a series' step, a lattice's first
    // grid. Null when not known.
    const VolumeDesc* volume() const;
};
std::string summary(const ValueDesc& desc);  // "Volume 256 x 256 x 128 u8, ..."
ValueDesc describe(const Value& value);

// The same variable at several times.
struct SeriesDesc {
    PortType element = PortType::volume;  // Volume, Bricks or Lattice
    ValueDesc step;                       // of each step
    std::vector<double> times;            // increasing; steps may be uneven
    std::string time_unit;
};

class Series {
  public:
    explicit Series(SeriesDesc desc) : desc_(std::move(desc)) {}
    virtual ~Series() = default;
    const SeriesDesc& desc() const { return desc_; }
    // The value at step i, fetched when asked for. [any thread]
    virtual Value fetch(std::size_t i, const std::stop_token& stop = {}) const = 0;
    virtual std::uint64_t resident_bytes() const { return 0; }

  private:
    SeriesDesc desc_;
};

// Two or more interleaved Cartesian grids (BCC: 2; D4*: 2 per pair of times).
struct LatticeDesc {
    struct Grid {
        ValueDesc grid;          // Volume or Bricks
        glm::dvec3 offset{0};    // of its first sample, in index units of grid 0
        double time = 0;         // D4*: when it was sampled
    };
    std::string kind;            // "bcc", "d4*"
    std::vector<Grid> grids;
};

class Lattice {
  public:
    Lattice(LatticeDesc desc, std::vector<Value> grids)
        : desc_(std::move(desc)), grids_(std::move(grids)) {}
    const LatticeDesc& desc() const { return desc_; }
    const std::vector<Value>& grids() const { return grids_; }

  private:
    LatticeDesc desc_;
    std::vector<Value> grids_;
};

}  // namespace voxloom
