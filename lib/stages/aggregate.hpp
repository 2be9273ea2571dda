// The perturbed arg-max of every pixel: the image, and the gradients of what it is made of.
#pragma once

#include <optional>
#include <string>

#include "device/kernel.hpp"
#include "dpr/smoothing.hpp"
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
  const Rasterize& rasterize;
  const Occupancy& occupancy;
  const Shade& shade;
};

/// Kernels of one composition, estimator and prior; `built` names them.
struct AggregateKernels {
  using ForwardKernel =
      Kernel<shared::AggregateParams, In<shared::ViewParams>, In<cl_uint>, In<cl_uint>, In<float>, In<float>,
             In<float>, In<float>, In<float>, In<float>, Out<shared::Slot>, Out<cl_uint>, Out<cl_float4>>;
  using BackwardKernel =
      Kernel<shared::AggregateParams, In<shared::ViewParams>, In<cl_uint>, In<cl_uint>, In<float>, In<float>,
             In<float>, In<float>, In<float>, In<float>, Out<shared::Slot>, In<cl_uint>, In<cl_float4>,
             Out<float>, Out<float>, Out<float>, Out<float>, Out<float>, Out<float>>;
  /// Exact kernels of either composition. The forward pass leaves the pixels' slots for the backward pass.
  struct Exact {
    Exact(Device::Impl& device, Composition composition, const std::string& options);
    ForwardKernel forward;
    BackwardKernel backward;
  };
  struct Sampled {
    Sampled(Device::Impl& device, const std::string& options);
    Kernel<shared::AggregateParams, In<shared::ViewParams>, In<cl_uint>, In<cl_uint>, In<float>, In<float>,
           In<float>, In<float>, In<float>, In<float>, In<cl_uint>, In<cl_uint>, Out<cl_float4>>
        forward;
    Kernel<shared::AggregateParams, In<shared::ViewParams>, In<cl_uint>, In<cl_uint>, In<float>, In<float>,
           In<float>, In<float>, In<float>, In<float>, In<cl_uint>, In<cl_uint>, In<cl_float4>, Out<float>,
           Out<float>, Out<float>, Out<float>, Out<float>, Out<float>>
        backward;
  };
  /// Perturbs distances too, and so takes the place of the occupancy stage.
  struct JointSampled {
    JointSampled(Device::Impl& device, const std::string& options);
    Kernel<shared::AggregateParams, In<shared::ViewParams>, In<cl_uint>, In<cl_uint>, In<float>, In<float>,
           In<float>, In<float>, In<float>, In<cl_uint>, In<cl_uint>, Out<cl_float4>>
        forward;
    Kernel<shared::AggregateParams, In<shared::ViewParams>, In<cl_uint>, In<cl_uint>, In<float>, In<float>,
           In<float>, In<float>, In<float>, In<cl_uint>, In<cl_uint>, In<cl_float4>, Out<float>, Out<float>,
           Out<float>, Out<float>, Out<float>, Out<float>, Out<float>>
        backward;
  };

  std::string built;
  std::optional<Exact> exact;
  std::optional<Sampled> sampled;
  std::optional<JointSampled> joint_sampled;
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
  /// `grad_image` is [view][height][width].
  void backward(const AggregateInputs& in, const glm::vec3& background,
                const BufferRef<cl_float4>& grad_image);

  /// Number of `channels`: the joint composition has none of alpha.
  std::size_t channel_count() const {
    return now_.smoothing.composition == Composition::joint ? DPR_CHANNEL_ALPHA : DPR_PIXEL_CHANNELS;
  }

  /// Bytes a fragment of the buffers below and the slots.
  static constexpr std::size_t k_fragment_bytes = 5 * sizeof(float) + sizeof(shared::Slot);

  Buffer<cl_float4> image;                       ///< [view][height][width] RGBA
  Buffer<float> grad_depth, grad_log_occupancy;  ///< [fragment]; what pixels do not list is not written
  ColorPlanes grad_color;                        ///< [fragment]
  Buffer<float> channels;                        ///< [channel_count()][view][height][width]

  /// True if distances are perturbed here, in the sampled joint composition. Then `grad_log_occupancy` is not
  /// written, but these are.
  bool perturbs_distances() const { return now_.kernels->joint_sampled.has_value(); }
  Buffer<float> grad_distance;  ///< [fragment]; what pixels do not list is not written
  Buffer<float> grad_sigma;     ///< [view][height][width]

  std::size_t bytes() const;

 private:
  /// Aggregates a run of pixels.
  void forward(const AggregateInputs& in, const shared::AggregateParams& a, const Range& pixels);
  void backward(const AggregateInputs& in, const shared::AggregateParams& a, const Range& pixels,
                const BufferRef<cl_float4>& grad_image);
  shared::AggregateParams params(const shared::FrameParams& p, const glm::vec3& background) const;

  Buffer<shared::Slot> slots_;   // [fragment], and in the barrier composition [pixel] more
  Buffer<cl_uint> slot_counts_;  // [pixel]
};

}  // namespace dpr
