// An object's pose from one image, or from several that show the same pose.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "dpr/adaptive_smoothing.hpp"
#include "dpr/annealed_smoothing.hpp"
#include "dpr/device.hpp"
#include "dpr/export.h"
#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/optimizer.hpp"
#include "dpr/scene.hpp"
#include "dpr/vectors.hpp"

namespace dpr {

/// A rigid motion: the object-to-world rotation and translation.
struct Pose {
  dmat3 rotation{1.0};
  dvec3 translation{0.0};
};

/// exp([r]x), and its inverse with an angle in [0, pi].
DPR_API dmat3 rotation_from_vector(dvec3 r);
DPR_API dvec3 vector_from_rotation(const dmat3& rotation);
/// The angle between two rotations, degrees, in [0, 180].
DPR_API double angle_degrees(const dmat3& a, const dmat3& b);

/// Unknowns of the target's light.
enum class PoseLight {
  fixed,     ///< nothing: it is the scene's
  gain,      ///< a gain on the mesh's colours, at least 0, and an offset, by channel
  harmonics  ///< distant light from everywhere: spherical harmonics to the second order, and an offset, by
             ///< channel
};

/// An image beside the target's colours with which hypotheses are compared, of the target's size; empty: none.
struct PoseObservation {
  Image image;
  float weight = 1;  ///< >= 0: factor on the weight that is found from the residuals
};

/// A rectangle of an image, pixels, from the corner of the top-left one.
struct PoseBox {
  float x = 0, y = 0, width = 0, height = 0;
};

/// Many hypotheses at once, from coarse to fine, each by Levenberg-Marquardt (Marquardt 1963) on the
/// difference between render and target, with exact Jacobians (forward mode). The default: it finds poses from
/// anywhere. It brings a smoothing of its own, the exact joint composition with a blur that follows the pixels;
/// of the scene's nothing is used. Levels whose pixels are larger than the mesh's triangles work on a coarser
/// mesh.
struct LeastSquares {
  /// Rotations tried at the coarsest level, spread evenly over all; 0: only the poses that solve() is given.
  unsigned rotations = 1152;
  unsigned coarsest =
      16;  ///< > 0: pixels on the short side of the coarsest level, which doubles up to the scene's
  unsigned iterations = 10;  ///< > 0: at most, a level; four times as many while the best still falls
  float blur = 0.25F;        ///< > 0: of the edges, in pixels of the level
  float blur_end = 0.1F;     ///< > 0: the same at the very end
  /// The noise of the blur. Noise of the pixel takes less time, and finds fewer poses of objects of many
  /// small parts.
  Noise noise = Noise::triangle;
  /// Robust loss for clutter and occlusion: r^2 / (1 + (r / scale)^2) of a pixel's colour difference r
  /// instead of r^2 (Geman & McClure 1985), so that pixels that differ by more than the scale hardly count.
  /// More hypotheses are kept on the way.
  bool robust = false;
  /// Scale of the robust loss, a colour difference; 0: four standard deviations of what the best hypotheses
  /// leave, from the median of its size, but between 0.1 and 0.12, anew at every level; 0.2 where the background is
  /// unknown.
  float robust_scale = 0;
  /// Anything may lie behind the object, as in a photograph: nothing is compared with the scene's background. A
  /// pixel that the object does not cover leaves 0.7 of what one of quite another colour does; outside of `box`, and
  /// 3% of its larger side, one that it covers does. In the box colours count too, with the probability p that a pixel
  /// shows what is in the box, by histograms of what lies in it and beside it: one that is not covered leaves sqrt(2 p)
  /// as much, and one that is covered 2 (1 - 2 p) more where p is below a half. Without a box the object may grow over
  /// all that its light can explain: it is never explained where it fills the picture. Takes a robust loss, colours,
  /// and no silhouette.
  bool unknown_background = false;
  /// Found along with the pose, in closed form for every hypothesis, as long as the scene's own light does
  /// not explain the target.
  PoseLight light = PoseLight::harmonics;
  /// Weight of every pixel, in [0, 1], in its first channel; of the target's size. Empty: 1.
  Image mask;
  /// Where the object is seen in the target, about. Pixels further away than a quarter of the larger side, and two
  /// pixels, are not compared. With a translation to look for, hypotheses other than the initial poses begin at the
  /// place from which the object fills the box. Perspective cameras only.
  std::optional<PoseBox> box{};

  // Observations, any of which will do without the others, and without colours. The squared residuals of each kind
  // count by their inverse variance, 1 for colours or else the first of these that there is, from the residuals that
  // the best hypotheses leave as a level begins: of colours from what nine of ten are below, of coverages that differ
  // and of depths from medians. Deviations count for no less than 0.05 of coverage, and a quarter of a pixel's side at
  // the object of depth; and before the finest level for no more than 0.25, and that side, since residuals say how
  // wrong poses are there. Scores of each kind are in the covariance.

