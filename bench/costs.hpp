// Costs of the stages: floating-point operations and bytes, counted in the sources and written down here, so
// that a reader can check a fraction of a peak. One line of the table a kernel; units are those of
// frame_work.hpp.
//
// Operations: +, -, *, /, sqrt and rsqrt count 1, a mad 2, on every lane that holds a pixel, a fragment or a
// node. Comparisons, selections, min, max, abs, conversions, integers and indices count nothing, nor does
// what is uniform to a triangle. exp_n is 19 operations (9 mads, 1 difference), log_n 21 (1 difference, 9
// mads, 2 products), log1p_n 4 more; a library exp is taken for as many.
//
// Bytes: every element of a buffer that a kernel needs, once, even where a cache or a second pass would have
// it come twice or not at all.
#pragma once

#include <optional>
#include <string_view>

#include "dpr/smoothing.hpp"
#include "frame_work.hpp"

namespace dpr::bench {

struct Cost {
  double flops = 0, bytes = 0;
};

inline Cost operator+(Cost a, Cost b) { return {a.flops + b.flops, a.bytes + b.bytes}; }
inline Cost operator*(double count, Cost each) { return {count * each.flops, count * each.bytes}; }

/// The Gaussian prior's parts (kernels/priors.h).
inline constexpr double k_exp = 19, k_log = 21, k_log1p = k_log + 4;
inline constexpr double k_normal_density = k_exp + 3;  // -0.5 x x, the constant
inline constexpr double k_mills_ratio = 22;            // 1 mad, 1 quotient, 9 mads, 1 product
inline constexpr double k_tail = k_normal_density + k_mills_ratio + 1;
inline constexpr double k_cdf_density = k_tail + 1;  // 1 - tail
inline constexpr double k_gaussian_log =
    k_tail + k_log + k_log1p + 7;  // occupancy_log: both branches, the hazard
inline constexpr double k_logistic_log = k_exp + k_log1p + 5;
/// AS 241: both branches; 2 operations make the uniform number.
inline constexpr double k_normal_sample = 2 + 3 + 14 + (k_log + 14);

// rasterize.cl
inline constexpr double k_view = 6 + 15;  // pixel centre; three edges of 5
inline constexpr double k_inside = 3;
inline constexpr double k_distance = 3 * (4 + 7 + 3);  // along the edge, offset, square
inline constexpr double k_barycentrics = 8;
/// All 64 pixels of the tile are tested.
inline constexpr Cost k_cover_per_pair{64 * (3 + 15 + k_inside + k_distance), 4 + 4 + 48 + 8 + 4};
inline constexpr Cost k_list_per_pair{0, 12 + 16};  // rasterize_count, rasterize_list
inline constexpr Cost k_list_per_pixel{0, 4 + 4};
inline constexpr Cost k_list_per_fragment{0, 4};
inline constexpr Cost k_rasterize_per_pair{0, 4 + 4 + 48 + 8 + 4};
inline constexpr Cost k_rasterize_per_fragment{k_view + k_inside + k_distance + k_barycentrics + 9, 24};
inline constexpr Cost k_rasterize_backward_per_pair{0, 4 + 4 + 48 + 36};
/// Distance: the closest edge (45), factor (2), three corners of 5. Barycentrics: those (8), clipped (12),
/// their gradients (9), three edges of 14.
inline constexpr Cost k_rasterize_backward_per_fragment{k_view + 62 + 71, 8 + 16};

// shade.cl, unlit
inline constexpr Cost k_shade_per_pair{0, 4 + 4 + 16 + 48};
inline constexpr Cost k_shade_per_fragment{12, 8 + 12};
inline constexpr Cost k_shade_backward_per_pair{0, 4 + 4 + 16 + 48 + 36};
inline constexpr Cost k_shade_backward_per_fragment{2 + 10 + 18, 8 + 12 + 8};

// occupancy.cl, occupancy_sampled.cl; evaluations are samples
inline constexpr double k_occupancy_bytes = 4 + 8, k_occupancy_backward_bytes = 12;
inline constexpr Cost k_occupancy_backward_per_pair{0, 4 + 4};
inline constexpr double k_occupancy_sample = k_normal_sample + 2;           // x + noise, sum
inline constexpr double k_occupancy_backward_sample = k_normal_sample + 8;  // also excess, two sums, score

// aggregate.cl, aggregate_joint.cl, aggregate_sampled.cl
inline constexpr Cost k_aggregate_per_pixel{0, 4 + 16};
inline constexpr Cost k_aggregate_per_fragment{0, 28 + 16};  // with its slot
inline constexpr Cost k_aggregate_backward_per_pixel{0, 4 + 16 + 20};
inline constexpr Cost k_aggregate_backward_per_fragment{0, 28 + 16 + 20};
/// The terms: t - beta, the prior, their quotient; joint: T_k (2), its inverse, two products, the ratio.
inline constexpr double k_barrier_terms = 1 + k_cdf_density + 1;
inline constexpr double k_joint_terms = 1 + k_cdf_density + 2 + 1 + 3 + 1;
/// The image adds the product, the ratio and three colours to them; the gradients the product, two sums, and
/// what the slot's own sums take.
inline constexpr double k_barrier_slot = k_barrier_terms + 8, k_joint_slot = k_joint_terms + 8;
inline constexpr double k_barrier_slot_backward = k_barrier_terms + 4 + 7;
inline constexpr double k_joint_slot_backward = k_joint_terms + 4 + 15;
inline constexpr double k_softmax_slot = k_exp + 8, k_softmax_slot_backward = 2 * k_exp + 5;
/// The generator's integer operations, which take most of the time, count nothing.
inline constexpr double k_sampled_slot = k_normal_sample + 4;
inline constexpr double k_sampled_slot_backward = k_sampled_slot + k_normal_sample + 2;

/// Cost of a stage of a frame, forward and backward; empty for stages and members that are not counted.
struct StageCost {
  Cost forward, backward;
};

std::optional<StageCost> stage_cost(std::string_view stage, const FrameWork& work,
                                    const Smoothing& smoothing);

}  // namespace dpr::bench
