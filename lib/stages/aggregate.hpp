// The perturbed arg-max of every pixel: the image, and the gradients of what it is made of.
#pragma once

#include <optional>
#include <string>

#include "dpr/smoothing.hpp"
#include "kernels/aggregate.hpp"
#include "kernels/aggregate_joint.hpp"
#include "kernels/aggregate_joint_sampled.hpp"
#include "kernels/aggregate_sampled.hpp"
#include "kernels/aggregate_tangent.hpp"
#include "stages/occupancy.hpp"
#include "stages/rasterize.hpp"
#include "stages/shade.hpp"
#include "stages/smoothed_stage.hpp"
#include "stages/transform.hpp"

namespace dpr {

/// Everything of a frame that aggregation reads.
struct AggregateInputs {
  const shared::FrameParams& p;
  const DeviceViews& views;
  const Bin& bin;
  Rasterize& rasterize;
};

/// Kernels of one composition, estimator and prior; `built` names them.
struct AggregateKernels {
  std::string built;
  /// Exact. The forward pass leaves the pixels' slots for the backward pass.
  std::optional<Launcher<kernel::aggregate_forward, kernel::aggregate_backward, kernel::aggregate_rows>>
      barrier;
  std::optional<Launcher<kernel::aggregate_joint_forward, kernel::aggregate_joint_backward,
                         kernel::aggregate_joint_rows>>
      joint;
  std::optional<Launcher<kernel::aggregate_sampled_forward, kernel::aggregate_sampled_backward>> sampled;
  /// Perturbs distances too, and so takes the place of the occupancy stage.
  std::optional<Launcher<kernel::aggregate_joint_sampled_forward, kernel::aggregate_joint_sampled_backward>>
      joint_sampled;
};

class Aggregate : public SmoothedStage<AggregateKernels> {
 public:
  explicit Aggregate(Device::Impl& device) : SmoothedStage(device) {}

  /// Everything about setting the smoothing that can fail: builds what it needs; cheap where that is there
  /// already.
  Setting prepare(const Smoothing& smoothing) const;
  void set_smoothing(const Smoothing& smoothing) { set(prepare(smoothing)); }

  /// Sorts the lists by depth for the joint composition; leaves the slots that backward() goes over.
  void forward(const AggregateInputs& in, const glm::vec3& background);
  /// `grad_image` is [view][height][width]. The gradients of fragments that no pixel lists are not written, nor
  /// are `channels` unless they are asked for.
  void backward(const AggregateInputs& in, const glm::vec3& background,
                const BufferRef<cl_float4>& grad_image, bool with_channels = true);

  /// From the tangents of the band's fragments to those of the images, of the group's directions from `first`
  /// on. Uses the fragments' gradients as scratch. Only with the exact estimator.
  void tangent(const AggregateInputs& in, const glm::vec3& background, Tangents& tangents, std::size_t first,
               Buffer<cl_float4>& images);

  /// Number of `channels`: the joint composition has none of alpha.
  std::size_t channel_count() const {
    return now_.smoothing.composition == Composition::joint ? DPR_CHANNEL_ALPHA : DPR_PIXEL_CHANNELS;
  }

  bool is_sampled() const { return now_.smoothing.aggregation_estimator == Estimator::monte_carlo; }

  /// Bytes a fragment of the buffers below and the slots.
  static constexpr std::size_t k_fragment_bytes = sizeof(shared::Slot);

  /// Memory of four floats a pixel at the least, until backward() writes to it: that of the channels.
  Buffer<float>& scratch(const shared::FrameParams& p) {
    channels.resize(device_, std::max<std::size_t>(4, channel_count()) * pixels_of(p));
    return channels;
  }

  /// Bytes a pixel of the buffers below and the slots.
  std::size_t pixel_bytes() const {
    return sizeof(cl_float4) + sizeof(cl_uint) + (now_.kernels->barrier ? sizeof(shared::Slot) : 0) +
           std::max<std::size_t>(4, channel_count()) * sizeof(float);
  }

  Buffer<cl_float4> image;  ///< [pixels_of(p)] RGBA
  Buffer<float> channels;   ///< [channel_count()][pixels_of(p)]

  /// True if distances are perturbed here, in the sampled joint composition. Then the gradients of distances
  /// take the place of those of occupancies, and this one is written.
  bool perturbs_distances() const { return now_.kernels->joint_sampled.has_value(); }
  Buffer<float> grad_sigma;  ///< [pixels_of(p)]

  std::size_t bytes() const;

 private:
  template <class Barrier, class Joint, class Sampled, class JointSampled>
  void launch(const AggregateInputs& in, const glm::vec3& background, const BufferRef<cl_float4>& grad_image,
              bool with_channels);
  shared::AggregateParams params(const shared::FrameParams& p, const glm::vec3& background,
                                 bool with_channels) const;

  Buffer<shared::Slot> slots_;   // [fragment], and in the barrier composition [pixel] more
  Buffer<cl_uint> slot_counts_;  // [pixel]
  std::optional<Launcher<kernel::aggregate_share_tangent, kernel::aggregate_sum_tangent>> tangent_;
};

}  // namespace dpr
