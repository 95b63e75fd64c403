// writers.volume: slab by slab from the volume to the disk.
#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "core/graph/node.h"
#include "core/base/output_file.h"
#include "plugins/writers/volume_header.h"
#include "plugins/writers/writers.h"

namespace voxloom {

namespace {

namespace fs = std::filesystem;

// What is in memory at a time; large enough for the reader's threads, small beside any volume.
constexpr std::uint64_t kSlabBytes = 16u << 20;

// A stream of bytes on its way to a file, deflated on the way where asked for. The gzip header
// carries neither time nor name, so the same voxels give the same file.
class Sink {
  public:
    Sink(OutputFile& file, bool gzip, int level) : file_(file), gzip_(gzip) {
        if (!gzip_) return;
        constexpr int window = 15 + 16;  // largest window, gzip wrapping
        if (deflateInit2(&stream_, level, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY) != Z_OK)
            fail("gzip: there is no memory for the compressor");
    }
    ~Sink() {
        if (gzip_) deflateEnd(&stream_);
    }
    Sink(const Sink&) = delete;
    Sink& operator=(const Sink&) = delete;

    void write(std::span<const std::byte> bytes) {
        if (!gzip_) return file_.write(bytes);
        constexpr std::size_t most = std::size_t(1) << 30;  // zlib counts in unsigned int
        for (; bytes.size() > most; bytes = bytes.subspan(most))
            deflate_all(bytes.first(most), Z_NO_FLUSH);
        deflate_all(bytes, Z_NO_FLUSH);
    }
    void finish() {
        if (gzip_) deflate_all({}, Z_FINISH);
    }

  private:
    void deflate_all(std::span<const std::byte> bytes, int flush) {
        // zlib does not write to its input; its type predates const.
        stream_.next_in = const_cast<Bytef*>(reinterpret_cast<const Bytef*>(bytes.data()));
        stream_.avail_in = uInt(bytes.size());
        do {
            stream_.next_out = reinterpret_cast<Bytef*>(out_.data());
            stream_.avail_out = uInt(out_.size());
            deflate(&stream_, flush);
            file_.write(std::span(out_).first(out_.size() - stream_.avail_out));
        } while (stream_.avail_out == 0);
    }

