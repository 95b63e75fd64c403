#include "plugins/render-slicer/renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/error.h"
#include "core/base/meter.h"
#include "core/data/brick_cache.h"
#include "core/gpu/source.h"
#include "core/gpu/thread.h"
#include "plugins/render-slicer/blocks.h"
#include "plugins/render-slicer/brick_scene.h"
#include "plugins/render-slicer/decoding.h"
#include "plugins/render-slicer/keep.h"
#include "plugins/render-slicer/modules.h"
#include "plugins/render-slicer/picture.h"
#include "plugins/render-slicer/tables.h"
#include "plugins/render-slicer/view.h"
#include "plugins/render-slicer/voxels.h"

namespace voxloom::slicer {

namespace {

using gpu::Module;
using gpu::TexturePtr;
using S = Settings;

// A loop in a shader may end after 2^16 turns on some drivers; blocks to leap over count as well.
constexpr double kMostPlanes = 20000;
constexpr int kEmissionBins = 4096;
constexpr int kIntegralNodes = 4096;

template <class... Parts>
Hash key(std::string_view what, Parts... parts) {
    Hasher h;
    h.text(what);
    (h.value(parts), ...);
    return h.finish();
}
Hash key(std::string_view what, const Hash& a, const Hash& b) {
    return Hasher().text(what).hash(a).hash(b).finish();
}

// Premultiplied.
glm::vec4 background(const S& s) {
    return glm::vec4(glm::dvec3(s.background) * s.background.a, s.background.a);
}

// --- what is prepared from the data ------------------------------------------------------------

// The source as a dense volume in memory, kept for as long as the source lives.
VolumePtr dense(const Value& source, const std::shared_ptr<const void>& owner, Evaluation& ev) {
    if (auto* v = std::get_if<VolumePtr>(&source); v && (*v)->data()) return *v;
    struct Held {
        VolumePtr volume;
    };
    auto held = Keep::instance().get<Held>(owner, key("dense"), [&](std::uint64_t& bytes) {
        auto out = std::make_shared<Held>();
        if (auto* v = std::get_if<VolumePtr>(&source)) {
            out->volume = in_memory(*v, ev.stop(),
                                    [&](double f) { ev.progress(0.5 * f, "reading the volume"); });
        } else {
            const BricksPtr& bricks = std::get<BricksPtr>(source);
            const VolumeDesc& desc = bricks->desc().volume;
            Buffer voxels(desc.dense_bytes(), "decoded volume");
            const std::uint64_t slice =
                std::uint64_t(desc.dims.x) * std::uint64_t(desc.dims.y) * desc.voxel_bytes();
            const std::int64_t step = bricks->desc().brick.z;
            for (std::int64_t z = 0; z < desc.dims.z; z += step) {
                const std::int64_t end = std::min(z + step, desc.dims.z);
                read_region(bricks, 0, {{0, 0, z}, {desc.dims.x, desc.dims.y, end}},
                            voxels.bytes().subspan(slice * std::uint64_t(z),
                                                   slice * std::uint64_t(end - z)),
                            BrickCache::global(), ev.stop());
                ev.progress(0.5 * double(end) / double(desc.dims.z), "decoding bricks");
            }
            VolumeDesc plain = desc;
            plain.has_mask = false;
            out->volume = std::make_shared<DenseVolume>(plain, std::move(voxels));
        }
        bytes += out->volume->resident_bytes();
        return out;
    });
    return held->volume;
}

struct Prepared {
    VolumePtr volume;
    std::shared_ptr<const gpu::FieldSource> field;
    std::optional<BrickScene> bricks;  // in place of the volume and its blocks
    std::shared_ptr<const BlockRanges> blocks;
    Hash blocks_key;
    glm::vec3 block_size{1.0f};     // index coordinates
    glm::ivec3 block_grid{0};
    ValueRange range;               // of the tables; covers what reconstruction can give
    TexturePtr occupancy;           // null: nothing to leap over
    TexturePtr ceiling;             // for maxima: the largest u of every block
    std::size_t seen = 0;           // blocks
    // Per texel unit; see Gradients.
    struct Stored {
        TexturePtr texture;
        float scale;
    };
    std::shared_ptr<const Stored> gradient;
    TexturePtr classified, slabs, integral, emission, emission_2d;
};

struct KeptTexture {
    TexturePtr texture;
};

// `build` gives a vector of glm::vec4, or of float for a single channel.
template <class Build>
TexturePtr keep_table(const TransferPtr& transfer, const Hash& k, Evaluation& ev, GLenum target,
                      glm::ivec2 dims, const Build& build) {
    return Keep::instance().get<KeptTexture>(transfer, k, [&](std::uint64_t& bytes) {
        const std::int64_t start = wall_ns();
        const auto table = build();
        const bool single = std::is_same_v<decltype(table), const std::vector<float>>;
        Keep::instance().make_room(table.size() * sizeof(table[0]));
        auto t = std::make_shared<gpu::Texture>(
            gpu::make_texture(target, single ? GL_R32F : GL_RGBA32F, {dims, 1}, GL_LINEAR, "the table of the transfer function"));
        gpu::upload(*t, {0, 0, 0}, {dims, 1}, single ? GL_RED : GL_RGBA, GL_FLOAT, table.data());
        bytes += t->bytes;
        ev.count("table ms", double(wall_ns() - start) * 1e-6);
        ev.count("bytes uploaded", double(t->bytes));
        return std::make_shared<KeptTexture>(KeptTexture{t});
    })->texture;
}

bool is_slabs(const S& s) {
    return s.compositing == S::Compositing::over || s.compositing == S::Compositing::x_ray;
}
bool is_shaded(const S& s) { return s.shading && s.compositing != S::Compositing::x_ray; }
bool is_modulated(const S& s) {
    return s.modulation != glm::dvec2(0) && s.compositing != S::Compositing::isosurface;
}
bool uses_gradient(const Scene& scene) {
    return is_shaded(scene.settings) || is_modulated(scene.settings) || scene.transfer->two;
}

double smoothing_side(S::Gradient g) {
    return g == S::Gradient::central ? 0.0 : g == S::Gradient::sobel ? 0.25 : 1.0 / 6.0;
}

// Whether anything with values between lo and hi is seen, where none is below `least`.
bool is_visible(const Scene& scene, double least, double lo, double hi) {
    const S& s = scene.settings;
    if (s.compositing == S::Compositing::isosurface) return lo <= s.iso_value && s.iso_value <= hi;
    // Below a value up to which all is transparent, no maximum is seen.
    return scene.transfer->max_extinction(s.compositing == S::Compositing::mip ? least : lo, hi) > 0;
}

// All that is_visible() depends on beside the values.
Hash what_is_visible(const Scene& scene) {
    const S& s = scene.settings;
    if (s.compositing == S::Compositing::isosurface) return key("iso", s.iso_value);
    return s.compositing == S::Compositing::mip ? key("mip", hash_of(*scene.transfer), {}) : hash_of(*scene.transfer);
}

// Which blocks can be seen, and how far to leap where they cannot.
void find_occupancy(const Scene& scene, const std::shared_ptr<const void>& owner, Prepared& p,
                    Evaluation& ev) {
    struct Kept {
        TexturePtr texture;
        std::size_t seen = 0;
    };
    auto kept = Keep::instance().get<Kept>(
        owner, key("occupancy", what_is_visible(scene), p.blocks_key),
        [&](std::uint64_t& bytes) {
            auto out = std::make_shared<Kept>();
            std::vector<std::uint8_t> seen(p.blocks->count());
            for (std::size_t i = 0; i < seen.size(); ++i) {
                const glm::dvec2 r(p.blocks->ranges[i]);
                if (r.x > r.y) continue;  // no valid voxel
                seen[i] = is_visible(scene, p.blocks->all.min, r.x, r.y);
                out->seen += seen[i];
            }
            if (out->seen == 0) return out;
            std::vector<std::int8_t> distances = leaps(p.blocks->grid, seen);
            auto t = std::make_shared<gpu::Texture>(gpu::make_texture(
                GL_TEXTURE_3D, GL_R8I, p.blocks->grid, GL_NEAREST, "the blocks of the volume"));
            gpu::upload(*t, {0, 0, 0}, p.blocks->grid, GL_RED_INTEGER, GL_BYTE, distances.data());
            bytes += t->bytes + distances.size();
            out->texture = t;
            return out;
        });
    p.occupancy = kept->texture;
    p.seen = kept->seen;
    p.block_size = glm::vec3(float(p.blocks->size));
    p.block_grid = p.blocks->grid;
    ev.count("blocks", double(p.blocks->count()));
    ev.count("blocks drawn", double(p.seen));
    ev.count("blocks skipped (transparent)", double(p.blocks->count() - p.seen));
}

// Voxels of neighbours around a brick, so that its own are enough for what is drawn.
Apron apron_for(const Scene& scene) {
    const bool stencil = uses_gradient(scene) && !scene.settings.gradient_stored;
    const int wider = stencil + (scene.settings.reconstruction == S::Reconstruction::tricubic);
    return {wider, wider + 1};
}

bool is_classified_before(const Scene& scene) {
    return scene.settings.classification == S::Classification::pre && is_slabs(scene.settings) && !scene.transfer->two;
}

// Bricks in place of a volume: what is asked for, and what that comes to.
struct BrickJob {
    BrickRequest request;
    BrickPlan plan;
};

// `view` lives as long as the job.
BrickJob plan_bricks(const Scene& scene, const View& view, Evaluation& ev) {
    const S& s = scene.settings;
    const bool cubic = s.reconstruction == S::Reconstruction::tricubic;
    BrickJob job;
    BrickRequest& request = job.request;
    request.component = s.component;
    request.apron = apron_for(scene);
    request.gpu_bytes = s.gpu_bytes;
    if (uses_gradient(scene) && s.gradient_stored) request.gradient_side = smoothing_side(s.gradient);
    if (is_classified_before(scene)) {
        request.transfer = scene.transfer;
        request.slab = view.plane_distance;
    }
    request.visible = [&scene, cubic](double least, double lo, double hi) {
        if (cubic && lo < hi) {
            const double middle = 0.5 * lo + 0.5 * hi, half = kCubicOvershoot * (0.5 * hi - 0.5 * lo);
            lo = middle - half;
            hi = middle + half;
        }
        return is_visible(scene, least, lo, hi);
    };
    request.visible_key = cubic ? key("cubic", what_is_visible(scene), {}) : what_is_visible(scene);
    request.mix_when_loaded = s.reconstruction == S::Reconstruction::trilinear && (!uses_gradient(scene) || s.gradient_stored);
    request.in_view = [&view](const Box& box) { return view.may_meet(box); };
    const TransferFunction2D* two = scene.transfer->two.get();
    const std::uint64_t texels = two ? std::uint64_t(two->dims.x) * std::uint64_t(two->dims.y)
                                 : s.classification == S::Classification::pre_integrated && is_slabs(s)
                                     ? std::uint64_t(s.table_size) * std::uint64_t(s.table_size) + kIntegralNodes
                                     : kEmissionBins;
    request.table_bytes = texels * sizeof(glm::vec4);
    job.plan = slicer::plan_bricks(std::get<BricksPtr>(scene.source), scene.selection.get(), request, ev);
    return job;
}

void prepare_bricks(BrickJob& job, bool what_is_there, Evaluation& ev, Prepared& p) {
    p.bricks = load_bricks(job.plan, job.request, ev, what_is_there);
    p.field = p.bricks->field;
    p.range = p.bricks->range;
    if (const BrickOccupancy* o = p.bricks->occupancy.get()) {
        p.occupancy = o->texture;
        p.seen = o->seen;
        p.block_size = o->block_size;
        p.block_grid = o->blocks;
    }
    if (!p.bricks->field) return;
    const Atlas& atlas = *p.bricks->atlas;
    if (job.request.gradient_side)
        p.gradient = std::make_shared<Prepared::Stored>(Prepared::Stored{atlas.gradients(), atlas.texels().gradient_scale});
    if (job.request.transfer) p.classified = atlas.colours();
}

void prepare_volume(const Scene& scene, const View& view, const std::shared_ptr<const void>& owner,
                    Evaluation& ev, Prepared& p) {
    const S& s = scene.settings;
    Keep& keep = Keep::instance();
    p.volume = dense(scene.source, owner, ev);
    const Volume& volume = *p.volume;
    const VolumeDesc& desc = volume.desc();
    const bool cubic = s.reconstruction == S::Reconstruction::tricubic;

    p.blocks_key = key("ranges", s.component, s.block_size, cubic, view.square_reach());
    p.blocks = keep.get<BlockRanges>(
        owner, p.blocks_key, [&](std::uint64_t& bytes) {
            ev.progress(0.5, "looking for empty blocks");
            auto b = std::make_shared<BlockRanges>(block_ranges(
                volume, s.component, s.block_size, view.square_reach(), cubic, ev.stop()));
            bytes += b->count() * sizeof(glm::vec2);
            return b;
        });
    find_occupancy(scene, owner, p, ev);
    if (p.seen == 0) return;

    p.range = p.blocks->all;

    p.field = keep.get<gpu::FieldSource>(
        owner, key("source", desc.color ? -1 : s.component), [&](std::uint64_t& bytes) {
            ev.progress(0.55, "uploading the volume");
            auto field = std::make_shared<gpu::FieldSource>();
            if (auto given = gpu::provided_source(scene.source, {s.component, ev.stop()}))
                *field = *given;
            else
                field->voxels = gpu::upload_dense(volume, s.component, ev.stop(), bytes);
            ev.count("bytes uploaded", double(bytes));
            return field;
        });
}

// `view` gets the slices of the level where only one is drawn.
Prepared prepare(const Scene& scene, View& view, const VolumeDesc& desc, BrickJob* bricks, bool what_is_there,
                 const std::shared_ptr<const void>& owner, Evaluation& ev) {
    const S& s = scene.settings;
    const TransferFunction& tf = *scene.transfer;
    Keep& keep = Keep::instance();
    Prepared p;
    if (bricks)
        prepare_bricks(*bricks, what_is_there, ev, p);
    else
        prepare_volume(scene, view, owner, ev, p);
    if (p.seen == 0) return p;
    if (p.bricks) view.widen_slices(p.bricks->step);
    const glm::ivec3 dims(desc.dims);
    const gpu::VoxelSource& voxels = p.field->voxels;
    if (p.range.min == p.range.max) {
        // A constant volume: a narrow range around its value, which then lies in the middle of the table.
        double w = 1e-3 * (is_float(desc.type) && p.range.min != 0 ? std::abs(p.range.min) : voxels.scale);
        p.range = {p.range.min - w, p.range.max + w};
    }

    if (uses_gradient(scene) && s.gradient_stored && !p.field->own_kernels && !p.bricks)
        p.gradient = keep.get<Prepared::Stored>(
            owner, key("gradient", s.gradient, desc.color ? -1 : s.component), [&](std::uint64_t& bytes) {
                ev.progress(0.6, "computing gradients");
                Gradients g(*p.volume, s.component, voxels.offset, voxels.scale, smoothing_side(s.gradient));
                float largest = g.largest(ev.stop());
                float inverse = largest > 0 ? 1 / largest : 0;
                auto t = gpu::upload_computed(
                    dims, GL_RGBA16_SNORM, "the gradients of the volume",
                    [&](int z, glm::vec4* out) {
                        g.slice(z, out);
                        for (std::int64_t i = 0; i < desc.dims.x * desc.dims.y; ++i) out[i] *= inverse;
                    }, ev.stop());
                bytes += t->bytes;
                ev.count("bytes uploaded", double(t->bytes));
                return std::make_shared<Prepared::Stored>(Prepared::Stored{t, largest});
            });

    if (s.compositing == S::Compositing::mip && s.skipping && p.blocks)
        p.ceiling = keep.get<KeptTexture>(
            owner, key("ceiling", p.blocks_key, {}), [&](std::uint64_t& bytes) {
                std::vector<float> largest;
                for (glm::vec2 r : p.blocks->ranges)
                    largest.push_back(float((double(r.y) - p.range.min) / p.range.extent()));
                auto t = std::make_shared<gpu::Texture>(gpu::make_texture(
                    GL_TEXTURE_3D, GL_R32F, p.blocks->grid, GL_NEAREST, "the blocks of the volume"));
                gpu::upload(*t, {0, 0, 0}, p.blocks->grid, GL_RED, GL_FLOAT, largest.data());
                bytes += t->bytes;
                return std::make_shared<KeptTexture>(KeptTexture{t});
            })->texture;

    const double d = view.plane_distance;
    const double thickness = is_slabs(s) ? d : tf.reference_length;
    const Hash tables = key("", p.range.min, p.range.max, d);
    const bool slabs = is_slabs(s);
    if (tf.two) {
        const glm::ivec2 size = tf.two->dims;
        p.emission_2d = keep_table(scene.transfer, key("2d", tables, key("", thickness)), ev,
                                   GL_TEXTURE_2D, size,
                                   [&] { return emission_table_2d(*tf.two, thickness); });
    } else if (is_classified_before(scene)) {
        if (!p.classified) p.classified = keep.get<KeptTexture>(
            owner, key("classified", hash_of(tf), key("", d, s.component)), [&](std::uint64_t& bytes) {
                ev.progress(0.7, "classifying the voxels");
                auto t = gpu::upload_computed(
                    dims, GL_RGBA32F, "the classified volume",
                    [&](int z, glm::vec4* out) {
                        classify_slice(*p.volume, s.component, tf.one, d, z, out);
                    }, ev.stop());
                bytes += t->bytes;
                ev.count("bytes uploaded", double(t->bytes));
                return std::make_shared<KeptTexture>(KeptTexture{t});
            })->texture;
    } else if (slabs && s.classification == S::Classification::pre_integrated) {
        // One table a slice distance, one below the other.
        const int layers = p.bricks ? p.bricks->steps : 1;
        p.slabs = keep_table(
            scene.transfer, key("slabs", tables, key("", s.table_size, layers)), ev, GL_TEXTURE_2D,
            {s.table_size, s.table_size * layers}, [&] {
                std::vector<glm::vec4> all;
                for (int layer = 0; layer < layers; ++layer) {
                    const auto one = preintegrated_table(tf.one, p.range, s.table_size, std::ldexp(d, layer), ev.stop());
                    all.insert(all.end(), one.begin(), one.end());
                }
                return all;
            });
        if (has_narrow_peak(tf.one, p.range, s.table_size))
            p.integral = keep_table(scene.transfer, key("integral", tables, {}), ev, GL_TEXTURE_1D, {kIntegralNodes, 1},
                                    [&] { return depth_integral(tf.one, p.range, kIntegralNodes, d); });
    } else if (s.compositing != S::Compositing::isosurface) {
        p.emission = keep_table(scene.transfer, key("emission", tables, key("", thickness)), ev,
                                GL_TEXTURE_1D, {kEmissionBins, 1}, [&] {
                                    return emission_table(tf.one, p.range, kEmissionBins, thickness);
                                });
    }
    return p;
}

// --- the shader --------------------------------------------------------------------------------

// The scene's lights as the shader wants them: those at the eye, where halfway is no other direction,
// are one and cheap.
struct Lighting {
    Lighting(const Scene& scene, const View& view)
        : given(scene.lights ? *scene.lights : Lights{}) {
        for (const Light& l : given.lights) {
            glm::dvec4 at(-scene.camera->forward(), 0.0);
            if (l.kind == Light::Kind::directional) at = {glm::normalize(l.position), 0.0};
            if (l.kind == Light::Kind::point)
                at = {(l.position - view.middle_world) / view.diagonal, 1.0};
            if (glm::distance(at, view.eye_place) < 1e-9) {
                eye_color += glm::vec3(l.color);
                at_eye = true;
            } else {
                place.push_back(glm::vec4(at));
                color.push_back(glm::vec3(l.color));
            }
        }
    }
    void set(const gpu::Program& program) const {
        for (std::size_t i = 0; i < place.size(); ++i) {
            program.set(fmt::format("light_place[{}]", i).c_str(), place[i]);
            program.set(fmt::format("light_color[{}]", i).c_str(), color[i]);
        }
        program.set("eye_light_color", eye_color);
        program.set("material",
                    glm::vec4(given.ambient, given.diffuse, given.specular, given.shininess));
    }
    Lights given;
    bool at_eye = false;
    glm::vec3 eye_color{0.0f};
    std::vector<glm::vec4> place;  // of the others
    std::vector<glm::vec3> color;
};

gpu::ProgramPtr assemble(const Scene& scene, const Prepared& p, const Lighting& lighting) {
    const S& s = scene.settings;
    const gpu::VoxelSource& voxels = p.field->voxels;
    const bool slabs = is_slabs(s), shading = is_shaded(s), modulation = is_modulated(s);
    const bool gradient = uses_gradient(scene);

    // Whether any invocation of a SIMD group has x; its own x where the driver cannot tell.
    std::string choices = epoxy_has_gl_extension("GL_ARB_shader_group_vote")
                              ? "#extension GL_ARB_shader_group_vote : require\n"
                                "#define ANY(x) anyInvocationARB(x)\n"
                              : "#define ANY(x) (x)\n";
    auto choose = [&](bool on, std::string_view name) {
        if (on) choices += fmt::format("#define {}\n", name);
    };
    choose(voxels.color, "COLOR");
    choose(voxels.has_validity, "VALIDITY");
    choose(gpu::context_info().software, "EXACT_FILTER");
    choose(s.ray_length, "RAY_LENGTH");
    choose(s.skipping && p.occupancy, "SKIPPING");
    choose(p.ceiling != nullptr, "CEILING");
    choose(gradient, "GRADIENT");
    choose(p.emission_2d != nullptr, "TRANSFER_2D");
    choose(p.integral != nullptr, "NARROW_PEAKS");
    choose(shading, "SHADING");
    choose(modulation, "MODULATION");
    choose(lighting.at_eye, "EYE_LIGHT");
    const bool paged = p.bricks && !p.bricks->one_level;
    choose(paged && p.bricks->blended, "BLENDED");
    choose(paged && p.bricks->steps > 1, "STEPS");
    choose(paged && p.bricks->steps > 1 && p.slabs, "LEVEL_TABLES");
    // Planes to the next slice and of how many of the finest level's slabs one is, index steps to the next
    // voxel, the way to a plane's voxels.
    choices += fmt::format("#define PLANE_STEP {}\n#define SLAB_STEP {}\n#define VOXEL_STEP {}\n#define VISIT(m) {}\n#define MARCH {}\n",
                           paged ? "page_step" : "1.0",
                           fmt::format("{:.1f}", p.bricks && !paged ? p.bricks->step : 1.0),
                           p.bricks ? "(1.0 / page_scale)" : "vec3(1.0)", paged ? "open_page(ray_at(m))" : "",
                           paged ? "march_bricks" : "march");
    // A parent's gradients are per step of its own level.
    const std::string_view at = p.bricks ? "at" : "reconstruct";
    choices += paged && p.bricks->blended
                   ? "#define GRADIENT_AT(p) mix(gradient_own(p), gradient_parent(p) * vec4(parent_scale / page_scale, 1.0), share_of_parent(p))\n"
                   : fmt::format("#define GRADIENT_AT gradient_{}\n", at);
    choices += fmt::format("#define CLASSIFIED_AT classified_{}\n", at);
    choices += fmt::format("#define LIGHTS {}\n#define SIDE {:.9f}\n", lighting.place.size(),
                           smoothing_side(s.gradient));

    const char* kernels[] = {"reconstruction-nearest", "reconstruction-trilinear",
                             "reconstruction-tricubic"};
    const Module kernel = module(kernels[int(s.reconstruction)]);
    std::vector<Module> parts = {{"choices", choices}, module("ray"), voxels.glsl};
    // What else is known of the voxels, in a texture like theirs.
    auto texture_of = [&](const std::string& prefix) {
        parts.push_back(over(p.bricks ? module("texels-in-slots") : gpu::dense_module(), prefix));
        parts.push_back(over(kernel, prefix));
        if (p.bricks) parts.push_back(with(module("at-point"), "TEXELS", prefix));
    };
    if (p.bricks) {
        texture_of("brick");
        parts.push_back(module("reconstruction-bricks"));
    } else if (!p.field->own_kernels) {
        if (!voxels.linear) parts.push_back(module("linear-from-voxels"));
        parts.push_back(kernel);
    }
    parts.push_back(module("scalar"));
    if (gradient) {
        if (p.gradient) {
            texture_of("gradient");
            parts.push_back(module("gradient-stored"));
        } else if (!p.field->own_kernels) {
            parts.push_back(module(s.gradient == S::Gradient::central ? "gradient-central"
                                                                      : "gradient-smoothed"));
        }
        parts.push_back(module("gradient-world"));
    }
    if (shading) parts.push_back(module("shading"));
    if (modulation) parts.push_back(module("modulation"));

    if (p.emission_2d) parts.push_back(module("emission-2d"));
    if (p.emission) parts.push_back(module("emission"));

    if (!slabs) {
        parts.push_back(module("classification-value"));
        parts.push_back(module(s.compositing == S::Compositing::mip ? "march-mip" : "march-isosurface"));
    } else {
        if (p.classified) {
            texture_of("classified");
            parts.push_back(module("classification-pre"));
        } else {
            parts.push_back(module(p.slabs ? "classification-pre-integrated" : "classification-post"));
        }
        parts.push_back(module(s.compositing == S::Compositing::over ? "compositing-over"
                                                                     : "compositing-x-ray"));
        parts.push_back(module(shading || modulation ? "march-slabs-late" : "march-slabs"));
    }
    if (paged) parts.push_back(module("march-bricks"));
    parts.push_back(module("view-aligned"));
    return gpu::program({module("proxy-screen")}, parts);
}

void set_uniforms(const gpu::Program& program, const Scene& scene, const View& view,
                  const VolumeDesc& desc, const Prepared& p, const Lighting& lighting) {
    const S& s = scene.settings;
    const gpu::VoxelSource& voxels = p.field->voxels;
    view.set(program);
    if (p.bricks) p.bricks->set(program);

    int unit = 0;
    for (const gpu::SourceTexture& t : voxels.textures) program.bind(t.sampler.c_str(), unit++, *t.texture);
    const glm::vec3 inverse = 1.0f / glm::vec3(desc.dims);
    const glm::ivec3 last(desc.dims - Index3(1));
    for (const char* prefix : {"", "gradient_", "classified_"}) {
        if (p.bricks) break;
        program.set((std::string(prefix) + "dense_inverse_dims").c_str(), inverse);
        program.set((std::string(prefix) + "dense_last").c_str(), last);
    }
    if (p.gradient) {
        program.bind("gradient_dense_texture", unit++, *p.gradient->texture);
        program.set("gradient_scale", p.gradient->scale);
    }
    if (p.classified) program.bind("classified_dense_texture", unit++, *p.classified);
    if (p.slabs) {
        program.bind("slab_table", unit++, *p.slabs);
        const double n = s.table_size;
        program.set("slab_map", glm::vec2((n - 1) / n, 0.5 / n));
    }
    if (p.integral) {
        program.bind("depth_integral", unit++, *p.integral);
        program.set("integral_map", glm::vec2((kIntegralNodes - 1.0) / kIntegralNodes, 0.5 / kIntegralNodes));
    }
    if (p.emission) {
        program.bind("emission_table", unit++, *p.emission);
        program.set("emission_bins", float(kEmissionBins));
    }
    const double extent = p.range.extent();
    program.set("table_map", glm::vec2(voxels.scale / extent, (voxels.offset - p.range.min) / extent));
    // A gradient in values per world length, from one in texel units per smallest spacing.
    const double to_physical = voxels.scale / view.smallest_spacing;
    if (p.emission_2d) {
        program.bind("emission_table_2d", unit++, *p.emission_2d);
        const TransferFunction2D& two = *scene.transfer->two;
        auto map = [](ValueRange r, int n, double offset, double scale) {
            double per_value = r.extent() > 0 ? (n - 1) / r.extent() : 0;
            return glm::dvec2(scale * per_value, (offset - r.min) * per_value + 0.5) / double(n);
        };
        program.set("emission_map_2d",
                    glm::vec4(glm::vec2(map(two.value, two.dims.x, p.range.min, extent)),
                              glm::vec2(map(two.gradient, two.dims.y, 0, to_physical))));
    }
    const glm::dvec2 modulation = s.modulation / to_physical;
    program.set("modulation_range",
                glm::vec2(modulation.x, 1 / std::max(modulation.y - modulation.x, 1e-30)));
    program.set("flat_gradient", 1e-7f);
    if (s.skipping && p.occupancy) {
        program.bind("occupancy", unit++, *p.occupancy);
        if (p.ceiling) program.bind("ceiling", unit++, *p.ceiling);
        program.set("block_size", p.block_size);
        program.set("block_last", p.block_grid - 1);
    }
    program.set("saturated", float(1 - s.early_termination));
    program.set("iso_level", float((s.iso_value - p.range.min) / extent));
    program.set("iso_color", glm::vec3(color_of(scene.transfer->one.at(s.iso_value))));
    program.set("background", background(s));
    lighting.set(program);
}

// --- drawing -----------------------------------------------------------------------------------

// Draws what the volume can cover, in batches of rows that end often enough for a cancellation to be
// prompt; the rest is background.
void draw(const gpu::Program& program, const Target& target, const View& view, glm::vec4 background,
          Evaluation& ev) {
    constexpr double kBatchSeconds = 0.03;
    const std::int64_t begin = wall_ns();
    const bool coarse = target.size != view.size;
    const glm::dvec2 scale = glm::dvec2(view.size) / glm::dvec2(target.size);
    program.set("pixel_scale", glm::vec2(scale));
    program.set("square", coarse ? 1.0f : float(view.square));
    program.set("square_reach", coarse ? 0.0f : float(view.square_reach()));
    glBindFramebuffer(GL_FRAMEBUFFER, target.framebuffer.name());
    glBindVertexArray(target.vertices.name());
    glUseProgram(program.name());
    glViewport(0, 0, target.size.x, target.size.y);
    glDisable(GL_BLEND);
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_SCISSOR_TEST);
    const glm::vec4 nothing(0.0f);
    glClearNamedFramebufferfv(target.framebuffer.name(), GL_COLOR, 0, &background[0]);
    glClearNamedFramebufferfv(target.framebuffer.name(), GL_COLOR, 1, &nothing[0]);
    glEnable(GL_SCISSOR_TEST);
    // Whole tiles of the software rasteriser.
    constexpr int kTile = 64;
    const glm::ivec2 lo = glm::ivec2(glm::floor(glm::dvec2(view.bounds) / scale));
    const glm::ivec2 hi = glm::min(
        glm::ivec2(glm::ceil(glm::dvec2(view.bounds.z, view.bounds.w) / scale)), target.size);
    int rows = std::max(kTile, (hi.y - lo.y) / 4 / kTile * kTile);
    for (int y = lo.y; y < hi.y;) {
        check_stop(ev.stop());
        const int n = std::min(rows - y % kTile, hi.y - y);
        const std::int64_t start = wall_ns();
        glScissor(lo.x, y, hi.x - lo.x, n);
        glDrawArrays(GL_TRIANGLES, 0, 3);
        glFinish();
        const double seconds = double(wall_ns() - start) * 1e-9;
        y += n;
        // Never more than four times the last batch, since the next rows may be dearer.
        const double next = double(n) * std::min(kBatchSeconds / std::max(seconds, 1e-6), 4.0);
        rows = std::max(int(next) / kTile * kTile, kTile);
        ev.progress(0.8 + 0.2 * double(y) / double(target.size.y), "drawing");
    }
    glFinish();
    glDisable(GL_SCISSOR_TEST);
    gpu::check_errors("drawing");
    ev.add_draw_seconds(double(wall_ns() - begin) * 1e-9);
}

void count_samples(const Target& target, Evaluation& ev) {
    std::vector<float> samples(std::size_t(target.size.x) * std::size_t(target.size.y));
    glReadBuffer(GL_COLOR_ATTACHMENT1);
    glReadPixels(0, 0, target.size.x, target.size.y, GL_RED, GL_FLOAT, samples.data());
    double sum = 0, rays = 0, ended = 0;
    for (float s : samples) {
        sum += std::abs(s);
        rays += s != 0;
        ended += s < 0;
    }
    ev.count("samples", sum);
    ev.count("rays", rays);
    ev.count("rays ended by opacity", ended);
}

// Every pixel of the coarse picture as a square of the full one.
ImagePtr enlarged(const Image& coarse, glm::ivec2 size) {
    auto out = std::make_shared<Image>(size, Image::Format::rgba32f);
    auto from = coarse.rgba32f();
    auto to = out->rgba32f();
    for (int y = 0; y < size.y; ++y)
        for (int x = 0; x < size.x; ++x)
            to[std::size_t(y) * std::size_t(size.x) + std::size_t(x)] =
                from[std::size_t(y * coarse.size().y / size.y) * std::size_t(coarse.size().x) +
                     std::size_t(x * coarse.size().x / size.x)];
    return out;
}

ImagePtr only_background(const S& s) {
    auto image = std::make_shared<Image>(s.size, Image::Format::rgba32f);
    std::ranges::fill(image->rgba32f(), background(s));
    return image;
}

// What is there of the bricks, a quarter the size, as long as others are decoded: the first time after
// first_picture seconds, then whenever as much time has gone by as the last picture took, or as that.
void show_while_decoding(const Scene& scene, const View& view, const VolumeDesc& desc, BrickJob& job,
                         const std::shared_ptr<const void>& owner, Evaluation& ev) {
    const S& s = scene.settings;
    const std::vector<BrickId> missing = job.plan.missing();
    if (missing.empty()) return;
    Decoding decoding(job.plan.bricks, missing, kAround, 0);
    double wait = s.first_picture;
    while (!decoding.wait(wait, ev.stop())) {
        const std::int64_t start = wall_ns();
        View slices = view;
        const Prepared p = prepare(scene, slices, desc, &job, true, owner, ev);
        if (p.seen > 0) {
            const Lighting lighting(scene, slices);
            const gpu::ProgramPtr program = assemble(scene, p, lighting);
            set_uniforms(*program, scene, slices, desc, p, lighting);
            Target coarse(glm::max(s.size / 4, glm::ivec2(1)));
            draw(*program, coarse, slices, background(s), ev);
            ev.provisional("image", enlarged(*read_back(coarse), s.size));
            ev.count("provisional pictures");
        }
        wait = std::max(s.first_picture, double(wall_ns() - start) * 1e-9);
    }
}

// Whether one texture can hold the volume, and gpu_memory, or at least a gigabyte, has room for it.
bool fits_as_volume(const VolumeDesc& desc, std::uint64_t gpu_bytes) {
    const int limit = gpu::context_info().max_texture_3d;
    const double texels = double(desc.voxels()) * (bytes_of(desc.type) > 2 ? 4 : 2) * (desc.color ? 4 : 1);
    return desc.dims.x <= limit && desc.dims.y <= limit && desc.dims.z <= limit &&
           texels <= std::max(double(gpu_bytes), double(1 << 30));
}

}  // namespace

