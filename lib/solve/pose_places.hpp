// Places where a search for a pose begins: in a box that holds the object, or all over the picture.
#pragma once

#include <cstddef>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "dpr/pose.hpp"
#include "solve/pose_candidates.hpp"
#include "solve/pose_level.hpp"
#include "solve/pose_problem.hpp"

namespace dpr {

/// For every rotation the place from which an object fills a box of the image: the bounding box of its projection has
/// the centre and the diagonal of the box.
class BoxPlaces {
 public:
  /// The camera must be a perspective one.
  BoxPlaces(const Scene& scene, const PoseBody& body, const PoseBox& box);

  /// Object-to-world translation. `distance`: factor on the distance from the camera.
  glm::dvec3 translation(const glm::dmat3& rotation, double distance = 1) const;

 private:
  std::vector<glm::dvec3> points_;  // the object's outermost ones, stretched
  glm::dmat3 axes_, from_camera_;   // world to camera, and back
  glm::dvec3 eye_;                  // the world's origin in the camera
  glm::dvec2 centre_, size_;        // of the box, in tangents
  double radius_, nearest_;
};

/// Hypotheses of which the best are kept.
struct PlaceGroup {
  std::vector<Hypothesis> hypotheses;
  std::size_t keep = 0;
};

/// Of a picture that shows something before the scene's background, and whole: its bounding box. None where the
/// background is not known, the object is not all that the scene has, the loss is robust, or no translation is looked for.
std::optional<PoseBox> whole_extent(const PoseProblem& problem);

/// Where the hypotheses of a fit begin.
class PosePlaces {
 public:
  /// For the scene's body, which turns about its origin. `anywhere`: of a search, for which the
  /// initial pose is a guess. Only with a translation to look for places differ from the initial one.
  PosePlaces(const PoseProblem& problem, const Pose& initial, bool anywhere);

  /// A pose at the place that is most likely known.
  const Pose& about() const { return about_; }
  /// Rotations spread over all, each at its most likely place.
  std::vector<Hypothesis> grid(std::size_t rotations) const;
  /// Hypotheses at other places, whose rotations are as many.
  std::vector<PlaceGroup> others(PoseLevel& level, std::size_t rotations) const;
  /// The levels without those whose pixels show next to nothing of an object that may be anywhere in the picture.
  std::vector<LevelShape> shapes(std::vector<LevelShape> shapes, const PoseSpace& space) const;

 private:
  std::vector<glm::dvec3> best_of_picture(PoseLevel& level) const;

  const Scene& scene_;
  Pose start_, about_;
  std::optional<BoxPlaces> box_;
  std::vector<BoxPlaces> beyond_;  // of an extent that the picture cuts: where the object goes on
  bool is_mask_ = false;           // the box is that of a mask, which may be larger than the object
  bool tries_start_ = false, scans_ = false;
  double radius_ = 0;
};

/// The box in which a search looks for the object: that of the options, or else that of the silhouette, or else that
/// of the mask, if it leaves out anything. None without a translation to look for, but for that of the options.
std::optional<PoseBox> box_of_search(const PoseOptions& options, bool anywhere);

}  // namespace dpr