    OutputFile& file_;
    bool gzip_;
    z_stream stream_{};
    std::vector<std::byte> out_ = std::vector<std::byte>(gzip_ ? 1 << 18 : 0);
};

// Boxes that together are the volume in file order, each one run of the file and at most kSlabBytes
// large: whole slices, or rows of one slice, or parts of one row.
template <class F>
void for_each_slab(const VolumeDesc& desc, const F& f) {
    if (desc.voxels() == 0) return;
    const Index3 n = desc.dims;
    const std::int64_t most =
        std::max<std::int64_t>(1, std::int64_t(kSlabBytes / desc.voxel_bytes()));
    const std::int64_t row = n.x, slice = n.x * n.y;
    const Index3 step = most >= slice ? Index3(n.x, n.y, most / slice)
                        : most >= row ? Index3(n.x, most / row, 1)
                                      : Index3(most, 1, 1);
    for (std::int64_t z = 0; z < n.z; z += step.z)
        for (std::int64_t y = 0; y < n.y; y += step.y)
            for (std::int64_t x = 0; x < n.x; x += step.x)
                f(Box{{x, y, z}, glm::min(Index3(x, y, z) + step, n)});
}

// No format here holds a validity mask: in floats, NaN says the same.
void erase_invalid(const Volume& volume, const Box& box, std::span<std::byte> voxels) {
    std::vector<std::uint8_t> valid(box.voxels());
    volume.read_mask(box, valid);
    const auto components = std::size_t(volume.desc().components);
    with_type(volume.desc().type, [&](auto t) {
        using T = decltype(t);
        if constexpr (std::is_floating_point_v<T>) {
            T* out = reinterpret_cast<T*>(voxels.data());
            for (std::size_t i = 0; i < valid.size(); ++i)
                if (!valid[i])
                    std::fill_n(out + i * components, components,
                                std::numeric_limits<T>::quiet_NaN());
        }
    });
}

void write_voxels(const Volume& volume, Sink& sink, Evaluation& e) {
    const VolumeDesc& desc = volume.desc();
    const bool erase = desc.has_mask && is_float(desc.type);
    const double all = double(std::max<std::uint64_t>(desc.voxels(), 1));
    Buffer slab(
        std::min(desc.dense_bytes(), std::max<std::uint64_t>(kSlabBytes, desc.voxel_bytes())),
        "slab to write");
    double done = 0;
    for_each_slab(desc, [&](const Box& box) {
        check_stop(e.stop());
        const std::span<std::byte> voxels = slab.bytes().first(box.voxels() * desc.voxel_bytes());
        volume.read(box, voxels, e.stop());
        if (erase) erase_invalid(volume, box, voxels);
        sink.write(voxels);
        done += double(box.voxels());
        e.progress(done / all, "writing");
    });
    sink.finish();
}

// Why the parameters and the volume do not go together; no message when they do.
struct Refusal {
    std::string message, param;
};
Refusal refusal_of(const Params& params, const VolumeDesc* desc) {
    const fs::path path = params.path("path");
    const auto format = volume_format_of(path);
    if (!format)
        return {fmt::format("'{}' has none of the extensions {}", path.string(), kVolumeExtensions),
                "path"};
    if (params.text("compression") == "gzip" &&
        (*format == VolumeFormat::mha || *format == VolumeFormat::mhd))
        return {
            "MetaImage files are written without compression; write .nrrd, .nhdr or .raw to have "
            "gzip",
            "compression"};
    if (desc && desc->voxels() == 0 && *format != VolumeFormat::raw)
        return {
            "a volume without voxels can only be written as .raw; the other formats know no size 0",
            "path"};
    return {};
}

void write_volume(Evaluation& e) {
    VolumePtr volume = e.input<Volume>("volume");
    const VolumeDesc& desc = volume->desc();
    if (std::string why = refusal_of(e.params(), &desc).message; !why.empty()) fail("{}", why);
    const fs::path path = e.output_path("path");
    const VolumeFormat format = *volume_format_of(path);
    const bool gzip = e.params().text("compression") == "gzip";
    if (desc.has_mask && !is_float(desc.type))
        e.warn(
            "the validity mask is not kept: the voxels are integers, which have no NaN to say it "
            "with");
    // Else every slab would cost a reading of everything.
    if (!volume->reads_by_region()) volume = in_memory(volume, e.stop());

    // One file, or a header and a file of voxels beside it. The voxels get their name first: a
    // header never names what is not there.
    const bool detached = format == VolumeFormat::nhdr || format == VolumeFormat::mhd;
    fs::path data_path = path, header_path = path;
    if (detached) data_path.replace_extension(gzip ? ".raw.gz" : ".raw");
    if (format == VolumeFormat::raw) header_path += ".yaml";
    const std::string data_name = detached ? data_path.filename().string() : std::string();
    const std::string header = format == VolumeFormat::raw ? raw_sidecar(desc, gzip)
                               : format == VolumeFormat::nrrd || format == VolumeFormat::nhdr
                                   ? nrrd_header(desc, gzip, data_name)
                                   : meta_header(desc, data_name);

    OutputFile data(data_path);
    if (header_path == data_path) data.write(header);
    Sink sink(data, gzip, int(e.params().integer("level")));
    write_voxels(*volume, sink, e);
    std::uint64_t bytes = data.size();
    if (header_path != data_path) {
        OutputFile head(header_path);
        head.write(header);
        bytes += head.size();
        data.commit();
        head.commit();
    } else {
        data.commit();
    }
    e.measure("file size", double(bytes), "B");
    if (desc.dense_bytes() > 0 && gzip)
        e.measure("ratio", double(desc.dense_bytes()) / double(bytes));
}

void describe_writing(Description& d) {
    const ValueDesc* input = d.input("volume");
    const Refusal refusal = refusal_of(d.params(), input ? input->volume() : nullptr);
    if (!refusal.message.empty()) d.problem(refusal.message, refusal.param);
    d.working_memory(kSlabBytes);
}

}  // namespace

void add_volume_writer(Registry& registry) {
    NodeType type;
    type.id = "writers.volume";
    type.title = "Write volume";
    type.doc = "Writes a volume as NRRD, MetaImage or raw, slab by slab.";
    type.keywords = {"save", "export", "file",      "nrrd", "nhdr",
                     "mha",  "mhd",    "metaimage", "raw",  "gzip"};
    type.inputs = {{"volume", PortType::volume, "The volume to write."}};
    type.params = {
        param::path_out("path", "volume.nrrd",
                        "The file; its extension is the format: .nrrd, .nhdr, .mha, .mhd or .raw."),
        param::choice("compression", {"none", "gzip"}, "none",
                      "How the voxels are packed (not in MetaImage)."),
        param::integer("level", 6, "Effort of gzip: 1 is fast, 9 is small.")
            .range(1, 9)
            .slider(1, 9)
            .shown_if("compression", {"gzip"}),
    };
    type.writes_files = true;
    type.method =
        R"(The volume is read in slabs of 16 MiB and appended to the file, so that memory stays bounded whatever
its size; the file has a temporary name until it is whole. Dims, scalar type, components, spacing,
origin and all three axis directions are kept; NRRD and raw keep unit, name and significant bits too.
A validity mask becomes NaN in float types.

- `.nrrd`, `.nhdr`: the safest choice, read by most programs of the field.
- `.mha`, `.mhd`: for ITK and its relatives; no unit, no name.
- `.raw`: the bare voxels, described by a YAML file beside them, which readers.volume reads.

gzip makes a file that cannot be read by region. To compress volumes that are to be explored, use a codec.)";
    type.describe = describe_writing;
    type.evaluate = write_volume;
    registry.add(std::move(type));
}

}  // namespace voxloom
