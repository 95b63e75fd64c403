#include <algorithm>

#include "plugins/codec-baseline/codec.h"

namespace voxloom::baseline {

std::string_view name_of(Target target) {
    constexpr std::string_view names[] = {"lossless", "psnr", "max-error", "bpv", "ratio", "precision", "distance"};
    return names[int(target)];
}

const std::vector<const Codec*>& codecs() {
    static const std::vector<const Codec*> all = {
        &raw_codec(),
#ifdef VOXLOOM_WITH_ZFP
        &zfp_codec(),
#endif
#ifdef VOXLOOM_WITH_BLOSC
        &blosc_codec(),
#endif
#ifdef VOXLOOM_WITH_JPEG2000
        &jpeg2000_codec(),
#endif
#ifdef VOXLOOM_WITH_JPEGLS
        &jpegls_codec(),
#endif
#ifdef VOXLOOM_WITH_JPEGXL
        &jpegxl_codec(),
#endif
    };
    return all;
}

const Codec* find_codec(std::string_view name) {
    const auto it = std::ranges::find(codecs(), name, [](const Codec* codec) { return codec->name; });
    return it == codecs().end() ? nullptr : *it;
}

}  // namespace voxloom::baseline
