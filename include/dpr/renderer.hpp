// The differentiable renderer: a scene in, images out; gradients of the images in, gradients of the scene
// out.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "dpr/device.hpp"
#include "dpr/export.h"
#include "dpr/image.hpp"
#include "dpr/scene.hpp"
#include "dpr/vectors.hpp"

namespace dpr {

/// One view of a batch: a camera and where every mesh stands in it.
struct View {
  Camera camera;
  std::vector<mat4> transforms;  ///< [mesh] object to world

  bool operator==(const View&) const = default;
};

/// Derivative for a rotation vector r applied on the left of a matrix' linear part, A <- exp([r]x) A, at r =
/// 0 (radians, the translation column left alone), and for the translation column.
struct PoseGradient {
  dvec3 rotation{0.0}, translation{0.0};
};

struct CameraGradient {
  PoseGradient view;                   ///< of the world-to-camera matrix
  double fov_y_degrees = 0;            ///< 0 where the camera has intrinsics or is orthographic
  std::array<double, 4> intrinsics{};  ///< fx, fy, cx, cy; 0 where the camera has none
  std::array<double, 5> distortion{};  ///< k1, k2, p1, p2, k3; 0 without a lens of Brown's model
  std::array<double, 4> fisheye{};     ///< k1, k2, k3, k4; 0 without a fisheye
  double orthographic_height = 0;      ///< 0 where the camera has none
};

struct ViewGradient {
  CameraGradient camera;
  std::vector<PoseGradient> transforms;  ///< [mesh]
};

/// Gradients of a mesh, summed over its instances; all empty for an entry of Scene::meshes that is an
/// instance.
struct MeshGradient {
  std::vector<vec3> positions;  ///< [vertex] object space; empty if not requested
  std::vector<vec3> colors;     ///< [vertex] or [face], as the mesh has them; empty if not requested or white
  std::vector<vec2> texcoords;  ///< [texcoord]; empty if not requested or without textures
  std::vector<std::vector<vec3>> textures;  ///< [texture][height * width]; empty if not requested
  // Empty if not requested, or without lights.
  std::vector<vec3> normals{};      ///< [normal] object space
  std::vector<vec3> specular{};     ///< [material]
  std::vector<double> shininess{};  ///< [material] of the exponent in force, the material's or the lights'
  std::vector<float> opacities{};   ///< [vertex] or [face], as the mesh has them; empty if not requested
  /// [texture][height * width]; empty of a texture without, and if not requested
  std::vector<std::vector<float>> texel_opacities{};
};

/// Gradients of the views' own shapes (Renderer::set_shapes), object space; empty where views share the
/// scene's or none is requested.
struct ShapesGradient {
  std::vector<vec3> positions;  ///< [view][vertex]
  std::vector<vec3> colors;     ///< [view][color]
};

/// The gradients that GradientRequest asked for; the rest is zero or empty. Bitwise the same from run to run
/// on one device.
struct SceneGradient {
  std::vector<MeshGradient> meshes;  ///< summed over the views; empty arrays where these have their own
  ShapesGradient shapes;
  std::vector<ViewGradient> views;
  dvec3 ambient{0.0};
  // Gradients of lights, summed over the views.
  std::vector<PointLightGradient> lights;
  std::vector<DirectionalLightGradient> directional;
  std::vector<SpotLightGradient> spot;
  std::vector<vec3> harmonics;  ///< [k_harmonics], or empty without any
  double sigma = 0, gamma = 0, alpha = 0;
  dvec3 background{0.0};
};

/// Adds the gradient of another sum over the same scene and views. What is empty in one of them counts as 0.
/// Throws InvalidArgument for arrays of other lengths.
DPR_API void add(SceneGradient& to, const SceneGradient& from);

/// A direction in which a scene changes, with the members of its gradient: how fast each number does. What is
/// empty stays, and rotations and translations are those of PoseGradient. <gradient, direction> is the
/// derivative of a loss along it.
using SceneTangent = SceneGradient;

struct RenderStatistics {
  std::size_t faces = 0;  ///< triangles times views
  /// Faces nearer than znear, beyond zfar, culled, without area, or outside the image.
  std::size_t faces_dropped = 0;
  std::size_t pairs = 0;         ///< (8x8 tile, triangle) pairs
  std::size_t fragments = 0;     ///< (pixel, triangle) pairs within the blur radius
  std::size_t bands = 0;         ///< that the device's memory budget made of the frame
  std::size_t device_bytes = 0;  ///< held by this renderer
};

/// Arrays of meshes that setters replace and backward passes differentiate.
enum class ArrayId { positions, colors, texels, texcoords, normals, materials, opacities, texel_opacities };

/// An array of a mesh of the scene, or of one of its textures.
struct ArrayRef {
  ArrayId id;
  std::size_t mesh = 0, texture = 0;

