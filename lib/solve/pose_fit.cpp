// Poses about the middle of the object, in the part of the picture that shows it.
#include "solve/pose_fit.hpp"

#include <algorithm>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "solve/pose_pivot.hpp"
#include "solve/pose_places.hpp"
#include "solve/pose_search.hpp"
#include "solve/pose_window.hpp"

namespace dpr {
namespace {

/// One picture, or several of the same scene in other cameras.
FittedPose fit_about_middle(const Device& device, std::span<const PoseProblem> pictures,
                            std::span<const Pose> initial, Foreknowledge known,
                            const PoseSolver::Callback& callback) {
  const PosePivot pivot(pictures.front().scene, pictures.front().options);
  std::vector<PoseProblem> about_middle(pictures.begin(), pictures.end());
  for (PoseProblem& picture : about_middle) {
    const Camera camera = picture.scene.camera;
    picture.scene = pivot.scene();
    picture.scene.camera = camera;
  }
  std::vector<Pose> starts;
  for (const Pose& pose : initial) starts.push_back(pivot.to_middle(pose));
  PoseSolver::Callback report;
  if (callback) {
    report = [&](PoseIteration step) {
      step.pose = pivot.to_origin(step.pose);
      return callback(step);
    };
  }
  const bool anywhere = known == Foreknowledge::place;
  const PoseProblem& first = about_middle.front();
  const PosePlaces places(first, starts.front(), anywhere);
  if (anywhere) starts = {places.about()};
  FittedPose fitted = search_pose(device, about_middle, starts, places, known, report);
  PoseResult& result = fitted.result;
  pivot.to_origin(result.pose, result.covariance);
  result.pose = pivot.to_origin(result.pose);
  result.start = initial.front();
  for (PoseHypothesis& h : result.equals) h.pose = pivot.to_origin(h.pose);
  for (PoseIteration& step : result.history) step.pose = pivot.to_origin(step.pose);
  return fitted;
}

FittedPose fit_in_box(const Device& device, const PoseProblem& picture, const PoseBox& box,
                      std::span<const Pose> initial, Foreknowledge known,
                      const PoseSolver::Callback& callback) {
  const PoseProblem part = cut_to_box(picture.scene, picture.target, picture.options, box);
  return fit_about_middle(device, {&part, 1}, initial, known, callback);
}

/// A search where the picture differs from the scene's background, and all over it if that explains nothing.
FittedPose search_picture(const Device& device, const PoseProblem& picture, std::span<const Pose> initial,
                          const PoseSolver::Callback& callback) {
  bool goes_on = true;
  std::vector<PoseIteration> history;
  const PoseSolver::Callback report = [&](PoseIteration step) {
    step.iteration = static_cast<unsigned>(history.size());
    history.push_back(step);
    goes_on = !callback || callback(step);
    return goes_on;
  };
  std::optional<FittedPose> fitted;
  if (const std::optional<PoseBox> extent = whole_extent(picture)) {
    PoseProblem boxed = picture;
    auto& method = std::get<LeastSquares>(boxed.options.method);
    method.box = extent;
    method.coarsest =
        std::max(1U, method.coarsest * 3 / 4);  // the object fills two thirds of its box and the margin
    fitted = fit_in_box(device, boxed, *extent, initial, Foreknowledge::place, report);
  }
  if (!fitted || (!fitted->result.explained && goes_on)) {
    FittedPose other = fit_about_middle(device, {&picture, 1}, initial, Foreknowledge::place, report);
    if (!fitted || other.result.unexplained_part < fitted->result.unexplained_part) fitted = std::move(other);
  }
  fitted->result.history = std::move(history);
  return *std::move(fitted);
}

}  // namespace

FittedPose fit_pose(const Device& device, std::span<const PoseProblem> pictures,
                    std::span<const Pose> initial, Foreknowledge known,
                    const PoseSolver::Callback& callback) {
  if (pictures.size() > 1) return fit_about_middle(device, pictures, initial, known, callback);
  const PoseProblem& picture = pictures.front();
  const bool anywhere = known == Foreknowledge::place;
  if (const std::optional<PoseBox> box = box_of_search(picture.options, anywhere))
    return fit_in_box(device, picture, *box, initial, known, callback);
  return anywhere ? search_picture(device, picture, initial, callback)
                  : fit_about_middle(device, pictures, initial, known, callback);
}

FittedPose fit_pose(const Device& device, const Scene& scene, const Image& target, const PoseOptions& options,
                    std::span<const Pose> initial, Foreknowledge known,
                    const PoseSolver::Callback& callback) {
  const PoseProblem picture{scene, target, options};
  return fit_pose(device, {&picture, 1}, initial, known, callback);
}

}  // namespace dpr
