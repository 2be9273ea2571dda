// An object's shape and colours from several images.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dpr/camera.hpp"
#include "dpr/device.hpp"
#include "dpr/export.h"
#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/light.hpp"
#include "dpr/mesh.hpp"
#include "dpr/mesh_loss.hpp"
#include "dpr/smoothing.hpp"
#include "dpr/vectors.hpp"

namespace dpr {

/// Knowledge of the camera that took an image: all; a camera that it is near; or nothing. The shape
/// solver wants all: find_camera() (dpr/photographs.hpp) finds it.
enum class CameraKnowledge { known, near, unknown };

/// An image of the object and the camera that took it.
struct ShapeView {
  Image image;
  Camera camera;
  bool has_alpha = true;  ///< false: the image has no silhouette and is compared in colour alone
  Image mask = {};  ///< its first channel is how much each pixel counts, at least 0; empty: all the same
  CameraKnowledge knowledge = CameraKnowledge::known;
  /// View depth in the first channel, and normals in world space, where a sensor or another program has
  /// measured them; alpha is how much each pixel counts, at least 0: 0 where nothing is known, as in what
  /// aov_image() makes. Empty: none. All views have them, or none has.
  Image depth = {}, normal = {};
};

/// Views from which a shape is found.
struct ShapeViews {
  int width = 0, height = 0;  ///< of every image
  vec3 background{0.0F};
  std::vector<ShapeView> views;
  /// Its textures, read at the corners, and the colours of its faces become colours of vertices, by means over the
  /// faces' areas; grey without any. None: the surface of all points that no view shows beside the object (the visual
  /// hull, Laurentini 1994), nor before what depths say, where enough views have alpha to bound it; else an icosphere
  /// in the common view.
  std::optional<Mesh> initial;
  std::optional<Smoothing> smoothing;  ///< at the finest level's end; none: as ShapeOptions::blur_end has it
  std::optional<Lights> lights = {};   ///< of all images, world space; none: colours are as they show
};

/// Reads the views format of lib/cli/README.md; images and the initial mesh are relative to the file. Throws
/// IoError where a file cannot be read, InvalidArgument for an unknown key, no views, or an image of another
/// size.
DPR_API ShapeViews read_views(const std::filesystem::path& file);

/// Motion of the mesh. large_steps: in the variables u = (I + lambda L) v, L the Laplacian of the mesh's
/// edges, by Adam with one step size for all (Nicolet, Jacobson & Jakob 2021). direct: Adam on the positions.
enum class ShapeSteps { large_steps, direct };

/// Way the smoothing shrinks in a level, from `blur` to `blur_end`. annealed: geometrically. adaptive: while
/// less of it means less loss, by the sign of the derivative that AdaptiveSmoothing watches, which doubles
/// samples too; it need not come to the end.
enum class ShapeSchedule { annealed, adaptive };

struct ShapeOptions {
  unsigned levels = 2;      ///< > 0: of resolution; each has half the pixels of the next on a side
  unsigned iterations = 0;  ///< of a level; 0: 100 from a visual hull, which is near, else 160
  unsigned batch = 6;       ///< > 0: views that an iteration renders, in turn
  /// Number that a device renders together, as MultiDeviceRenderer::set_chunk(). 0: all on one device, a
  /// twelfth on several.
  unsigned chunk = 0;
  float edge_pixels = 2.0F;  ///< > 0: length of edges to which a level begins to remesh, in its pixels
  /// Iterations between two remeshings, in the first half of a level; 0: the mesh keeps its faces.
  unsigned remesh_interval = 20;
  /// > 0: of the edges, in pixels of the level, at its beginning and at its end. Where the views have a
  /// smoothing of their own, that is the end, and it begins blur / blur_end times as wide.
  float blur = 1.0F, blur_end = 0.2F;
  ShapeSchedule schedule = ShapeSchedule::annealed;
  ShapeSteps steps = ShapeSteps::large_steps;
  float lambda = 2.0F;          ///< >= 0: how far a vertex takes its neighbours along
  double learning_rate = 0.05;  ///< > 0: of the positions, in radii of the sphere in the common view
  double learning_rate_end =
      0.2;  ///< > 0: of either learning rate, at a level's end, of that at its beginning
  double color_learning_rate = 0.05;  ///< >= 0; 0: the colours stay
  /// Moves the cameras too, each by a rotation and a translation, in the second half of every level: for at least two
  /// views, whose cameras are a few pixels off. Where the object stands is then known as well as the cameras are on
  /// average.
  bool refine_cameras = false;
  double camera_learning_rate = 0.01;  ///< > 0: of rotations in radians, and of translations in those radii
  LossWeights loss{.l1 = 4, .silhouette = 1};
  /// >= 0: of mean absolute differences of depths, in radii of that sphere, and of normals' components, where
  /// views have images of them. Each costs about as much as the images.
  float depth = 1, normal = 0.1F;
  MeshLossWeights regularizers;  ///< as if that sphere had a radius of 1; edge_target too
  /// >= 0: weight of the mean squared strain against the start, as rigid as possible (Sorkine & Alexa 2007):
  /// of how every vertex' edges differ from those of the start in the rotation that suits them best, over the
  /// start's squared lengths. Its faces have to stay: remesh_interval is 0 then.
  float rigidity = 0;
  unsigned checkpoint_interval = 50;  ///< > 0: iterations between two checkpoints
  /// In (0, 1): a view counts as explained if silhouette and coverage share all but that part of their union, and if
  /// colours leave less than that part of what the background alone leaves, as PoseOptions::explained; the square root
  /// of that part if the loss is robust. Colours that leave eight times as much as those of the median view are
  /// unexplained from a fifth of the part on. Where colours are not looked for, a silhouette decides alone.
  float explained = 0.1F;
};

/// The smoothing at the finest level's end: that of the views, or else Gaussian noise of the pixel's position
/// by `blur_end`, and of depths by the same length in the world. A level with half the pixels has twice the
/// blur. Throws InvalidArgument where cameras see no common point.
DPR_API Smoothing finest_smoothing(const ShapeViews& views, const ShapeOptions& options);

/// One iteration: what it evaluated, and how.
struct ShapeIteration {
  unsigned iteration = 0;  ///< counted through all levels
  unsigned level = 0;
  double loss = 0;  ///< images and regularisers; comparable between iterations of one level
  double image_loss = 0, mesh_loss = 0;
  Smoothing smoothing;
  int width = 0, height = 0;  ///< of the images compared
  std::size_t vertices = 0, faces = 0;
  std::vector<std::string> notes = {};  ///< a sentence for every device that was lost in it
};

/// How well a shape explains a view, from renders at the finest level's end; pixels count as the mask says.
struct ViewExplanation {
  /// Intersection over union of silhouette and coverage, where each is at least a half. None: the view has no
  /// silhouette.
  std::optional<double> iou;
  /// Squared (or robust) colour difference in parts of what the background alone leaves.
  double unexplained_part = 1;
  bool explained = false;  ///< see ShapeOptions::explained
};

struct ShapeResult {
  Mesh start, mesh;                     ///< with vertex colours
  bool finished = false;                ///< false: the callback stopped it
  double seconds = 0;                   ///< of this run
  std::vector<ShapeIteration> history;  ///< also of the runs that it goes on from
  std::vector<Camera> cameras;  ///< [view] as given, or as ShapeOptions::refine_cameras has found them
  std::vector<ViewExplanation> explanations = {};  ///< [view] of the mesh from these cameras
};

/// Finds a mesh with vertex colours that explains several images, on one device or on several, each with a
/// part of every batch. The result is the same to the bit on any devices of one kind, one or several, that
/// have the same ShapeOptions::chunk, or 0 on several; and if some of them are lost, as MultiDeviceRenderer
/// has it, down to the last.
class DPR_API ShapeSolver {
 public:
  /// Called after every iteration with the mesh as it is then; false stops the solver.
  using Callback = std::function<bool(const ShapeIteration&, const Mesh&)>;

