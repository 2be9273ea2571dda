// Hypotheses about an object's pose against a target, on the device: their losses in the light that explains each
// best, and the normal equations of the next step. Nothing of an image comes back to the host, only sums.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "kernels/normal_cells.hpp"
#include "kernels/normal_equations.hpp"
#include "solve/measured_sums.hpp"
#include "solve/pose_light.hpp"
#include "solve/pose_space.hpp"
#include "solve/slot_sums.hpp"

namespace dpr {

/// Loss about a hypothesis to second order, by Gauss and Newton.
struct NormalEquations {
  double loss = 0;
  PoseSpace::Step gradient{};   ///< of half the loss
  PoseSpace::Matrix hessian{};  ///< of half the loss
  PoseSpace::Matrix scatter{};  ///< sum over pixels of the outer products of what each adds to the gradient
};

/// Images of hypotheses.
struct HypothesisImages {
  std::size_t views;
  const Buffer<cl_float4>& colors;   ///< [view][pixel] RGBA; where light is found, unlit over black
  const Buffer<cl_float4>& normals;  ///< [view][pixel] object space, over black; where harmonics are found
  const Buffer<cl_float4>& depths;   ///< [view][pixel] along the camera's axis, over black; where some count
};

/// Derivatives of hypotheses' images by their parameters.
struct HypothesisTangents {
  const Buffer<cl_float4>&colors, &normals, &depths;  ///< [direction][view][pixel]
};

/// Colours and weights of a target's pixels, and what else was measured there.
struct WeighedTarget {
  std::vector<cl_float4> colors;
  std::vector<float> weights;  ///< of colours, in [0, 1]; all 0: colours do not count
  glm::vec3 background{0.0F};
  bool has_unknown_background = false;  ///< images are over black, and compared where they show the object
  /// Coverage, its weight, depth, its weight, these in [0, 1]; empty: neither.
  std::vector<cl_float4> measured{};
};

/// Scale of the robust loss of colours, a colour difference, 0: squares; and how coverage and depth count beside them.
struct LossScales {
  float color = 0;
  MeasuredWeights measured{};
};

/// Standard deviations of residuals of colours, coverage and depth; none where there are no residuals.
using Deviations = std::array<std::optional<float>, 1 + MeasuredSums::k_kinds>;

/// What the uncertainty of a hypothesis is judged from.
struct ScoreCells {
  NormalEquations equations;
  std::size_t columns = 0;  ///< of cells: squares of `side` pixels, row by row
  std::size_t side = 0;
  std::vector<double> scores;  ///< [direction][cell] what the cell adds to the gradient
  double weight = 0;           ///< of a squared residual in the loss
  double kept =
      1;  ///< the robust weights' mean over pixels, each counted as much as its derivatives say of the pose
  std::vector<double> residuals;  ///< [channel][cell] weighed sums
  double squares = 0;             ///< of the weighed residuals, summed over pixels and channels
  float median = 0;               ///< of the residuals' sizes where the object shows
};

/// The loss is the mean over colour channels and pixels of squares, or of their robust version (Geman and McClure
/// 1985), the light being the best one (pose_light.hpp); to which coverage and depth add theirs, summed over pixels
/// and divided by the same number. Where colours do not count, it is the mean over the pixels whose coverage counts,
/// or else those whose depth does.
class NormalSums {
 public:
  /// `directions`: number of parameters of a hypothesis.
  NormalSums(const Device& device, const WeighedTarget& target, PoseLight light, std::size_t directions);

  /// Other colours, and what else was measured, of as many pixels; colours' weights stay.
  void set_target(const WeighedTarget& target) {
    target_.upload(impl_of(device_), target.colors);
    if (measured_) measured_->set_target(target.measured);
  }

  /// Losses of every view.
  std::vector<double> losses(const HypothesisImages& images, const LossScales& scales);
  /// What coverage and depth add to the first hypothesis' loss.
  double measured_loss(const HypothesisImages& images, const MeasuredWeights& weights);
  std::vector<NormalEquations> linearize(const HypothesisImages& images, const HypothesisTangents& tangents,
                                         const LossScales& scales);
  /// Of a single view, in images of that width. 4 n + 24 bytes a cell come back; there are at most 64 x 64.
  ScoreCells score_cells(const HypothesisImages& images, const HypothesisTangents& tangents,
                         const LossScales& scales, std::size_t width);
  /// Scales for the robust loss, one a view, from the residuals that it leaves where it shows the object; 0 of a
  /// view that shows nothing.
  std::vector<float> scales(const HypothesisImages& images);
  /// Of what squares leave, one a view: of colours where the object shows, from what nine of ten are below; of
  /// coverages that differ from the silhouette, and of depths where the object shows, from medians.
  std::vector<Deviations> deviations(const HypothesisImages& images);

  /// [view][channel] of the last losses() or linearize().
  std::span<const std::array<ChannelLight, 3>> lights() const { return lights_; }
  /// What sums over pixels are divided by.
  double total() const { return total_; }

  /// Means of blocks of samples x samples, in images of a width of so many blocks.
  void average(const Buffer<cl_float4>& images, std::size_t width, std::size_t samples,
               Buffer<cl_float4>& means);

 private:
  using Lights = std::array<ChannelLight, 3>;
  std::string options(bool has_measured) const;
  /// Finds the views' lights, and leaves their residuals on the device; returns the losses, summed.
  std::vector<double> fit(const HypothesisImages& images, std::span<const float> scales);
  /// Residuals and their weights, of the active views in their lights; sums the loss and, for each channel, what
  /// its next light is found from.
  ViewSums weigh(const HypothesisImages& images, std::span<const float> scales,
                 const std::vector<cl_uint>& active);
  std::size_t light_sums() const;  ///< of a channel
  /// Lights of the active view at that place.
  void solve(const ViewSums& sums, std::size_t place, Lights& lights) const;
  /// Finds `left_` from `lit_`.
  void project(const HypothesisImages& images);
  /// Quantiles of the residuals' sizes where a view shows the object.
  std::vector<std::optional<float>> quantiles(double part, const HypothesisImages& images);

  std::size_t pixels_, terms_, directions_;
  double total_ = 0;
  bool counts_colors_ = false;
  cl_float4 background_;
  Device device_;
  Launcher<kernel::normal_loss, kernel::normal_counts, kernel::normal_lit, kernel::normal_equations,
           kernel::normal_means>
      launch_;
  std::optional<Launcher<kernel::normal_cells>> launch_cells_;  // made when first asked for
  std::optional<Launcher<kernel::normal_light, kernel::normal_cross, kernel::normal_left>> launch_light_;
  std::optional<MeasuredSums> measured_;
  SlotSums sums_;
  std::vector<Lights> lights_;  // [view]
  Buffer<cl_float4> target_;
  Buffer<float> weights_, fits_, residuals_, lit_, left_, taken_, cells_, units_;
  Buffer<cl_uint> active_;
  std::vector<cl_uint> uploaded_active_;  // what that holds
};

}  // namespace dpr
