// Means over pictures.
#include "solve/pose_level.hpp"

#include <algorithm>

#include "solve/pose_scatter.hpp"

namespace dpr {
namespace {

/// Adds a part of what a picture says.
void add_part(NormalEquations& sum, const NormalEquations& of_picture, double part) {
  sum.loss += part * of_picture.loss;
  for (std::size_t i = 0; i < sum.gradient.size(); ++i) sum.gradient[i] += part * of_picture.gradient[i];
  for (std::size_t i = 0; i < sum.hessian.size(); ++i) {
    sum.hessian[i] += part * of_picture.hessian[i];
    sum.scatter[i] += part * part * of_picture.scatter[i];
  }
}

}  // namespace

PoseLevel::PoseLevel(const Device& device, std::span<const LevelPicture> pictures, const PoseSpace& space,
                     const LevelShape& shape, PoseLight light, CornerNormals normals,
                     const std::optional<glm::dmat3>& rotation) {
  pictures_.reserve(pictures.size());
  for (const LevelPicture& p : pictures)
    pictures_.emplace_back(device, p.scene, p.target, p.options, space, shape, light, normals, rotation);
}

std::vector<double> PoseLevel::losses(std::span<const Hypothesis> hypotheses) {
  std::vector<double> result(hypotheses.size());
  for (PictureLevel& picture : pictures_) {
    const std::vector<double> own = picture.losses(hypotheses);
    for (std::size_t i = 0; i < own.size(); ++i) result[i] += own[i] / static_cast<double>(pictures_.size());
  }
  return result;
}

std::vector<NormalEquations> PoseLevel::linearize(std::span<const Hypothesis> hypotheses) {
  std::vector<NormalEquations> result(hypotheses.size());
  const double part = 1 / static_cast<double>(pictures_.size());
  for (PictureLevel& picture : pictures_) {
    const std::vector<NormalEquations> own = picture.linearize(hypotheses);
    for (std::size_t i = 0; i < own.size(); ++i) add_part(result[i], own[i], part);
  }
  return result;
}

NormalEquations PoseLevel::judge(const Hypothesis& hypothesis) {
  NormalEquations result;
  for (PictureLevel& picture : pictures_) {
    const ScoreCells cells = picture.score_cells(hypothesis);
    NormalEquations own = cells.equations;
    own.scatter = score_scatter(cells, picture.parameters(), picture.scales().color);
    add_part(result, own, 1 / static_cast<double>(pictures_.size()));
  }
  return result;
}

void PoseLevel::estimate_scale(std::span<const Hypothesis> hypotheses) {
  for (PictureLevel& picture : pictures_) picture.estimate_scale(hypotheses);
}

void PoseLevel::weigh_observations(std::span<const Hypothesis> hypotheses) {
  for (PictureLevel& picture : pictures_) picture.weigh_observations(hypotheses);
}

bool PoseLevel::has_observations() const {
  return std::ranges::any_of(pictures_, &PictureLevel::has_observations);
}

std::vector<LossScales> PoseLevel::scales() const {
  std::vector<LossScales> result;
  for (const PictureLevel& picture : pictures_) result.push_back(picture.scales());
  return result;
}

void PoseLevel::set_scales(const std::vector<LossScales>& scales) {
  for (std::size_t i = 0; i < pictures_.size(); ++i) pictures_[i].set_scales(scales[i]);
}

void PoseLevel::set_color_scale(float scale) {
  for (PictureLevel& picture : pictures_) picture.set_color_scale(scale);
}

void PoseLevel::clamp_color_scales(float least, float most) {
  for (PictureLevel& picture : pictures_) {
    const float scale = picture.scales().color;
    if (scale > 0) picture.set_color_scale(std::clamp(scale, least, most));
  }
}

float PoseLevel::color_scale() const {
  float sum = 0;
  for (const PictureLevel& picture : pictures_) sum += picture.scales().color;
  return sum / static_cast<float>(pictures_.size());
}

double PoseLevel::blank_loss() {
  double sum = 0;
  for (PictureLevel& picture : pictures_) sum += picture.blank_loss();
  return sum / static_cast<double>(pictures_.size());
}

LossParts PoseLevel::loss_parts(const Hypothesis& hypothesis) {
  LossParts mean;
  const auto count = static_cast<double>(pictures_.size());
  for (PictureLevel& picture : pictures_) {
    const LossParts own = picture.loss_parts(hypothesis);
    mean.uncovered += own.uncovered / count;
    mean.matched += own.matched / count;
    mean.noise += own.noise / count;
  }
  return mean;
}

std::vector<double> PoseLevel::blank_parts(const Hypothesis& hypothesis) {
  std::vector<double> result;
  for (PictureLevel& picture : pictures_) {
    const LossParts parts = picture.loss_parts(hypothesis);
    const double blank = picture.blank_loss() - parts.common();
    result.push_back(blank > 0 ? (picture.losses({&hypothesis, 1}).front() - parts.sum()) / blank : 1);
  }
  return result;
}

}  // namespace dpr