  /// Coverage of a pixel by the object, in [0, 1], in the first channel: unlike `mask` a thing to match.
  PoseObservation silhouette;
  /// Distance along the camera's axis, world units, in the first channel, as AuxiliaryOutputs::depths has it. Pixels
  /// with an alpha of 0, or whose depth is 0 or not finite, have none. Depths are compared where both are, by a robust
  /// loss whose scale is four standard deviations. Without colours and silhouette depths of the object alone (no more
  /// pixels have one than the object could cover where it begins, nor further from there along the axis than its
  /// radius; with a translation to look for, than its diameter from their median) are a silhouette too, robustly
  /// compared. Depths of a whole scene, in which objects may shrink to fit anywhere, need colours or a silhouette beside
  /// them; a search refuses them alone.
  PoseObservation depth;
};

/// One hypothesis, by an optimizer on the exact gradients of the scene's own smoothing.
struct Descent {
  unsigned iterations = 200;
  OptimizerOptions optimizer;
  /// Way the scene's smoothing shrinks: from coarse to fine in fixed steps, or as the paper's schedule has
  /// it.
  std::variant<AnnealSchedule, AdaptiveSchedule> schedule;
  LossWeights loss = LossWeights::only(LossKind::mse);
  /// Further descents, each from a rotation turned away from the initial one, as long as the target is not
  /// explained.
  unsigned restarts = 6;
};

struct PoseOptions {
  std::variant<LeastSquares, Descent> method;
  /// Entries of Scene::meshes that move, as one rigid body: the pose is that of the first, and the others keep their
  /// places relative to it. The rest stand still where the scene has them, before the body or behind it: they are part
  /// of every picture, and of the depths. In light that is found along with the pose they are seen in its mean over
  /// all directions. Empty: the scene's only mesh.
  std::vector<std::size_t> meshes{};
  /// The translation too. LeastSquares then turns about the middle of the mesh's bounding box, wherever its
  /// origin lies; without, about the origin.
  bool solve_translation = false;
  bool solve_focal = false;  ///< a factor on the camera's focal length too; LeastSquares only
  /// The lens' k1 and k2 too, from the scene's or none; LeastSquares only, perspective cameras only.
  bool solve_distortion = false;
  /// In (0, 1): the target counts as explained once the loss is below that part of what is left without the
  /// pose, at the finest level: in descents by the initial pose; in least squares by the median over
  /// rotations, by the background alone, or by one colour everywhere, whichever is least; below the square
  /// root of that part if the loss is robust, as that of depths without colours is. Beside colours depths count as far
  /// as they leave more than half of what quite other depths do. Noise, as large as it is where the background shows,
  /// does not count unless the loss is robust. Where the background is unknown,
  /// of the pixels that the object covers, and of what these would leave uncovered. A search also needs every
  /// other pose to leave a quarter more, but for those that leave the same.
  float explained = 0.1F;
};

/// One iteration: the pose it evaluated, and how.
struct PoseIteration {
  unsigned iteration = 0;  ///< counted through all descents or levels
  unsigned descent = 0;    ///< 0, or the number of the restart
  double loss = 0;  ///< of the best hypothesis; comparable between iterations of one size and smoothing
  Smoothing smoothing;
  int width = 0, height = 0;  ///< of the images compared
  unsigned hypotheses = 1;    ///< that were turned together
  Pose pose;                  ///< of the best
  double focal_scale = 1;     ///< of the best
  dvec2 radial{0.0};          ///< of the best
  std::size_t body = 0;       ///< number of the body, of several; of the view, where the object moves
};

/// Why a pose does not count as explaining the target: what leaves little more than it.
enum class PoseDoubt {
  none,         ///< nothing: the target is explained
  wrong_poses,  ///< poses that are wrong: the initial one of descents, the median over rotations of least squares
  empty_picture,  ///< the background alone, or one colour everywhere
  other_pose,     ///< another pose that the search has found
};

/// A pose that was found, and how well it explains the target.
struct PoseHypothesis {
  Pose pose;
  double focal_scale = 1;  ///< factor on the scene's focal length
  double loss = 0;         ///< at the finest level
  dvec2 radial{0.0};       ///< what is added to k1 and k2 of the scene's lens
};

/// The scene's camera with what was found of it.
DPR_API Camera calibrated(const Camera& camera, double focal_scale, const dvec2& radial);

struct PoseResult : PoseHypothesis {
  Pose start;  ///< the (first) initial pose; in a search the scene's
  /// All poses that explain the target as well, this one first: more than one where the object's symmetry, or
  /// what is hidden of it, leaves them open. LeastSquares only.
  std::vector<PoseHypothesis> equals;
  /// Row-major covariance of a small motion: rotation vector on the left (world axes, radians), then, if
  /// solved for, the translation (world), the logarithm of the focal length, and k1 and k2. From the
  /// final Hessian, from residuals that go together in space, and from a share for what is wrong about the
  /// scene's light, surface and outline, sized by errors in pictures by other software and in photographs
  /// (bench/experiments/pose/uncertainty.py). It knows nothing of another valley. Empty where the image leaves a
  /// parameter open. LeastSquares only.
  std::vector<double> covariance;
  unsigned iterations = 0;                   ///< of all descents or levels
  unsigned descent = 0;                      ///< the one that found the pose
  bool explained = false;                    ///< see PoseOptions::explained
  PoseDoubt doubt = PoseDoubt::wrong_poses;  ///< why not
  /// The loss in parts of what is left without the pose: PoseOptions::explained has the bound.
  double unexplained_part = 1;
  /// [view] of several: each one's loss in parts of that of a picture without the object.
  std::vector<double> view_parts;
  /// Light found along with the pose: fixed if the scene's own light explains the target.
  PoseLight light = PoseLight::fixed;
  double seconds = 0;
  std::vector<PoseIteration> history;
};

/// A picture of an object, the camera that took it, and what else was observed in it, all of the scene's size.
/// Images are as LeastSquares has them; any of target, silhouette and depth will do without the others.
struct PoseView {
  Camera camera;
  Image target;
  Image mask{}, silhouette{}, depth{};
};

struct PoseProblem;

/// Finds the pose of an object of the scene from one view, or the one that several views show.
class DPR_API PoseSolver {
 public:
  /// Called once an iteration; false stops the solver, which then returns the best so far.
  using Callback = std::function<bool(const PoseIteration&)>;

