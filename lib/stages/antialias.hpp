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

/// Samples near contours, [view][height][width]: as they were before they were blended, and faded
/// (kernels/antialias_fade.cl), by how much.
struct KeptSamples {
  Buffer<cl_float4> samples, faded;
  Buffer<cl_float2> shares;

  std::size_t bytes() const {
    return samples.capacity_bytes() + faded.capacity_bytes() + shares.capacity_bytes();
  }
};

class Antialias {
 public:
  explicit Antialias(Device::Impl& device) : device_(device), launch_(device) {}

  /// The front-most depths of the samples near contours of the rasterizer's band.
  void find_front(const shared::FrameParams& p, const Bin& bin, const Rasterize& rasterize,
                  const Contour& contour);
  /// Finds what crosses the steps between samples; after find_front() of all bands. Surfaces p.depth_reach
  /// (normalised depth) behind the nearest count as seen.
  void cross(const ContourInputs& in, const Contour& contour);
  /// Blends the samples of [view][height][width] in place.
  void forward(const shared::FrameParams& p, const Contour& contour, Buffer<cl_float4>& samples,
               KeptSamples& kept);
  /// From the gradients of the blended samples to those of the samples, in place, and to `grad_ends`. `kept`
  /// as forward() leaves it.
  void backward(const ContourInputs& in, const Contour& contour, const KeptSamples& kept,
                Buffer<cl_float4>& grad);
  /// From the tangents of the samples to those of the blended ones, in place, along one of the directions. `kept`
  /// as forward() leaves it.
  void tangent(const ContourInputs& in, const Contour& contour, const KeptSamples& kept,
               std::size_t direction, const Tangents& tangents, Buffer<cl_float4>& samples);
  /// Memory of so many elements, or of as many as there are samples, until backward() writes to it.
  Buffer<cl_float4>& scratch(const shared::FrameParams& p, std::size_t count);

  Buffer<float> front;            ///< [view][height][width] view depth, infinite where nothing is; only near
                                  ///< contours
  Buffer<cl_uint> front_face;     ///< [view][height][width] view * faces + face of what is there
  Buffer<cl_uint> winner;         ///< [2][view][height][width] what crosses the steps to the right, and down;
                                  ///< only near contours
  Buffer<cl_float2> cut;          ///< [2][view][height][width] what it cuts: Cut of kernels/crossing.h
  Buffer<cl_uint> second_counts;  ///< [tile][DPR_TILE_ITEMS] of `seconds`
  Buffer<shared::SecondCrossing> seconds;  ///< [tile][DPR_TILE_ITEMS][DPR_SECOND_ROOM] beside the winners
  Buffer<cl_float4> grad_ends;             ///< [pair] of the contour's two ends, NDC

  std::size_t bytes() const;

 private:
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
  Buffer<cl_float2> grad_cut_;      // [2][view][height][width]
  Buffer<cl_float2> grad_seconds_;  // as `seconds`
  Buffer<cl_float4> kept_grad_;     // [view][height][width] near contours; see scratch()
};

}  // namespace dpr
