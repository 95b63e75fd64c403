// Look-up tables of a transfer function: optical depth and colour times optical depth.
//
// An entry is (x c, x): x the optical depth of one slab of thickness d, c its mean colour as seen
// from the front. Opacity 1 - exp(-x s) for a slab s times as thick, colour c times that: exact for
// the opacity whatever s, and for the colour where it is constant.
#pragma once

#include <glm/glm.hpp>
#include <stop_token>
#include <vector>

#include "core/base/hash.h"
#include "core/data/transfer_function.h"

namespace voxloom::slicer {

// Pre-integrated: entry (f, b) at [b * n + f] is the slab along which the value goes linearly from
// that of node f to that of node b; nodes are evenly spaced from range.min to range.max, n >= 2.
// O(n^2) with self-attenuation by sub-range windows (methods: Lum, Wilson and Ma 2004, with van
// Herk's blocks so that no inverse is taken). The extinction of every unit segment is its exact mean,
// so that a peak narrower than a bin keeps its integral.
std::vector<glm::vec4> preintegrated_table(const TransferFunction1D& tf, ValueRange range, int n,
                                           double d, const std::stop_token& stop = {});

// Bilinear between its nodes, that table blurs by a bin, which blunts the errors of a field that is not
// linear in a slab, but gives a peak of a bin or three an opacity that depends on the slices. True where
// there is such a peak; depth_integral() then has the opacity.
bool has_narrow_peak(const TransferFunction1D& tf, ValueRange range, int n);

// Optical depth of a slab of thickness d along which the value goes from that of node 0 to each of n
// nodes, times the share of the range that it crosses; linear between nodes, 0 in the middle. Slab (f, b)
// is (integral(b) - integral(f)) / (b - f) deep, whatever the slices; not for b near f, where that
// cancels. A bin counts for at most kOpaqueBin, which lets nothing through.
inline constexpr double kOpaqueBin = 64;
std::vector<float> depth_integral(const TransferFunction1D& tf, ValueRange range, int n, double d);

// One entry a node, n >= 2: the transfer function at the value.
std::vector<glm::vec4> emission_table(const TransferFunction1D& tf, ValueRange range, int n, double d);
// The nodes of a 2-D transfer function as they are, value fastest.
std::vector<glm::vec4> emission_table_2d(const TransferFunction2D& tf, double d);

Hash hash_of(const TransferFunction& tf);

}  // namespace voxloom::slicer
