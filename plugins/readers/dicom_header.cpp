#include "dicom_header.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxloom {

namespace fs = std::filesystem;

namespace {

using Tag = DicomHeader::Tag;
constexpr Tag kTransferSyntax = 0x00020010, kPixels = 0x7fe00010;
constexpr Tag kItem = 0xfffee000, kItemEnd = 0xfffee00d, kSequenceEnd = 0xfffee0dd;
constexpr std::uint32_t kUndefined = 0xffffffff;
constexpr int kDeepest = 32;  // sequences inside sequences

class Walker {
  public:
    Walker(std::istream& in, const fs::path& path) : in_(in), path_(path) {
        in_.seekg(0, std::ios::end);
        size_ = std::uint64_t(std::max<std::streamoff>(in_.tellg(), 0));
        in_.seekg(0);
    }

    DicomHeader walk() {
        if (size_ < 132) fail("{} is not a DICOM file, or its header is cut short", path_.string());
        skip(128);
        if (bytes(4) != "DICM") fail("{} is not a DICOM file: it lacks the letters DICM", path_.string());
        // Group 2 is always explicit and little-endian; it says how the rest is written.
        while (at_ < size_ && next_group() == 2) element(size_, 0);
        const std::string syntax = clean(syntax_);
        if (syntax.empty()) fail("{}: the DICOM header names no transfer syntax; it is cut short or "
                                 "damaged", path_.string());
        if (syntax == "1.2.840.10008.1.2.1.99")
            fail("{} is deflated as a whole; convert it to an uncompressed transfer syntax", path_.string());
        explicit_ = syntax != "1.2.840.10008.1.2";
        big_ = syntax == "1.2.840.10008.1.2.2";
        while (at_ < size_) element(size_, 0);
        if (header_.has_pixels && !encapsulated_) check_pixels();
        return std::move(header_);
    }

    static std::string clean(std::string value) {
        while (!value.empty() && (value.back() == ' ' || value.back() == '\0')) value.pop_back();
        while (!value.empty() && value.front() == ' ') value.erase(0, 1);
        return value;
    }

  private:
    [[noreturn]] void cut() const {
        fail("{} is cut short or damaged: an element reaches beyond byte {}, its end; copy it again from "
             "its source", path_.string(), size_);
    }
    [[noreturn]] void damaged() const {
        fail("{} is damaged: what stands at byte {} is no DICOM element; copy it again from its source",
             path_.string(), at_);
    }
    std::string bytes(std::uint64_t n) {
        if (n > size_ - at_) cut();
        std::string b(n, '\0');
        in_.read(b.data(), std::streamsize(n));
        if (std::uint64_t(in_.gcount()) != n) cut();
        at_ += n;
        return b;
    }
    void skip(std::uint64_t n) {
        if (n > size_ - at_) cut();
        at_ += n;
        if (n < 4096) in_.ignore(std::streamsize(n));
        else in_.seekg(std::streamoff(at_));
    }
    std::uint32_t word(std::uint64_t n) {
        std::string b = bytes(n);
        if (big_) std::reverse(b.begin(), b.end());
        std::uint32_t v = 0;
        for (std::size_t i = n; i-- > 0;) v = v << 8 | static_cast<unsigned char>(b[i]);
        return v;
    }
    std::uint32_t next_group() {
        if (size_ - at_ < 2) cut();
        const std::uint32_t group = word(2);
        at_ -= 2;
        in_.clear();
        in_.seekg(std::streamoff(at_));
        return group;
    }
    Tag tag() {
        const std::uint32_t group = word(2);
        return group << 16 | word(2);
    }

    // One element that must end before `end`, with all that is nested in it. Gives its tag.
    Tag element(std::uint64_t end, int depth) {
        if (end - at_ < 8) cut();
        const Tag t = tag();
        if (t == kItemEnd || t == kSequenceEnd || t == kItem) {
            // Only inside sequences; the caller knows what to do with the ends.
            if (depth == 0 || t == kItem) damaged();
            if (word(4) != 0) damaged();
            return t;
        }
        std::string kind;
        std::uint32_t length;
        if (explicit_) {
            kind = bytes(2);
            if (kind[0] < 'A' || kind[0] > 'Z' || kind[1] < 'A' || kind[1] > 'Z') damaged();
            constexpr std::string_view kLong[] = {"OB", "OD", "OF", "OL", "OV", "OW", "SQ",
                                                  "SV", "UC", "UN", "UR", "UT", "UV"};
            if (std::find(std::begin(kLong), std::end(kLong), kind) != std::end(kLong)) {
                skip(2);
                length = word(4);
            } else {
                length = word(2);
            }
        } else {
            length = word(4);
        }
        const bool pixels = t == kPixels && depth == 0;
        if (pixels) {
            header_.has_pixels = true;
            encapsulated_ = length == kUndefined;
            pixel_bytes_ = length;
        }
        if (length == kUndefined) {
            if (!pixels && !kind.empty() && kind != "SQ" && kind != "UN") damaged();
            // Inside an unknown element of undefined length everything is implicit.
            const bool before = explicit_;
            if (kind == "UN") explicit_ = false;
            if (pixels) fragments(end);
            else items(end, true, depth + 1);
            explicit_ = before;
            return t;
        }
        if (length > end - at_) cut();
        const std::uint64_t stop = at_ + length;
        if (kind == "SQ") items(stop, false, depth + 1);
        else if (depth == 0 && wanted(t) && length <= 4096) keep(t, length);
        else skip(length);
        return t;
    }