  /// The target may be empty where LeastSquares has another observation. Throws InvalidArgument if the scene has several
  /// meshes and the options do not say which move, the first moving one's transform is singular, the sizes of target,
  /// mask, silhouette or depth differ from the scene's, one of these says nothing, the box holds nothing of the image,
  /// an option is out of its range, or a mesh has opacities below 1.
  PoseSolver(Device device, Scene scene, const Image& target, PoseOptions options = {});
  /// From pictures by known cameras, in place of the scene's, which all count the same: the loss is their mean, each
  /// in a light of its own where light is found. A search begins at the places that the first view's images leave open;
  /// a translation's steps are along the first camera's axes, and a focal length or a lens to look for is a change that
  /// all cameras share. LeastSquares without box, whose mask, silhouette and depth are empty; PoseObservation's weights
  /// hold. Throws InvalidArgument for each view as above, and without views.
  static PoseSolver of_views(Device device, const Scene& scene, const std::vector<PoseView>& views,
                             const PoseOptions& options = {});

  /// The pose of the scene's transform: rotation and translation, its scale taken apart.
  Pose scene_pose() const;
  /// Upper bound of the callback's calls in one descent, or through all levels.
  unsigned most_iterations() const;
  /// From an initial pose. Of poses that explain the target equally well, the nearest to it is the result.
  /// Throws InvalidArgument if the initial rotation is none.
  PoseResult solve(const Pose& initial, const Callback& callback = {}) const;
  /// From several initial poses at once (at least one). LeastSquares only.
  PoseResult solve(std::span<const Pose> initial, const Callback& callback = {}) const;
  /// From an unknown rotation. With a translation to look for the place is unknown too: hypotheses begin where the
  /// object fills the box; without one, where it fills the silhouette; or else where it fills what differs from the
  /// scene's background; and, if that explains nothing, is cut by the picture, or the loss is robust, at places all over
  /// the picture, from half to twice the distance of the scene's, and where it fills a mask that leaves out some of the
  /// picture. Without a translation to look for it is the scene's. LeastSquares with rotations only.
  PoseResult search(const Callback& callback = {}) const;

 private:
  std::vector<PoseProblem> problems() const;

  Device device_;
  Scene scene_;
  Image target_;
  PoseOptions options_;
  std::vector<PoseView> others_;  // beside the first view, which is in the scene, target and options
};

/// Meshes of the bodies that move in a scene, each on its own: [body] is a list as PoseOptions::meshes. Meshes in no
/// list stand still.
using PoseBodies = std::vector<std::vector<std::size_t>>;

/// Finds the poses of several bodies in one picture, in which they may hide each other: [body]. The initial poses are
/// the scene's. Each body is fitted in turn while the others stand where they were found last: robustly first, then
/// with all of them in the picture, then in rounds until none moves any more. A result is judged with the others at
/// their places: `explained` is true if all bodies together explain the picture. Light that is found along with the
/// poses is the same for all bodies, and is looked for where the scene's own light does not explain the picture.
/// LeastSquares without box and silhouette, neither focal length nor distortion to look for, and PoseOptions::meshes
/// empty. One body is fitted as by PoseSolver. Throws InvalidArgument as that does, and for a mesh in two bodies.
DPR_API std::vector<PoseResult> solve_bodies(const Device& device, const Scene& scene, const Image& target,
                                             const PoseBodies& bodies, const PoseOptions& options = {},
                                             const PoseSolver::Callback& callback = {});
/// Does the same from unknown poses, as PoseSolver::search() does.
DPR_API std::vector<PoseResult> search_bodies(const Device& device, const Scene& scene, const Image& target,
                                              const PoseBodies& bodies, const PoseOptions& options = {},
                                              const PoseSolver::Callback& callback = {});

}  // namespace dpr
