#include "text_header.h"

#include <fmt/format.h>
#include <fmt/printf.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>

#include "core/base/error.h"
#include "core/base/text.h"
#include "volume_file.h"

namespace voxloom {

namespace fs = std::filesystem;

namespace {

std::string_view trim(std::string_view s) {
    auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
    while (!s.empty() && blank(s.front())) s.remove_prefix(1);
    while (!s.empty() && blank(s.back())) s.remove_suffix(1);
    return s;
}

// The next line without its end; `at` moves behind it. False at the end of the text.
bool next_line(std::string_view text, std::size_t& at, std::string_view& line) {
    if (at >= text.size()) return false;
    std::size_t end = text.find('\n', at);
    if (end == std::string_view::npos) end = text.size();
    line = text.substr(at, end - at);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    at = std::min(end + 1, text.size());
    return true;
}

std::string key_of(std::string_view text) {
    std::string key = lower(std::string(trim(text)));
    std::erase(key, ' ');
    return key;
}

// Words between blanks; "..." is one word without its quotes.
std::vector<std::string> split_words(std::string_view text) {
    std::vector<std::string> words;
    for (std::size_t i = 0; i < text.size();) {
        if (text[i] == ' ' || text[i] == '\t') {
            ++i;
        } else if (text[i] == '"') {
            std::size_t end = std::min(text.find('"', i + 1), text.size());
            words.emplace_back(text.substr(i + 1, end - i - 1));
            i = end + 1;
        } else {
            std::size_t end = std::min(text.find_first_of(" \t", i), text.size());
            words.emplace_back(text.substr(i, end - i));
            i = end;
        }
    }
    return words;
}

std::string get(const Fields& fields, std::string_view key) {
    auto it = fields.find(key);
    return it == fields.end() ? "" : it->second;
}

constexpr bool kBigEndianHost = std::endian::native == std::endian::big;

fs::path beside(const fs::path& header, const std::string& name) {
    return fs::path(name).is_absolute() ? fs::path(name) : header.parent_path() / name;
}

// The files of "head.%03d.raw 1 30 1". Empty when it is not such a pattern.
std::vector<std::string> files_of_pattern(const std::vector<std::string>& words) {
    std::int64_t first = 0, last = 0, step = 0;
    if (words.size() != 4 || !parse_integer(words[1], first) || !parse_integer(words[2], last) ||
        !parse_integer(words[3], step) || step == 0 || std::abs((last - first) / step) > 100000)
        return {};
    std::vector<std::string> names;
    try {
        for (std::int64_t i = first; step > 0 ? i <= last : i >= last; i += step)
            names.push_back(fmt::sprintf(words[0], i));
    } catch (const std::exception&) {
        return {};
    }
    return names;
}

}  // namespace

std::string read_head(const fs::path& path, std::size_t most) {
    std::ifstream in(path, std::ios::binary);
    if (!in) fail("{} cannot be opened: {}", path.string(), std::strerror(errno));
    std::string head(most, '\0');
    in.read(head.data(), std::streamsize(most));
    if (in.bad()) fail("{} cannot be read: {}", path.string(), std::strerror(errno));
    head.resize(std::size_t(in.gcount()));
    return head;
}

std::vector<std::string> NrrdHeader::words(std::string_view key) const {
    return split_words(get(fields, key));
}

NrrdHeader parse_nrrd_header(std::string_view head, const fs::path& path) {
    if (!head.starts_with("NRRD000"))
        fail("{} is not an NRRD file: it does not begin with NRRD000", path.string());
    NrrdHeader header;
    std::size_t at = 0;
    std::string_view line;
    next_line(head, at, line);
    bool complete = false;
    while (!complete && next_line(head, at, line)) {
        if (line.empty()) {
            complete = true;
        } else if (line.front() != '#' && line.find(":=") == std::string_view::npos) {
            std::size_t colon = line.find(": ");
            if (colon == std::string_view::npos) colon = line.find(':');
            if (colon == std::string_view::npos)
                fail("{}: the header line '{}' is not a 'field: value' pair", path.string(),
                     line.substr(0, 60));
            std::string key = key_of(line.substr(0, colon));
            std::string value(trim(line.substr(colon + 1)));
            if (key == "datafile" && value.starts_with("LIST")) {
                while (next_line(head, at, line))
                    if (!trim(line).empty()) header.data_files.emplace_back(trim(line));
            }
            header.fields[key] = value;
        }
    }
    header.end = at;
    for (const char* field : {"type", "dimension", "sizes", "encoding"})
        if (!header.fields.contains(field))
            fail("{}: the NRRD header has no '{}'; it is cut short or damaged", path.string(), field);
    double voxels = 1;
    for (const std::string& size : split_words(get(header.fields, "sizes"))) {
        std::int64_t n = 0;
        if (!parse_integer(size, n) || n < 1)
            fail("{}: the NRRD header says 'sizes: {}'; every size is a whole number of at least 1", path.string(),
                 get(header.fields, "sizes"));
        voxels *= double(n);
    }
    if (voxels > 9e18)
        fail("{}: the NRRD header says 'sizes: {}', more voxels than any file holds", path.string(), get(header.fields, "sizes"));
    // A detached header may end with the file; an attached one ends with a blank line.
    if (!complete && !header.fields.contains("datafile"))
        fail("{}: the NRRD header is cut short: no blank line ends it and no data file is named",
             path.string());
    return header;
}

Layout nrrd_layout(const NrrdHeader& header, const fs::path& path, int components,
                   std::uint64_t samples, std::size_t sample_bytes) {
    Layout layout;
    layout.files = {path};
    const std::string encoding = lower(get(header.fields, "encoding"));
    StoredVoxels stored;
    stored.packed = encoding == "gzip" || encoding == "gz";
    bool known = stored.packed || encoding == "raw";

    const std::vector<std::string> named = header.words("datafile");
    if (named.empty()) {
        stored.pieces = {{path, header.end}};
    } else {
        std::vector<std::string> names = named;
        if (named[0] == "LIST") {
            names = header.data_files;
            known = known && named.size() == 1;  // pieces of another dimension: teem's to arrange
        } else if (named.size() > 1) {
            names = files_of_pattern(named);
            // A name with blanks, written without quotes.
            if (names.empty()) names = {get(header.fields, "datafile")};
        }
        if (names.empty()) fail("{}: its list of data files is empty", path.string());
        for (const std::string& name : names) stored.pieces.push_back({beside(path, name), 0});
        for (const StoredVoxels::Piece& piece : stored.pieces) {
            if (!fs::exists(piece.file))
                fail("{}: its data file {} is not there", path.string(), piece.file.string());
            layout.files.push_back(piece.file);
        }
        known = known && (!stored.packed || stored.pieces.size() == 1);
    }

    std::int64_t skip = 0, lines = 0;
    if (header.fields.contains("byteskip"))
        known = known && parse_integer(get(header.fields, "byteskip"), skip);
    if (header.fields.contains("lineskip"))
        known = known && parse_integer(get(header.fields, "lineskip"), lines) && lines == 0;
    // Components are interleaved only where their axis comes first; others ITK rearranges.
    const std::vector<std::string> kinds = header.words("kinds");
    if (components > 1)
        known = known && !kinds.empty() && kinds[0] != "domain" && kinds[0] != "space" &&
                kinds[0] != "time";
    if (!known || skip < 0) {
        // Numbers as text take a digit and a blank, in hexadecimal two digits a byte.
        const bool text = encoding == "ascii" || encoding == "text" || encoding == "txt";
        if (stored.pieces.size() == 1 && samples > 0) {
            layout.data = stored.pieces[0].file;
            if (text) layout.least_bytes = stored.pieces[0].offset + 2 * samples - 1;
            if (encoding == "hex")
                layout.least_bytes = stored.pieces[0].offset + 2 * samples * sample_bytes;
        }
        return layout;
    }

    if (stored.packed) stored.skip = std::uint64_t(skip);
    else
        for (StoredVoxels::Piece& piece : stored.pieces) piece.offset += std::uint64_t(skip);
    const std::string endian = lower(get(header.fields, "endian"));
    stored.samples.swap = !endian.empty() && (endian == "big") != kBigEndianHost;
    layout.voxels = std::move(stored);
    return layout;
}

MetaHeader parse_meta_header(std::string_view head, const fs::path& path) {
    MetaHeader header;
    std::size_t at = 0;
    std::string_view line;
    bool complete = false;
    while (!complete && next_line(head, at, line)) {
        std::size_t equals = line.find('=');
        if (trim(line).empty()) continue;
        if (equals == std::string_view::npos || line.find('\0') != std::string_view::npos)
            fail("{}: the header line '{}' is not a 'Key = value' pair of MetaImage", path.string(),
                 std::string(line.substr(0, std::min<std::size_t>(line.find('\0'), 60))));
        header.fields[key_of(line.substr(0, equals))] = trim(line.substr(equals + 1));
        complete = header.fields.contains("elementdatafile");
    }
    if (!complete)
        fail("{}: the MetaImage header is cut short: it has no ElementDataFile", path.string());
    for (const char* field : {"ndims", "dimsize", "elementtype"})
        if (!header.fields.contains(field))
            fail("{}: the MetaImage header has no {}", path.string(),
                 field == std::string_view("ndims")     ? "NDims"
                 : field == std::string_view("dimsize") ? "DimSize"
                                                        : "ElementType");
    header.end = at;

    // MetaIO keeps extents in 32 bits, and talks to the terminal of what it does not like.
    std::int64_t axes = 0, extent = 0;
    if (!parse_integer(get(header.fields, "ndims"), axes) || axes < 1 || axes > 10)
        fail("{}: NDims is {}, and must be a number from 1 to 10", path.string(),
             get(header.fields, "ndims"));
    const std::vector<std::string> extents = split_words(get(header.fields, "dimsize"));
    bool right = std::int64_t(extents.size()) == axes;
    for (const std::string& word : extents)
        right = right && parse_integer(word, extent) && extent > 0 && extent <= INT32_MAX;
    if (!right)
        fail("{}: DimSize is '{}', and must be {} numbers from 1 to 2147483647", path.string(),
             get(header.fields, "dimsize"), axes);
    if (!get(header.fields, "elementtype").starts_with("MET_"))
        fail("{}: ElementType is '{}', and must be one of MetaImage's, such as MET_SHORT",
             path.string(), get(header.fields, "elementtype"));
    if (std::string type = get(header.fields, "objecttype"); lower(type) != "image")
        fail("{}: it holds a MetaIO object of type '{}', not an Image", path.string(), type);
    if (get(header.fields, "elementdatafile").empty())
        fail("{}: the MetaImage header is cut short: ElementDataFile names no file", path.string());
    return header;
}

Layout meta_layout(const MetaHeader& header, const fs::path& path) {
    Layout layout;
    layout.files = {path};
    auto is_true = [&](std::string_view key) {
        std::string v = lower(get(header.fields, key));
        return v.starts_with('t') || v.starts_with('1') || v.starts_with('y');
    };
    StoredVoxels stored;
    stored.packed = is_true("compresseddata");
    bool known = !header.fields.contains("binarydata") || is_true("binarydata");

    const std::string data = get(header.fields, "elementdatafile");
    const std::vector<std::string> words = split_words(data);
    if (lower(data) == "local") {
        stored.pieces = {{path, header.end}};
    } else if (!words.empty() && (words[0] == "LIST" || data.find('%') != std::string::npos)) {
        known = false;  // slices in files of their own
        if (words[0] != "LIST")
            for (const std::string& name : files_of_pattern(words))
                layout.files.push_back(beside(path, name));
    } else {
        fs::path file = beside(path, data);
        if (!fs::exists(file))
            fail("{}: its data file {} is not there", path.string(), file.string());
        stored.pieces = {{file, 0}};
        layout.files.push_back(file);
    }
    std::int64_t skip = 0;
    if (header.fields.contains("headersize")) {
        known = known && parse_integer(get(header.fields, "headersize"), skip) && skip >= 0;
        known = known && !(skip > 0 && stored.packed);
    }
    if (!known) return layout;
    stored.pieces.front().offset += std::uint64_t(skip);
    const bool big = is_true("elementbyteordermsb") || is_true("binarydatabyteordermsb");
    stored.samples.swap = big != kBigEndianHost;
    layout.voxels = std::move(stored);
    return layout;
}

Layout nifti_layout(std::string_view head, const fs::path& path, bool packed) {
    constexpr std::size_t kHeader = 348;
    if (head.size() < kHeader)
        fail("{} is not a whole NIfTI file: its header is cut short at {} of 348 bytes",
             path.string(), head.size());
    bool swap = false;
    auto field = [&]<class T>(std::size_t at, T) {
        T v;
        std::array<char, sizeof(T)> raw;
        std::memcpy(raw.data(), head.data() + at, sizeof v);
        if (swap) std::reverse(raw.begin(), raw.end());
        std::memcpy(&v, raw.data(), sizeof v);
        return v;
    };
    if (field(0, std::int32_t{}) != std::int32_t(kHeader)) {
        swap = true;
        if (field(0, std::int32_t{}) != std::int32_t(kHeader)) {
            bool second = field(0, std::int32_t{}) == 540;
            swap = false;
            second = second || field(0, std::int32_t{}) == 540;
            fail("{} is not a NIfTI-1 file: {}", path.string(),
                 second ? "it is NIfTI-2; convert it to NIfTI-1 or NRRD"
                        : "its header does not begin with its length, 348");
        }
    }
    const auto axes = field(40, std::int16_t{});
    if (axes < 1 || axes > 7)
        fail("{}: the NIfTI header has {} axes, and must have 1 to 7; it is damaged", path.string(), axes);
    for (std::size_t a = 1; a <= std::size_t(axes); ++a)
        if (field(40 + 2 * a, std::int16_t{}) < 1)
            fail("{}: the NIfTI header has {} voxels along axis {}; it is damaged", path.string(),
                 field(40 + 2 * a, std::int16_t{}), a);
    const std::string_view magic = head.substr(344, 3);
    const bool pair = magic == "ni1";

    Layout layout;
    layout.files = {path};
    StoredVoxels stored;
    fs::path data = path;
    if (magic != "n+1") {
        // head.hdr or head.hdr.gz goes with head.img or head.img.gz, and so the other way round.
        fs::path stem = path;
        if (lower(stem.extension().string()) == ".gz") stem.replace_extension();
        for (const char* extension : {".hdr", ".hdr.gz", ".img", ".img.gz"}) {
            fs::path other = fs::path(stem).replace_extension(extension);
            if (!fs::exists(other)) continue;
            if (other != path) layout.files.push_back(other);
            if (std::string_view(extension).starts_with(".img")) data = other;
        }
        if (data == path && lower(stem.extension().string()) != ".img")
            fail("{}: the voxels of this header are not there; {} is missing", path.string(),
                 fs::path(stem).replace_extension(".img").string());
        packed = lower(data.extension().string()) == ".gz";
    }
    stored.packed = packed;

    const float offset = field(108, float{}), slope = field(112, float{}), inter = field(116, float{});
    constexpr std::int16_t kScalars[] = {2, 4, 8, 16, 64, 256, 512, 768, 1024, 1280};
    const auto type = field(70, std::int16_t{});
    const bool scalar = std::find(std::begin(kScalars), std::end(kScalars), type) != std::end(kScalars);
    const bool scaled = slope != 0 && !(slope == 1 && inter == 0);
    const float least = magic == "n+1" ? float(kHeader) : 0.f;
    if (magic == "n+1" || pair) {
        if (!(offset >= least && offset < 1e9f && offset == std::floor(offset)) &&
            !(offset == 0 && magic == "n+1"))
            fail("{}: the NIfTI header places the voxels at byte {}; it is damaged", path.string(),
                 offset);
        if (scalar && !scaled && offset >= least) {
            stored.pieces = {{data, packed ? 0 : std::uint64_t(offset)}};
            stored.skip = packed ? std::uint64_t(offset) : 0;
            stored.samples.swap = swap;
            layout.voxels = std::move(stored);
            return layout;
        }
    }
    double bytes = std::abs(double(field(72, std::int16_t{}))) / 8;
    for (std::size_t a = 1; a <= std::size_t(axes); ++a) bytes *= field(40 + 2 * a, std::int16_t{});
    layout.data = data;
    layout.packed = packed;
    layout.least_bytes = std::uint64_t(std::min(bytes + std::max(double(offset), double(least)), 1e18));
    return layout;
}

}  // namespace voxloom