  auto operator<=>(const ArrayRef&) const = default;
};

using ArrayValues = std::variant<std::span<const vec3>, std::span<const vec2>, std::span<const Material>,
                                 std::span<const float>>;

/// Setters of the arrays of meshes, of a renderer on one device or several: its set_array() by name.
template <class Owner>
class ArraySetters {
 public:
  /// Object space, for a mesh and all its instances: [vertex].
  void set_positions(std::size_t mesh, std::span<const vec3> positions) {
    set({ArrayId::positions, mesh}, positions);
  }
  /// [vertex] or [face], as the mesh has them.
  void set_colors(std::size_t mesh, std::span<const vec3> colors) { set({ArrayId::colors, mesh}, colors); }
  /// Linear RGB, for a texture of a mesh: [height * width].
  void set_texels(std::size_t mesh, std::size_t texture, std::span<const vec3> texels) {
    set({ArrayId::texels, mesh, texture}, texels);
  }
  /// For a mesh that has textures: [texcoord].
  void set_texcoords(std::size_t mesh, std::span<const vec2> texcoords) {
    set({ArrayId::texcoords, mesh}, texcoords);
  }
  /// Object space, of any length, for a mesh that gives some: [normal].
  void set_normals(std::size_t mesh, std::span<const vec3> normals) {
    set({ArrayId::normals, mesh}, normals);
  }
  /// For a mesh that has some: [material].
  void set_materials(std::size_t mesh, std::span<const Material> materials) {
    set({ArrayId::materials, mesh}, materials);
  }
  /// From 0 to 1, for a mesh that has some: [vertex] or [face]. Below 1 they need the joint composition.
  void set_opacities(std::size_t mesh, std::span<const float> opacities) {
    set({ArrayId::opacities, mesh}, opacities);
  }
  /// The same of a texture that has some: [height * width].
  void set_texel_opacities(std::size_t mesh, std::size_t texture, std::span<const float> opacities) {
    set({ArrayId::texel_opacities, mesh, texture}, opacities);
  }

