// A tracker's levels.
#include "solve/track_levels.hpp"

#include <cmath>

#include "solve/pose_pyramid.hpp"
#include "solve/resample.hpp"

namespace dpr {

LeastSquares observing(LeastSquares method, const TrackFrame& frame) {
  method.silhouette.image = frame.silhouette;
  method.depth.image = frame.depth;
  return method;
}

TrackLevels::TrackLevels(const Device& device, const Scene& scene, const PoseOptions& options,
                         const FittedPose& first, const Pose& near, const TrackFrame& frame,
                         std::span<const LossScales> scales)
    : space_(scene, near, options),
      camera_(scene.camera),
      near_depth_(view_depth(camera_, near.translation)),
      baseline_part_(first.baseline_part),
      frame_(&frame) {
  const LeastSquares method = observing(std::get<LeastSquares>(options.method), frame);
  std::vector<LevelShape> shapes = level_shapes(scene, method);
  shapes.pop_back();  // the last but one has the frame's size too
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    // The coarsest images constrain a light's direction so little that it would explain any pose.
    const bool is_coarse = i == 0 && shapes.size() > 1 && first.result.light == PoseLight::harmonics;
    const PoseLight light = is_coarse ? PoseLight::gain : first.result.light;
    levels_.emplace_back(new Level{
        .level = PoseLevel(device, {scene, frame.image, method}, space_, shapes[i], light, first.normals),
        .has_frame = true});
    PoseLevel& level = levels_.back()->level;
    if (scales.empty()) {
      const Hypothesis seen{near};
      level.set_color_scale(first.color_scale);
      level.weigh_observations({&seen, 1});
    } else {
      level.set_scales({scales[i]});
    }
  }
}

std::vector<LossScales> TrackLevels::scales() const {
  std::vector<LossScales> result;
  for (const auto& level : levels_) result.push_back(level->level.scales().front());
  return result;
}

void TrackLevels::set_frame(const TrackFrame& frame) {
  frame_ = &frame;
  for (const auto& level : levels_) {
    level->has_frame = false;
    level->unexplained = -1;
  }
}

PoseLevel& TrackLevels::at(std::size_t level) {
  Level& found = *levels_[level];
  if (!found.has_frame) found.level.set_images({frame_->image, frame_->silhouette, frame_->depth});
  found.has_frame = true;
  return found.level;
}

double TrackLevels::unexplained(std::size_t level) {
  Level& found = *levels_[level];
  if (found.unexplained < 0) found.unexplained = baseline_part_ * at(level).blank_loss();
  return found.unexplained;
}

bool TrackLevels::suits(const Pose& pose) const {
  constexpr double k_most = 1.5;
  const double ratio = view_depth(camera_, pose.translation) / near_depth_;
  return camera_.orthographic_height.has_value() || (ratio > 1 / k_most && ratio < k_most);
}

}  // namespace dpr
