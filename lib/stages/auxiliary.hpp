// Auxiliary outputs of every pixel from the weights of its fragments.
#pragma once

#include "kernels/auxiliary.hpp"
#include "stages/aggregate.hpp"
#include "stages/attribute.hpp"
#include "stages/geometry.hpp"

namespace dpr {

class Auxiliary {
 public:
  explicit Auxiliary(Device::Impl& device) : device_(device), launch_(device) {}

  /// Runs the aggregation backward pass for a gradient of 1 in red, which leaves the weight of every fragment
  /// in the gradient of its red: `aggregate` is left with that.
  void forward(const AggregateInputs& in, const Geometry& geometry, const Transform& transform,
               Aggregate& aggregate);

  /// Outputs that noise on the pixel can blend and blur: depth and normal, 1 and the effective number of
  /// faces, all times the sample's alpha.
  void weigh(const shared::FrameParams& p, const Aggregate& aggregate);

  /// Size of the images: pixels along their sides, samples along a pixel's, and around the image.
  struct Raster {
    std::size_t width, height, supersampling, margin;
  };
  /// From samples to pixels. What weigh() left, blurred, where there is noise on the pixel, and otherwise
  /// empty.
  void finish(const shared::FrameParams& p, const Raster& raster, const Buffer<cl_float4>& blurred_surface,
              const Buffer<cl_float4>& blurred_coverage, const CornerTexcoords& texcoords);

  Buffer<cl_float4> normals;  ///< [view][pixel] w = depth
  Buffer<cl_float4> places;   ///< [view][pixel] barycentrics; w = the effective number of faces
  Buffer<cl_float2> uvs;      ///< [view][pixel]
  Buffer<cl_uint> faces;      ///< [view][pixel] DPR_NO_FACE for the background

  Buffer<cl_float4> surface, coverage;  ///< [view][sample] of weigh()

  Buffer<float> outputs;    ///< [DPR_AUXILIARY_CHANNELS][view][height][width]
  Buffer<cl_uint> face_id;  ///< [view][height][width] DPR_NO_FACE for the background

  std::size_t bytes() const {
    return surface.capacity_bytes() + coverage.capacity_bytes() + normals.capacity_bytes() +
           places.capacity_bytes() + uvs.capacity_bytes() + faces.capacity_bytes() +
           outputs.capacity_bytes() + face_id.capacity_bytes() + grad_red_.capacity_bytes();
  }

 private:
  Device::Impl& device_;
  Launcher<kernel::auxiliary_forward, kernel::auxiliary_weigh, kernel::auxiliary_finish> launch_;
  Buffer<cl_float4> grad_red_;  // [view][height][width] 1 in red
};

}  // namespace dpr
