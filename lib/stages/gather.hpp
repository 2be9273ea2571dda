// Gradients of pairs' corners, gathered at vertices and colours.
#pragma once

#include "kernels/gather.hpp"
#include "stages/bin.hpp"
#include "stages/geometry.hpp"

namespace dpr {

/// Partial sums of pairs, in a buffer that has others before: so many elements.
struct PairSums {
  PairSums(const Buffer<float>& values_, std::size_t first_ = 0) : values(values_), first(first_) {}

  const Buffer<float>& values;
  cl_ulong first;
};

class Gather {
 public:
  explicit Gather(Device::Impl& device) : device_(device), launch_(device) {}

  /// grad[view][target] from partial[pair][9].
  void per_view(const shared::FrameParams& p, std::size_t targets, const Bin& bin, const Incidence& incidence,
                const PairSums& partial, Buffer<cl_float4>& grad);
  /// grad[target], the views added up.
  void over_views(const shared::FrameParams& p, std::size_t targets, const Bin& bin,
                  const Incidence& incidence, const PairSums& partial, Buffer<cl_float4>& grad);
  /// channels[DPR_MATERIAL_CHANNELS][face], the faces in the order of `materials`, from
  /// partial[pair][channel].
  void over_views(const shared::FrameParams& p, const Bin& bin, const SurfaceMaterials& materials,
                  const PairSums& partial, Buffer<float>& channels);

  std::size_t bytes() const { return chunks_.capacity_bytes() + parts_.capacity_bytes(); }

 private:
  /// Of as many targets as by_rows() has a view: `sums`, one for each, or for each in every view.
  void corners(const shared::FrameParams& p, std::size_t targets, std::size_t sums, const Bin& bin,
               const Incidence& incidence, const PairSums& partial, Buffer<cl_float4>& grad);
  /// Sums chunks of faces that may have more pairs than one work-item is to add.
  void sum_chunks(const shared::FrameParams& p, const Bin& bin, cl_uint channels, const PairSums& partial);

  Device::Impl& device_;
  Launcher<kernel::gather_chunks, kernel::gather_corners, kernel::gather_parts, kernel::gather_faces> launch_;
  Buffer<float> chunks_;     // [slot][channel]
  Buffer<cl_float4> parts_;  // [view][part], or of summed views [part]
};

}  // namespace dpr
