// An object's poses in a sequence of images, each from the one before.
#pragma once

#include <memory>
#include <vector>

#include "dpr/device.hpp"
#include "dpr/export.h"
#include "dpr/image.hpp"
#include "dpr/pose.hpp"
#include "dpr/scene.hpp"

namespace dpr {

enum class TrackStatus {
  found,    ///< searched for and found: in the first frame, or after frames in which it was lost
  tracked,  ///< followed from the frame before
  lost      ///< nothing that was tried explains the frame
};

/// LeastSquares with noise of the pixel, which takes less time than noise of the triangles, and shows fine meshes
/// without seams.
DPR_API LeastSquares track_least_squares();

struct TrackOptions {
  /// As for a single image, but that silhouettes and depths are the frames'. `mask` holds for every frame. `rotations`
  /// are tried where the object is looked for everywhere, and then divided among the places where it may be. The light
  /// is that of the first frame in which the object is found: fixed if the scene's own explains that, or else of the
  /// asked-for kind and found anew in every frame.
  LeastSquares method = track_least_squares();
  /// The translation too. The object then turns about the middle of the mesh's bounding box.
  bool solve_translation = false;
  /// In (0, 1): a frame counts as explained once the loss is below that part of what is left without the pose, or below
  /// its square root if the loss is robust (PoseOptions::explained). What a wrong pose leaves relative to a picture
  /// without the object is measured where the object is found first.
  float explained = 0.1F;
  /// Nothing is known of the rotation in the first frame. Else the scene's own pose is where it begins.
  bool search = false;
  /// In [0, 1]: part of the motion between the last two frames, a turn about the world's axes and a shift, that is
  /// expected again. 1: constant velocity; 0: the object stays.
  float damping = 0.9F;
  /// A lost object is looked for about its last place in every frame, and everywhere in the first frame without it and
  /// in every so many after that; 0: never everywhere.
  unsigned search_interval = 10;
  /// TrackedPose::covariance too, which takes about as long as a step.
  bool covariance = false;
};

/// What was seen at one time, each image of the scene's size.
struct TrackFrame {
  Image image;  ///< linear colours; alpha plays no part
  /// As LeastSquares has them, or empty in all frames. Frames may show nothing of the object: coverages may all be 0,
  /// and no pixel need have a depth.
  Image silhouette{}, depth{};
};

/// What a frame tells.
struct TrackedPose {
  TrackStatus status = TrackStatus::lost;
  /// Object to world, as PoseResult::pose. Of a lost object the guess from which it is looked for: no result.
  Pose pose;
  /// Mean over colour channels and pixels of squared differences, linear colours, at the frame's size; robust ones as
  /// LeastSquares::robust has them; with silhouettes and depths, weighed. Of a lost object that of the best pose that
  /// was tried.
  double loss = 0;
  /// The loss below which the frame counts as explained; 0 while the object has not been seen at all.
  double explained_below = 0;
  /// Row-major covariance of a small motion as PoseResult has it: rotation vector (world axes, radians), then the
  /// translation if it is looked for (world). Empty unless asked for, and of a lost object.
  std::vector<double> covariance{};
};

/// Follows the scene's only mesh through the images of one camera.
///
/// The first frame is a pose solver's (dpr/pose.hpp), and takes as long: some tenths of a second from the scene's pose,
/// seconds with a search. Each further frame begins at the pose that the motion so far predicts, as far down the solver's
/// pyramid of sizes as the last prediction was good, and takes Levenberg-Marquardt steps: two or three renders with
/// tangents at the frame's size, and some at smaller ones. If they do not explain the frame, or much worse than the frames
/// before, it begins anew at the coarsest size. An object that is lost all the same is searched for
/// (TrackOptions::search_interval), which takes tenths of a second about the last place and seconds everywhere.
///
/// Renderers and buffers are kept: a frame that is tracked builds no kernel and seldom allocates on the device, where the
/// object takes more room than ever before. They are made anew where the object's distance has changed by half.
/// Silhouettes and depths weigh by what the pose in the first frame with the object leaves of them. Results are the
/// same bits from run to run on a device. Not thread-safe; movable.
class DPR_API PoseTracker {
 public:
  /// Throws InvalidArgument as PoseSolver does, for a silhouette or depths of the method, and for options out of their
  /// range.
  explicit PoseTracker(Device device, const Scene& scene, TrackOptions options = {});
  ~PoseTracker();
  PoseTracker(PoseTracker&&) noexcept;
  PoseTracker& operator=(PoseTracker&&) noexcept;

  /// The pose in the next frame. Blocks. Throws InvalidArgument for an image of another size, a pixel out of its range,
  /// a silhouette beside an unknown background, and for images of other kinds than the first frame's; then nothing has
  /// changed, and the next frame may be tracked.
  TrackedPose track(const TrackFrame& frame);
  /// The same of colours alone.
  TrackedPose track(const Image& image) { return track(TrackFrame{image}); }

  struct DPR_LOCAL Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace dpr
