#include "plugins/codec-wavelet/coder.h"

#include <algorithm>

#include "core/base/error.h"
#include "plugins/codec-wavelet/block_coder.h"
#include "plugins/codec-wavelet/dense_coder.h"
#include "plugins/codec-wavelet/fast_coder.h"
#include "plugins/codec-wavelet/paper_coder.h"

namespace voxloom::wavelet {

std::string_view name_of(CoderKind kind) {
    constexpr std::string_view kNames[] = {"paper", "dense", "blocks", "fast"};
    return kNames[int(kind)];
}

std::unique_ptr<Coder> make_coder(CoderKind kind, std::span<const std::byte> tables) {
    switch (kind) {
        case CoderKind::paper: return make_paper_coder();
        case CoderKind::blocks: return make_block_coder(tables);
        case CoderKind::fast: return make_fast_coder(tables);
        case CoderKind::dense: break;
    }
    return make_dense_coder(tables);
}

bool all_zero(const Details& details) {
    std::int32_t any = 0;
    for_each_row(details, [&](const std::int32_t* q, std::size_t n) {
        for (std::size_t i = 0; i < n; ++i) any |= q[i];
    });
    return any == 0;
}

void clear_bands(Details& details) {
    for_each_row(details, [](std::int32_t* q, std::size_t n) { std::fill_n(q, n, 0); });
}

}  // namespace voxloom::wavelet