  /// Throws InvalidArgument if there are no views, sizes differ, cameras see no common point, or an option is
  /// out of its range, or for what MultiDeviceRenderer refuses of a list of devices.
  ShapeSolver(Device device, ShapeViews views, ShapeOptions options = {});
  ShapeSolver(std::vector<Device> devices, ShapeViews views, ShapeOptions options = {});

  /// The mesh that solve() begins with, with vertex colours: ShapeViews::initial has which.
  const Mesh& start() const { return start_; }
  /// True if that is the hull that silhouettes leave. Silhouettes that do not go together leave none.
  bool begins_with_hull() const { return begins_with_hull_; }
  /// Most calls of the callback.
  unsigned most_iterations() const;

  /// From the start, or from the checkpoint if there is one in the file; leaves checkpoints there, the last
  /// when it ends. An interrupted run gives the same bits as one that was not, on devices as above; it may go
  /// on on others. An empty path: no checkpoints. Throws IoError where the file cannot be read or written,
  /// InvalidArgument where it belongs to other views or options.
  ShapeResult solve(const Callback& callback = {}, const std::filesystem::path& checkpoint = {}) const;

 private:
  std::vector<Device> devices_;
  ShapeViews views_;
  ShapeOptions options_;
  Mesh start_;
  bool begins_with_hull_ = false;
};

/// Iterations of find_texture().
inline constexpr unsigned k_texture_iterations = 10;

/// The mesh with a texture in the place of its colours, side x side texels in [0, 1], that explains the views: from the
/// colours, by ten steps of iterative reconstruction from all views, whose cameras have to be known. The texture is an
/// atlas in which two triangles share a square, with texels between them, so that bilinear filtering mixes none; texels
/// that no view shows keep the colour. The callback is called once an iteration; false stops. Throws InvalidArgument
/// for views as ShapeSolver does, for a mesh that is not valid, and where the side is too small for 4x4 texels for two
/// triangles, or above 16384.
DPR_API Mesh find_texture(std::vector<Device> devices, const ShapeViews& views, const Mesh& mesh, int side,
                          const std::function<bool(unsigned iteration, double loss)>& callback = {});

}  // namespace dpr