ImagePtr render(const Scene& scene, Evaluation& ev) {
    gpu::require_context();
    const S& s = scene.settings;
    const VolumeDesc desc = std::holds_alternative<VolumePtr>(scene.source)
                                ? std::get<VolumePtr>(scene.source)->desc()
                                : std::get<BricksPtr>(scene.source)->desc().volume;
    Keep::instance().begin(s.gpu_bytes);
    std::shared_ptr<const void> owner;
    if (auto* v = std::get_if<VolumePtr>(&scene.source))
        owner = *v;
    else
        owner = std::get<BricksPtr>(scene.source);
    if (desc.voxels() == 0) return only_background(s);
    if (s.component >= desc.components)
        fail("component {} is asked for, but the volume has {}", s.component, desc.components);

    // Bricks of which a view takes a part; all of level 0 is drawn as a volume where it fits.
    const bool as_bricks = std::holds_alternative<BricksPtr>(scene.source) &&
                           (scene.selection || !fits_as_volume(desc, s.gpu_bytes));
    if (!as_bricks) gpu::check_fits_texture(desc);

    View view(*scene.camera, desc, s.size, s.slice_distance);
    if (view.planes > kMostPlanes) {
        const double coarser = s.slice_distance * view.planes / kMostPlanes;
        ev.warn(fmt::format("slice_distance {} would need {:.0f} slices along this view; drawn with {} "
                            "instead", s.slice_distance, view.planes, coarser));
        view = View(*scene.camera, desc, s.size, coarser);
    }
    if (as_bricks) view.limit_reach(kReach - (s.reconstruction == S::Reconstruction::tricubic));

    const View planned = view;
    std::optional<BrickJob> job;
    if (as_bricks) job = plan_bricks(scene, planned, ev);
    if (job && ev.wants_provisional() && s.first_picture > 0) show_while_decoding(scene, view, desc, *job, owner, ev);
    const std::int64_t start = wall_ns();
    Prepared prepared = prepare(scene, view, desc, job ? &*job : nullptr, false, owner, ev);
    ev.count("prepare ms", double(wall_ns() - start) * 1e-6);
    ev.count("slices", std::ceil(view.planes));
    if (prepared.seen == 0) {
        Keep::instance().shrink(s.gpu_bytes);
        return only_background(s);
    }
    const Lighting lighting(scene, view);
    gpu::ProgramPtr program = assemble(scene, prepared, lighting);
    set_uniforms(*program, scene, view, desc, prepared, lighting);

    if (ev.wants_provisional() && s.size.x * s.size.y > 128 * 128) {
        Target coarse(glm::max(s.size / 4, glm::ivec2(1)));
        draw(*program, coarse, view, background(s), ev);
        ev.provisional("image", enlarged(*read_back(coarse), s.size));
    }
    const Target& target = target_of(s.size);
    draw(*program, target, view, background(s), ev);
    std::shared_ptr<Image> image = read_back(target);
    count_samples(target, ev);
    ev.measure("GPU memory", double(Keep::instance().peak()), "bytes");
    Keep::instance().shrink(s.gpu_bytes);
    return image;
}

}  // namespace voxloom::slicer
