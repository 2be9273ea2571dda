// Samples blended across the contours between them, and what that gives back to contours and samples.
#pragma once

#include "kernels/antialias.hpp"
#include "kernels/antialias_cross.hpp"
#include "kernels/antialias_fade.hpp"
#include "kernels/antialias_second.hpp"
#include "kernels/antialias_tangent.hpp"
#include "stages/contour.hpp"
#include "stages/rasterize.hpp"

namespace dpr {

/// Samples near contours: as they were before they were blended, and faded
/// (kernels/antialias_fade.cl), by how much.
struct KeptSamples {
  Buffer<cl_float4> samples, faded;
  Buffer<cl_float2> shares;

  static constexpr std::size_t k_sample_bytes = 2 * sizeof(cl_float4) + sizeof(cl_float2);
  std::size_t bytes() const {
    return samples.capacity_bytes() + faded.capacity_bytes() + shares.capacity_bytes();
  }
};

/// Memory of others that backward() and tangent() may write to: of samples, and of four floats a sample at the
/// least; tangent() makes both as large as its directions need.
struct AntialiasScratch {
  Buffer<cl_float4>& samples;
  Buffer<float>& cuts;
};

class Antialias {
 public:
  explicit Antialias(Device::Impl& device) : device_(device), launch_(device) {}

  /// The depths behind which the samples near contours of the rasterizer's band show none: those of the
  /// front-most surfaces, or of the last of so many `layers`.
  void find_front(const shared::FrameParams& p, const Bin& bin, const Rasterize& rasterize,
                  const Contour& contour, cl_uint layers);
  /// Finds what crosses the steps between samples; after find_front() of the window. Surfaces p.depth_reach
  /// (normalised depth) behind the nearest count as seen. `wanted`, here and below: the rows of tiles whose results
  /// are, k_rows_around less than the window where the view goes on; or all of the window.
  void cross(const ContourInputs& in, const Contour& contour, const std::optional<Range>& wanted = {}) {
    cross(in, contour, *this, wanted);
  }
  /// The same, by what another's find_front() has found.
  void cross(const ContourInputs& in, const Contour& contour, const Antialias& fronts,
             const std::optional<Range>& wanted = {});
  /// Blends the samples in place.
  void forward(const shared::FrameParams& p, const Contour& contour, Buffer<cl_float4>& samples,
               KeptSamples& kept, const std::optional<Range>& wanted = {});
  /// From the gradients of the blended samples to those of the samples, in place, and to `grad_ends` of the
  /// wanted tiles. `kept` as forward() leaves it.
  void backward(const ContourInputs& in, const Contour& contour, const KeptSamples& kept,
                Buffer<cl_float4>& grad, const AntialiasScratch& scratch,
                const std::optional<Range>& wanted = {});
  /// From the tangents of the samples, [direction][sample], to those of the blended ones, in place. `kept` as
  /// forward() leaves it.
  void tangent(const ContourInputs& in, const Contour& contour, const KeptSamples& kept,
               const Tangents& tangents, Buffer<cl_float4>& samples, const AntialiasScratch& scratch);

  /// Rows of tiles around those that are wanted in which samples have to be there.
  static constexpr std::size_t k_rows_around = 6;
  /// Bytes a sample of the buffers below.
  static constexpr std::size_t k_sample_bytes =
      sizeof(float) + 3 * sizeof(cl_uint) + 2 * sizeof(cl_float2) +
      DPR_SECOND_CROSSINGS * (sizeof(shared::SecondCrossing) + sizeof(cl_float2)) / (2 * DPR_TILE) + 1;

  /// Bytes a sample and direction of what tangent() writes beside the samples.
  static constexpr std::size_t k_tangent_bytes =
      sizeof(cl_float4) + 2 * sizeof(cl_float2) + DPR_SECOND_CROSSINGS * sizeof(cl_float2) / (2 * DPR_TILE);

  Buffer<float> front;         ///< [sample] view depth, infinite where nothing hides; only near contours
  Buffer<cl_uint> front_face;  ///< [sample] view * faces + face of what is there
  Buffer<cl_uint> winner;  ///< [2][sample] what crosses the steps to the right, and down; only near contours
  Buffer<cl_float2> cut;   ///< [2][sample] what it cuts: Cut of kernels/crossing.h
  Buffer<cl_uint> second_counts;           ///< [tile][DPR_TILE_ITEMS] of `seconds`
  Buffer<shared::SecondCrossing> seconds;  ///< [tile][DPR_TILE_ITEMS][DPR_SECOND_ROOM] beside the winners
  Buffer<cl_float4> grad_ends;             ///< [pair] of the contour's two ends, NDC

  std::size_t bytes() const;

 private:
  TileLaunch launch_around(const shared::FrameParams& p, const std::optional<Range>& wanted,
                           std::size_t around) const;

  Device::Impl& device_;
  Launcher<kernel::antialias_front, kernel::antialias_cross, kernel::antialias_second_find,
           kernel::antialias_fade, kernel::antialias_keep, kernel::antialias_forward,
           kernel::antialias_backward, kernel::antialias_second_forward, kernel::antialias_second_backward,
           kernel::antialias_fade_backward, kernel::antialias_cross_backward>
      launch_;
  std::optional<Launcher<kernel::antialias_cross_tangent, kernel::antialias_fade_tangent,
                         kernel::antialias_blend_tangent, kernel::antialias_second_tangent>>
      tangent_;                     // made when first asked for
  Buffer<cl_uchar> crowded_;        // [tile][DPR_TILE_BYTES]
  Buffer<cl_float2> grad_seconds_;  // as `seconds`
};

}  // namespace dpr