 private:
  void set(const ArrayRef& array, const ArrayValues& values) {
    static_cast<Owner&>(*this).set_array(array, values);
  }
};

/// What the rigid image's samples show, for shading of the caller's own: a raster of `supersampling` samples a pixel
/// and axis, with a margin of samples around the image, from the top left. Layer 0 is each sample's nearest surface,
/// layer 1 the next behind it, and so on.
struct Samples {
  int width = 0, height = 0;  ///< samples of a view
  int supersampling = 1, margin = 0;
  int layers = 1;
  /// [layer][view][height][width] of the scene, the meshes' one after the other; -1: none
  std::vector<std::int32_t> faces;
  /// [layer][view][height][width] of the face's corners 1 and 2; 0 without a face
  std::vector<vec2> barycentrics;
  /// [layer][view][height][width] along the view direction, world units; 0 without a face
  std::vector<float> depths;
  /// [layer][view][height][width], where they were asked for: how fast the barycentrics change from sample to sample,
  /// of corner 1 to the right and down, then of corner 2; 0 without a face. Footprints of textures follow from these.
  std::vector<vec4> steps{};
};

class ImageLoss;
class MeshLoss;

/// Gradients of Renderer::resolve().
struct ResolveGradient {
  std::vector<float> samples;
  SceneGradient scene;
};

/// Derivatives of Samples along directions.
struct SamplesTangent {
  std::vector<vec2> barycentrics;  ///< [direction][layer][view][height][width]; 0 without a face
  std::vector<float> depths;       ///< the same
};

/// Renders one scene again and again. Buffers are kept from frame to frame. Not thread-safe; movable.
/// Every setter but set_gradients() ends the last frame: what reads it (image(), read_pixels(), a loss,
/// backward(), backward_pixels(), statistics(), auxiliary outputs) throws InvalidArgument until the next
/// forward(), as it does before the first.
class DPR_API Renderer : public ArraySetters<Renderer> {
 public:
  explicit Renderer(Device device);
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  /// Validates and uploads a scene; its camera and transforms become the only view. Throws InvalidArgument.
  void set_scene(const Scene& scene);
  /// Replaces the views (at least one); geometry stays on the device. The same launches render all of them.
  /// `first_view` counts the views of a larger batch that come before these: sampled noise is that of the
  /// larger batch then.
  void set_views(std::span<const View> views, std::size_t first_view = 0);
  void set_smoothing(const Smoothing& smoothing);
  /// Replaces an array of a mesh: as many elements as it has, of its type. ArraySetters has a function for
  /// each array. Throws InvalidArgument for an entry of Scene::meshes that is an instance of another, and for
  /// a mesh that has no such array.
  void set_array(const ArrayRef& array, const ArrayValues& values);

  /// Gives every view a shape of its own, so that one batch renders many meshes of one topology: positions
  /// [view][vertex], object space, and colours [view][color], each counting all meshes of the scene one after
  /// the other, without instances, which have their mesh's. Empty: the scene's own for all views, to which
  /// set_views() returns as well. With noise on the pixel, faces on the far side of closed meshes are kept where
  /// positions come from buffers, or a mesh has 65,536 faces or more: images and gradients differ by what these
  /// add at edges (a cube at 128x128: 0.008 of an image's 1, 4% of a pose's gradient).
  void set_shapes(std::span<const vec3> positions, std::span<const vec3> colors);
  /// New lights, or none.
  void set_lights(const std::optional<Lights>& lights);
  /// Other faces to leave out.
  void set_cull(Cull cull);
  /// A new background colour, linear RGB.
  void set_background(const vec3& background);
  /// Replaces what the next backward() computes. The last frame stays.
  void set_gradients(const GradientRequest& gradients);

  const Scene& scene() const;
  std::span<const View> views() const;

  /// Renders every view. The first frame of a scene, and one in several bands, blocks to read the sizes to
  /// allocate: of the pairs, and of the fragments. Later frames are enqueued without a wait, for the buffers
  /// that are there; where they turn out too small, the first call that needs the frame (image(), backward(),
  /// a loss, ...) renders it again. Throws InvalidArgument where a frame does not fit the device's memory
  /// budget; then that call may be the one to throw.
  void forward();
  /// The image of a view, from the last forward(). Blocks. Throws InvalidArgument where a setter was called
  /// since then, or there was none: an image is always that of the scene as it is.
  Image image(std::size_t view = 0) const;
  /// All images at once, [view][height][width], RGBA. Blocks. Throws as image() does.
  void read_pixels(std::span<vec4> pixels) const;

  /// Gradients of sum over views and pixels of <grad_images, image> (RGBA; the colour part counts the
  /// background). One image a view, of the renderer's size. After forward(), and throws as image() does where
  /// a setter came between; Monte Carlo draws the same noise again.
  SceneGradient backward(std::span<const Image> grad_images);
  /// The same from [view][height][width], RGBA.
  SceneGradient backward_pixels(std::span<const vec4> grad_pixels);
  /// The same for a loss that was evaluated on the last forward(); its gradient never leaves the device.
  SceneGradient backward(const ImageLoss& loss);
  /// The same, with the gradient of a mesh's own loss added to that of its positions, on the device. Both
  /// evaluated on the last forward(). Throws InvalidArgument if the scene asks for no positions' gradient.
  SceneGradient backward(const ImageLoss& loss, const MeshLoss& mesh_loss);

