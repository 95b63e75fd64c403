// VOXLOOM_WIDE before a function compiles it once more for wider registers, and the machine chooses.
// AVX2 without FMA: a fused multiply-add would round differently and make results depend on the
// machine. Sanitizers run before the dynamic linker can choose.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define VOXLOOM_WIDE [[gnu::target_clones("avx2", "default")]]
#else
#define VOXLOOM_WIDE
#endif