    // Items until the delimiter, or until `end`.
    void items(std::uint64_t end, bool delimited, int depth) {
        if (depth > kDeepest) damaged();
        while (delimited || at_ < end) {
            if (end - at_ < 8) cut();
            const Tag t = tag();
            const std::uint32_t length = word(4);
            if (t == kSequenceEnd && delimited) return;
            if (t != kItem) damaged();
            if (length == kUndefined) {
                while (element(end, depth) != kItemEnd) {
                }
            } else {
                if (length > end - at_) cut();
                const std::uint64_t stop = at_ + length;
                while (at_ < stop) element(stop, depth);
            }
        }
    }

    // Compressed pixels: fragments of known length.
    void fragments(std::uint64_t end) {
        for (;;) {
            if (end - at_ < 8) cut();
            const Tag t = tag();
            const std::uint32_t length = word(4);
            if (t == kSequenceEnd) return;
            if (t != kItem || length == kUndefined) damaged();
            skip(length);
        }
    }

    static bool wanted(Tag t) {
        constexpr Tag tags[] = {kTransferSyntax, DicomHeader::kSeriesName, DicomHeader::kThickness,
                                DicomHeader::kSeriesUid, DicomHeader::kNumber, DicomHeader::kPosition,
                                DicomHeader::kOrientation, DicomHeader::kSamples, DicomHeader::kFrames,
                                DicomHeader::kRows, DicomHeader::kColumns, DicomHeader::kPixelSpacing,
                                DicomHeader::kBitsAllocated, DicomHeader::kBitsStored,
                                DicomHeader::kSigned, DicomHeader::kIntercept, DicomHeader::kSlope};
        return std::find(std::begin(tags), std::end(tags), t) != std::end(tags);
    }
    void keep(Tag t, std::uint32_t length) {
        const bool binary = t == DicomHeader::kRows || t == DicomHeader::kColumns ||
                            t == DicomHeader::kSamples || t == DicomHeader::kBitsAllocated ||
                            t == DicomHeader::kBitsStored || t == DicomHeader::kSigned;
        if (binary && length != 2) damaged();
        std::string value = binary ? std::to_string(word(2)) : bytes(length);
        if (t == kTransferSyntax) syntax_ = value;
        else header_.values[t] = value;
    }

    void check_pixels() const {
        const double need = header_.number(DicomHeader::kRows, 0) * header_.number(DicomHeader::kColumns, 0) *
                            header_.number(DicomHeader::kSamples, 1) *
                            std::max(1.0, header_.number(DicomHeader::kFrames, 1)) *
                            header_.number(DicomHeader::kBitsAllocated, 0) / 8;
        if (double(pixel_bytes_) < need)
            fail("{} is cut short or damaged: it has {} bytes of pixels where its rows, columns and frames "
                 "need {}", path_.string(), pixel_bytes_, need);
    }

    std::istream& in_;
    const fs::path& path_;
    std::uint64_t size_ = 0, at_ = 0;
    bool explicit_ = true, big_ = false, encapsulated_ = false;
    std::uint32_t pixel_bytes_ = 0;
    std::string syntax_;
    DicomHeader header_;
};

}  // namespace

std::string DicomHeader::text(Tag tag) const {
    auto it = values.find(tag);
    return it == values.end() ? "" : Walker::clean(it->second);
}

std::vector<double> DicomHeader::numbers(Tag tag, std::size_t count) const {
    std::vector<double> found;
    const std::string all = text(tag);
    for (std::size_t at = 0; at <= all.size();) {
        const std::size_t end = std::min(all.find('\\', at), all.size());
        std::string word = all.substr(at, end - at);
        std::erase(word, ' ');
        double v = 0;
        if (!parse_number(word, v) || !std::isfinite(v)) return {};
        found.push_back(v);
        at = end + 1;
    }
    return found.size() == count ? found : std::vector<double>();
}

double DicomHeader::number(Tag tag, double otherwise) const {
    auto v = numbers(tag, 1);
    return v.empty() ? otherwise : v[0];
}

bool is_dicom(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    char head[132] = {};
    in.read(head, sizeof head);
    return in.gcount() == sizeof head && std::memcmp(head + 128, "DICM", 4) == 0;
}

DicomHeader parse_dicom_header(std::istream& in, const fs::path& path) {
    return Walker(in, path).walk();
}

}  // namespace voxloom