  /// Forward mode: the derivatives of the images along directions, RGBA, [direction][view]. After forward(), and
  /// throws as image() does where a setter came between. Exact, and the transpose of backward(): <u, J v> =
  /// <J^T u, v> up to rounding (relative error 1e-5; along gamma, whose terms cancel, 2e-4). Scene::gradients has no
  /// part in it. All directions share most of the work. Memory: of each direction its images and, up to 16 at a time,
  /// 44 bytes a fragment (56 in lit scenes with textures) and 16 to 64 a vertex and view. Where half the device's
  /// budget does not hold the fragments', the frame is rendered again in smaller bands. Throws InvalidArgument with
  /// sampled depths or triangles, for directions that change texels, texture coordinates, normals, materials or lights,
  /// or sigma of noise on the pixel, and for those that move the camera of a lit scene whose view matrices came from a
  /// buffer.
  std::vector<Image> tangent(std::span<const SceneTangent> directions);

  /// How many of each sample's surfaces samples() tells apart, from the nearest on: 1 unless set, at most 256. With
  /// more than one, whoever shades them may blend them as see-through: frames keep what lies behind other surfaces,
  /// faces on the far side of closed meshes too, and resolve() follows every contour that fewer than `count` surfaces
  /// hide. The library's own images take longer then, and differ by the far sides, as set_shapes() says. Throws
  /// InvalidArgument.
  void set_layers(int count);
  /// What the samples of the last forward() show, with noise on the pixel: of a scene without lights. Its colours have
  /// no part in it, but that resolve() follows edges where they jump, such as those of faces: others' shading may jump
  /// there. The nearest surfaces alone count, whatever gamma is. Blocks. Throws as image()
  /// does, and InvalidArgument without noise on the pixel, and with opacities below 1. dpr/interpolate.hpp and
  /// dpr/texture_map.hpp make colours of them.
  Samples samples(bool with_steps = false);
  /// Gradients of <grad_barycentrics, barycentrics> + <grad_depths, depths> by positions, transforms and cameras, as
  /// far as Scene::gradients asks for these. At contours, where samples jump from face to face, resolve_backward() has
  /// the rest.
  SceneGradient samples_backward(std::span<const vec2> grad_barycentrics, std::span<const float> grad_depths);
  /// Images of the caller's own shading with noise on the pixel: samples of any number of channels, [view][height]
  /// [width][channel] of samples(), blended across contours and blurred to pixels, [view][height][width][channel].
  /// Linear in the samples, which need a value where no face is too. Blocks; costs what forward() does from the samples
  /// on, for every four channels.
  std::vector<float> resolve(std::span<const float> samples, std::size_t channels);
  /// The gradients of <grad_pixels, resolve(samples)>: of the samples, and of the scene by way of the contours, by
  /// positions, transforms and cameras.
  ResolveGradient resolve_backward(std::span<const float> samples, std::size_t channels,
                                   std::span<const float> grad_pixels);
  /// Forward mode of samples(): how what they show changes along directions, as tangent() takes them, of which
  /// positions, transforms and cameras count. Blocks. Throws as samples() and tangent() do.
  SamplesTangent samples_tangent(std::span<const SceneTangent> directions);
  /// Forward mode of resolve(): the derivatives of its images along directions in which the samples change by
  /// `sample_tangents`, [direction] of their numbers. [direction][view][height][width][channel], by way of the samples
  /// and of the contours. The transpose of resolve_backward(), up to rounding. Blocks. Throws as resolve() and tangent()
  /// do.
  std::vector<float> resolve_tangent(std::span<const float> samples, std::size_t channels,
                                     std::span<const float> sample_tangents,
                                     std::span<const SceneTangent> directions);

  /// Statistics of the last forward(). Throws as image() does.
  RenderStatistics statistics() const;
  const Device& device() const;

  struct DPR_LOCAL Impl;

 private:
  friend struct Internals;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dpr
