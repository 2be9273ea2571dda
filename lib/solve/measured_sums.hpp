// What hypotheses leave of measured images beside colours, on the device: coverage and depth
// (kernels/normal_measured.cl).
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "kernels/normal_measured.hpp"
#include "solve/slot_sums.hpp"

namespace dpr {

/// Weight of squared residuals, in which the loss begins, and scale of their robust loss; 0: squares.
struct ResidualWeight {
  float weight = 1, scale = 0;
};

/// Of coverage and of depth.
using MeasuredWeights = std::array<ResidualWeight, 2>;

class MeasuredSums {
 public:
  /// `target`: [pixel] coverage, how much it counts, depth, how much it counts. `options` are those of the other
  /// sums' kernels.
  MeasuredSums(const Device& device, const std::vector<cl_float4>& target, const std::string& options);

  /// Another target, as large.
  void set_target(const std::vector<cl_float4>& target) { target_.upload(impl_of(device_), target); }

  /// Leaves residuals; returns the losses of the views, summed over pixels. Images are [view][pixel], RGBA; depths have
  /// depth times alpha for red, and are not read where none counts.
  std::vector<double> losses(const Buffer<cl_float4>& colors, const Buffer<cl_float4>& depths,
                             std::size_t views, const MeasuredWeights& weights);
  /// Leaves their derivatives. Tangents are [direction][view][pixel], of so many images.
  void move(const Buffer<cl_float4>& tangents, const Buffer<cl_float4>& depth_tangents,
            std::size_t directions, std::size_t views);
  /// Medians of the last losses' residuals, [view][coverage, depth]: of coverages that differ, and of depths where the
  /// object shows.
  std::vector<std::optional<float>> medians(std::size_t views);

  const Buffer<float>& residuals() const {
    return measured_;
  }  ///< [view][4][pixel] residuals, roots of weights
  const Buffer<float>& derivatives() const { return moved_; }  ///< [direction][view][2][pixel]
  static constexpr std::size_t k_kinds = 2;

 private:
  Device device_;
  SlotSums sums_;
  Launcher<kernel::normal_measured_loss, kernel::normal_measured_counts, kernel::normal_measured_moved>
      launch_;
  Buffer<cl_float4> target_;
  Buffer<float> measured_, moved_;
};

}  // namespace dpr
