// One level of the pose solver's pyramid: renders hypotheses at its resolution and compares them with the
// target.
#pragma once

#include <CL/opencl.hpp>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "solve/pose_space.hpp"

namespace dpr {

/// The loss about a hypothesis to second order, by Gauss and Newton.
struct NormalEquations {
  double loss = 0;
  PoseSpace::Step gradient{};   ///< of half the loss
  PoseSpace::Matrix hessian{};  ///< of half the loss
  PoseSpace::Matrix scatter{};  ///< sum over pixels of the outer products of what each adds to the gradient
};

class PoseLevel {
 public:
  /// `short_side`: in pixels, of its images; `blur`: of the edges, in those pixels.
  PoseLevel(const Device& device, const Scene& scene, const Image& target, const LeastSquares& options,
            const PoseSpace& space, int short_side, float blur);

  /// The mean squared error over colour channels and pixels, or its robust version, of every hypothesis.
  std::vector<double> losses(std::span<const Hypothesis> hypotheses);
  /// The same with derivatives, from forward differences of the images.
  std::vector<NormalEquations> linearize(std::span<const Hypothesis> hypotheses);

  int width() const { return scene_.width; }
  int height() const { return scene_.height; }
  const Smoothing& smoothing() const { return scene_.smoothing; }
  double pixel_ndc() const;

 private:
  /// Renders views in batches that fit the device and hands every image to a visitor, in order.
  template <typename Visitor>
  void render(std::span<const View> views, std::size_t images_together, const Visitor& visit);
  double loss(const cl_float4* image) const;
  void accumulate(const cl_float4* images, const PoseSpace::Step& step, NormalEquations& result) const;

  const PoseSpace& space_;
  Scene scene_;
  Renderer renderer_;
  std::vector<cl_float4> target_, images_;
  std::vector<float> weights_;  // [pixel], in [0, 1]
  double weight_ = 0;
  float inverse_scale_squared_ = 0;  // of the robust loss; 0: squares
};

}  // namespace dpr
