// One level of the pose solver's pyramid: renders hypotheses at its resolution and compares them with the
// target.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "device/opencl_bindings.hpp"
#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "solve/level_scene.hpp"
#include "solve/pose_light.hpp"
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
  PoseLevel(const Device& device, const Scene& scene, const Image& target, const LeastSquares& options,
            const PoseSpace& space, const LevelShape& shape, PoseLight light, CornerNormals normals);

  /// The mean squared error over colour channels and pixels, or its robust version, of every hypothesis.
  std::vector<double> losses(std::span<const Hypothesis> hypotheses);
  /// The same with derivatives, from forward differences of the images.
  std::vector<NormalEquations> linearize(std::span<const Hypothesis> hypotheses);

  /// Makes the loss robust: Geman and McClure's with a scale from the residuals that the best of the
  /// hypotheses leave at the object, beyond which a pixel hardly counts. Without any hypothesis that shows
  /// the object, squares stay.
  void estimate_scale(std::span<const Hypothesis> hypotheses);
  /// Sets the scale of the robust loss, a colour difference; 0: squared differences.
  void set_scale(float scale);
  float scale() const { return scale_; }
  /// The loss of the better of two pictures without an object: the scene's background, and the target's mean
  /// colour.
  double blank_loss() const;

  int width() const { return scene_.width / samples_; }
  int height() const { return scene_.height / samples_; }
  const Smoothing& smoothing() const { return scene_.smoothing; }
  double pixel_ndc() const;

 private:
  /// Renders views in batches that fit the device and hands every image to a visitor, in order.
  template <typename Visitor>
  void render(std::span<const View> views, std::size_t images_together, const Visitor& visit);
  void render_batch(Renderer& renderer, std::span<const View> views, std::vector<cl_float4>& images);
  /// Some images of a batch, the normals beside them if the light needs them.
  HypothesisImages images_at(std::size_t pixel) const;
  /// Pixels that one of so many images from `images` on shows the object at.
  void find_shown(const HypothesisImages& images, std::size_t count);
  double pixel_loss(std::size_t i, const glm::vec3& color) const;
  double background_loss() const;

  std::vector<View> views_of(std::span<const Hypothesis> hypotheses) const;
  float deviation(const HypothesisImages& image);
  double loss(const HypothesisImages& image) const;
  double loss_in_best_light(const HypothesisImages& image);
  void accumulate(const HypothesisImages& images, const PoseSpace::Step& step, NormalEquations& result) const;
  void accumulate_in_best_light(const HypothesisImages& images, const PoseSpace::Step& step,
                                NormalEquations& result);

  const PoseSpace& space_;
  PoseLight light_;
  int samples_;
  Scene scene_;  // of the samples' size
  Renderer renderer_;
  std::optional<Renderer> normal_renderer_;
  std::vector<cl_float4> images_, normals_, drawn_;
  std::vector<std::size_t> shown_;
  WeighedTarget target_;
  double weight_ = 0;
  float scale_ = 0;
};

}  // namespace dpr
