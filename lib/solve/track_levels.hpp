// The levels at which a tracker looks at its frames: kept from frame to frame, with the frame in place of the last.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "dpr/pose_tracker.hpp"
#include "solve/pose_level.hpp"
#include "solve/pose_fit.hpp"

namespace dpr {

/// The method with what was seen in a frame beside colours.
LeastSquares observing(LeastSquares method, const TrackFrame& frame);

class TrackLevels {
 public:
  /// `first` says in which light, and by which normals, images show the object; `near` how far away it is. `scales`
  /// are those of other levels; without any, silhouettes and depths weigh by what `near` leaves of them.
  TrackLevels(const Device& device, const Scene& scene, const PoseOptions& options, const FittedPose& first,
              const Pose& near, const TrackFrame& frame, std::span<const LossScales> scales);

  /// The frame to look at; must stay as long as levels are asked for.
  void set_frame(const TrackFrame& frame);
  /// [level]
  std::vector<LossScales> scales() const;

  std::size_t size() const { return levels_.size(); }
  /// From coarse to fine, with the frame at its size.
  PoseLevel& at(std::size_t level);
  PoseLevel& finest() { return at(size() - 1); }
  double pixel_ndc(std::size_t level) const { return levels_[level]->level.pixel_ndc(); }
  /// Least loss of what explains nothing at that level.
  double unexplained(std::size_t level);

  const PoseSpace& space() const { return space_; }
  /// False if a pose is so much nearer or further that pixels and triangles no longer go together.
  bool suits(const Pose& pose) const;

 private:
  struct Level {
    PoseLevel level;
    bool has_frame;
    double unexplained = -1;  // of the frame; below 0: not known
  };

  PoseSpace space_;
  Camera camera_;
  double near_depth_, baseline_part_;
  std::vector<std::unique_ptr<Level>> levels_;
  const TrackFrame* frame_;
};

}  // namespace dpr
