// One level of the pose solver's pyramid, of one picture or of several that show the object in the same pose.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "solve/picture_level.hpp"

namespace dpr {

/// A picture and what else was observed in it; the scene has its camera.
struct LevelPicture {
  const Scene& scene;
  const Image& target;
  const LeastSquares& options;
};

/// Losses and their derivatives are the pictures' means.
class PoseLevel {
 public:
  /// As PictureLevel, for pictures of one size. Their light differs.
  PoseLevel(const Device& device, std::span<const LevelPicture> pictures, const PoseSpace& space,
            const LevelShape& shape, PoseLight light, CornerNormals normals,
            const std::optional<glm::dmat3>& rotation = {});
  PoseLevel(const Device& device, const LevelPicture& picture, const PoseSpace& space,
            const LevelShape& shape, PoseLight light, CornerNormals normals)
      : PoseLevel(device, {&picture, 1}, space, shape, light, normals) {}

  /// Another picture in place of an only one.
  void set_images(const PictureImages& images) { pictures_.front().set_images(images); }

  std::vector<double> losses(std::span<const Hypothesis> hypotheses);
  std::vector<NormalEquations> linearize(std::span<const Hypothesis> hypotheses);
  /// What the uncertainty of a hypothesis is judged from: the sum's equations, with the scatter that score_scatter()
  /// finds in each picture.
  NormalEquations judge(const Hypothesis& hypothesis);

  void estimate_scale(std::span<const Hypothesis> hypotheses);
  void weigh_observations(std::span<const Hypothesis> hypotheses);
  bool has_observations() const;
  /// [picture]
  std::vector<LossScales> scales() const;
  void set_scales(const std::vector<LossScales>& scales);
  void set_color_scale(float scale);
  /// Keeps colours' scales that are not 0 within bounds.
  void clamp_color_scales(float least, float most);
  /// The mean of the pictures'.
  float color_scale() const;
  double blank_loss();
  LossParts loss_parts(const Hypothesis& hypothesis);
  /// [picture] Loss in parts of a blank one's, without what says nothing against the hypothesis.
  std::vector<double> blank_parts(const Hypothesis& hypothesis);

  int width() const { return pictures_.front().width(); }
  int height() const { return pictures_.front().height(); }
  const Smoothing& smoothing() const { return pictures_.front().smoothing(); }
  double pixel_ndc() const { return pictures_.front().pixel_ndc(); }

 private:
  std::vector<PictureLevel> pictures_;
};

}  // namespace dpr
