// A picture at one level of the pose solver's pyramid: renders hypotheses at its resolution and compares them with the
// target and with what else was observed.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "solve/level_scene.hpp"
#include "solve/normal_equations.hpp"
#include "solve/pose_light.hpp"
#include "solve/pose_space.hpp"

namespace dpr {

/// What was seen in a picture, of the scene's size; empty: nothing of that kind.
struct PictureImages {
  const Image &target, &silhouette, &depth;
};

/// Parts of a hypothesis' loss that say nothing against it.
struct LossParts {
  double uncovered = 0;  ///< of pixels that it does not cover; 0 where the background is known
  double matched = 0;    ///< of depths that match, beside colours
  double noise = 0;      ///< of the target, where the background is known and losses are squares

  /// Those that any other hypothesis has too.
  double common() const { return uncovered + noise; }
  double sum() const { return common() + matched; }
};

class PictureLevel {
 public:
  /// An empty target: colours do not count. `space`: hypotheses' parameters, in the axes of its own camera, which need
  /// not be the scene's. `rotation`: the body's, where it is nearly known; light then has its directions at meshes that
  /// stand still too, instead of its mean.
  PictureLevel(const Device& device, const Scene& scene, const Image& target, const LeastSquares& options,
               const PoseSpace& space, const LevelShape& shape, PoseLight light, CornerNormals normals,
               const std::optional<glm::dmat3>& rotation = {});

  /// Another picture of the same size and kinds, where colours count. Nothing is allocated on the device.
  void set_images(const PictureImages& images);

  /// The loss of every hypothesis (NormalSums).
  std::vector<double> losses(std::span<const Hypothesis> hypotheses);
  /// The same with derivatives.
  std::vector<NormalEquations> linearize(std::span<const Hypothesis> hypotheses);

  /// The same of one, with what its uncertainty is judged from.
  ScoreCells score_cells(const Hypothesis& hypothesis);

  /// Makes the loss robust: Geman and McClure's with a scale from the residuals that the best of the
  /// hypotheses leave at the object, beyond which a pixel hardly counts. Without any hypothesis that shows
  /// the object, squares stay.
  void estimate_scale(std::span<const Hypothesis> hypotheses);
  /// Weighs coverage and depth beside colours, each kind by the inverse variance that the best of the hypotheses leave,
  /// from medians. Does nothing without either.
  void weigh_observations(std::span<const Hypothesis> hypotheses);
  bool has_observations() const { return !target_.measured.empty(); }
  /// Scales of the losses; those of colours 0: squared differences. Where the background is not known, a pixel that
  /// shows it leaves a part of what one of quite another colour does.
  void set_scales(const LossScales& scales) { scales_ = scales; }
  void set_color_scale(float scale);
  const LossScales& scales() const { return scales_; }
  /// The least loss of pictures without the object: the scene's background, the target's mean colour, and the meshes
  /// that stand still.
  double blank_loss();
  LossParts loss_parts(const Hypothesis& hypothesis);

  std::size_t parameters() const { return space_.size(); }
  int width() const { return scene_.width / samples_; }
  int height() const { return scene_.height / samples_; }
  const Smoothing& smoothing() const { return scene_.smoothing; }
  double pixel_ndc() const;

 private:
  /// Means over the samples of pixels, and of their tangents; empty where pixels are samples.
  struct Means {
    Buffer<cl_float4> images, tangents;
  };
  /// A renderer of a level, and what becomes of its images.
  struct Images {
    Renderer renderer;
    bool shows_depths = false;
    Means means{};
  };

  /// Hands the hypotheses to a visitor in batches that fit the device, of which each has so many images.
  template <typename Visitor>
  void in_batches(std::span<const Hypothesis> hypotheses, std::size_t images_each,
                  const Visitor& visit) const;
  std::vector<View> views_of(std::span<const Hypothesis> hypotheses) const;
  void render(Images& images, std::span<const View> views);
  /// What was rendered last, pixels being means over their samples.
  const Buffer<cl_float4>& rendered(const Images& images) const;
  const Buffer<cl_float4>& averaged(const Buffer<cl_float4>& samples, Buffer<cl_float4>& means);
  /// Takes the images to the level's size.
  void resample_images(const PictureImages& images);
  /// What was observed beside colours, at the level's size.
  std::vector<cl_float4> measured(const PictureImages& images) const;
  /// LossParts::noise
  double noise_loss(const Hypothesis& hypothesis);
  /// Images of hypotheses; what they show already is not rendered again.
  HypothesisImages render(std::span<const Hypothesis> hypotheses);
  /// The same beside their tangents.
  std::pair<HypothesisImages, HypothesisTangents> render_tangents(std::span<const Hypothesis> hypotheses);

  PoseSpace space_;  // seen by the scene's camera
  int samples_;
  bool is_finest_;
  Scene scene_;  // of the samples' size
  Images colors_;
  std::optional<Images> depths_;
  std::optional<Means> normals_;          // which the frames of colours show too
  std::vector<Hypothesis> shown_;         // by all images
  bool counts_colors_, trusts_coverage_;  // less, of one that is guessed from depths
  bool has_unknown_background_, weighs_observations_;
  Image mask_, covered_;  // of the level's size; what should be covered, if the background is not known
  std::array<float, 2> factors_;  // on the weights of coverage and depth
  WeighedTarget target_;
  std::optional<NormalSums> sums_;
  LossScales scales_;
};

}  // namespace dpr
