/// Reference renderer: double precision, serial, brute force. The image of a scene and every gradient of the
/// gradient file. Per pixel: rasterize -> occupancy -> shade -> aggregate. Nothing is stored between forward
/// and backward; the backward pass walks the pixels again.
#pragma once

#include "aggregate.hpp"
#include "clip.hpp"
#include "loss.hpp"
#include "opacity.hpp"
#include "rasterize.hpp"
#include "scene.hpp"
#include "shade.hpp"
#include "transform.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace dpr::reference {

struct MeshGradient {
  std::vector<Vec3d> positions;  ///< object space
  std::vector<Vec3d> colors;     ///< follows vertex_colors or face_colors, whichever the mesh has
  Vec3d rotation;                ///< at zero of r in A <- exp([r]x) A, radians
  Vec3d translation;
  std::vector<Vec2d> texcoords;
  std::vector<std::vector<Vec3d>> textures;  ///< texels of each
  std::vector<double> opacities{};           ///< follows vertex_opacities or face_opacities
  std::vector<std::vector<double>> texel_opacities{};
};

struct CameraGradient {
  Vec3d rotation;
  Vec3d translation;
  double fov_y_degrees = 0.0;
  Intrinsics intrinsics;
  double orthographic_height = 0.0;
  Coefficients distortion{};
};

struct Gradients {
  std::vector<MeshGradient> meshes;
  CameraGradient camera;
  Lights lights = zero_like({});  ///< every number but shininess
  double sigma = 0.0;
  double gamma = 0.0;
  double alpha = 0.0;
  Vec3d background;
};

/// All meshes of a scene as one list of vertices and one of faces, in the order of the scene.
struct PreparedScene {
  Projection projection;
  std::vector<TransformedVertex> vertices;
  std::vector<std::size_t> first_vertex;  ///< of every mesh
  std::vector<std::size_t> face_mesh;     ///< mesh of every face
  std::vector<std::size_t> first_face;    ///< of every mesh
  ShadeScene shade;
  RasterizeParameters rasterize;
  AggregateParameters aggregate;
  std::vector<std::vector<std::size_t>>
      candidates;  ///< faces whose bounding box reaches the pixel, in face order
};

inline NdcTriangle ndc_triangle(const PreparedScene& prepared, std::size_t face) {
  NdcTriangle triangle;
  for (std::size_t i = 0; i < 3; ++i) triangle[i] = prepared.vertices[prepared.shade.faces[face][i]].ndc;
  return triangle;
}

inline HomogeneousFace homogeneous_face(const PreparedScene& prepared, std::size_t face) {
  HomogeneousFace corners;
  for (std::size_t i = 0; i < 3; ++i)
    corners[i] = prepared.vertices[prepared.shade.faces[face][i]].homogeneous;
  return corners;
}

inline bool is_clipped(const PreparedScene& prepared, std::size_t face) {
  return crosses_plane(homogeneous_face(prepared, face), prepared.rasterize);
}

/// The corners of what is seen of a face, NDC and depth; none where it is discarded.
inline std::vector<Vec3d> visible_corners(const PreparedScene& prepared, std::size_t face) {
  std::vector<Vec3d> corners;
  if (is_clipped(prepared, face)) {
    const Outline outline =
        clip_face(homogeneous_face(prepared, face), prepared.projection, prepared.rasterize);
    if (!(std::fabs(double_area(outline)) > 0.0)) return {};
    for (const OutlineCorner& corner : outline) corners.push_back(corner.ndc);
    return corners;
  }
  const NdcTriangle t = ndc_triangle(prepared, face);
  if (!is_discarded(t, prepared.rasterize)) corners.assign(t.begin(), t.end());
  return corners;
}

/// The fragment of a face at a point, if it has one. The face must not be discarded.
inline std::optional<Fragment> face_fragment(const PreparedScene& prepared, std::size_t face,
                                             const Vec2d& point) {
  if (is_clipped(prepared, face))
    return clipped_forward(homogeneous_face(prepared, face), prepared.projection, face, point,
                           prepared.rasterize);
  return rasterize_forward(ndc_triangle(prepared, face), face, point, prepared.rasterize);
}

/// Lists for every pixel the faces whose bounding box, grown by the blur radius, contains the pixel's centre.
inline std::vector<std::vector<std::size_t>> candidate_faces(const PreparedScene& prepared,
                                                             const ImageSize& size) {
  std::vector<std::vector<std::size_t>> candidates(static_cast<std::size_t>(size.width) *
                                                   static_cast<std::size_t>(size.height));
  const RasterizeParameters& p = prepared.rasterize;
  const double reach = p.metric == DistanceMetric::squared ? std::sqrt(p.blur_radius) : p.blur_radius;
  for (std::size_t f = 0; f < prepared.shade.faces.size(); ++f) {
    const std::vector<Vec3d> corners = visible_corners(prepared, f);
    if (corners.empty()) continue;
    const auto by_x = [](const Vec3d& a, const Vec3d& b) { return a.x < b.x; };
    const auto by_y = [](const Vec3d& a, const Vec3d& b) { return a.y < b.y; };
    const auto [leftmost, rightmost] = std::minmax_element(corners.begin(), corners.end(), by_x);
    const auto [lowest, highest] = std::minmax_element(corners.begin(), corners.end(), by_y);
    const double left = leftmost->x, right = rightmost->x, bottom = lowest->y, top = highest->y;
    for (int row = 0; row < size.height; ++row) {
      const double y = pixel_center(0, row, size).y;
      if (y < bottom - reach || y > top + reach) continue;
      for (int column = 0; column < size.width; ++column) {
        const double x = pixel_center(column, row, size).x;
        if (x < left - reach || x > right + reach) continue;
        candidates[static_cast<std::size_t>(row * size.width + column)].push_back(f);
      }
    }
  }
  return candidates;
}

inline bool is_perspective_correct(const Scene& scene) {
  return scene.perspective_correct && !scene.camera.orthographic_height;
}

inline PreparedScene prepare(const Scene& scene) {
  PreparedScene prepared;
  const ImageSize size{scene.width, scene.height};
  prepared.projection = make_projection(scene.camera, size);
  std::vector<Vec3d> world;
  std::vector<Face> faces;
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = scene.meshes[m];
    const std::size_t first = world.size();
    prepared.first_vertex.push_back(first);
    prepared.first_face.push_back(faces.size());
    for (const Vec3d& position : mesh.positions) {
      prepared.vertices.push_back(
          transform_forward(position, mesh.transform, scene.camera.view, prepared.projection));
      world.push_back(prepared.vertices.back().world);
    }
    for (const Face& face : mesh.faces) {
      faces.push_back({first + face[0], first + face[1], first + face[2]});
      prepared.face_mesh.push_back(m);
    }
  }
  prepared.shade =
      shade_prepare(std::move(world), std::move(faces), scene.lights, camera_center(scene.camera));
  prepared.shade.looks = face_looks(scene);
  const Smoothing& s = scene.smoothing;
  prepared.rasterize = {s.blur_radius, s.distance,         is_perspective_correct(scene),
                        true,          scene.camera.znear, scene.camera.zfar};
  prepared.aggregate = {s.composition,     s.depth_prior,      s.gamma,         s.alpha, scene.camera.znear,
                        scene.camera.zfar, s.background_depth, scene.background};
  prepared.candidates = candidate_faces(prepared, size);
  return prepared;
}

inline CornerColors corner_colors(const Scene& scene, const PreparedScene& prepared, std::size_t face) {
  const std::size_t m = prepared.face_mesh[face];
  const Mesh& mesh = scene.meshes[m];
  const std::size_t local = face - prepared.first_face[m];
  CornerColors corners;
  for (std::size_t i = 0; i < 3; ++i) {
    if (!mesh.vertex_colors.empty()) {
      corners[i] = mesh.vertex_colors[mesh.faces[local][i]];
    } else {
      corners[i] = mesh.face_colors.empty() ? Vec3d{1.0, 1.0, 1.0} : mesh.face_colors[local];
    }
  }
  return corners;
}

inline BaseColor base_of_face(const Scene& scene, const PreparedScene& prepared, std::size_t face) {
  const std::size_t m = prepared.face_mesh[face];
  const Mesh& mesh = scene.meshes[m];
  const std::size_t local = face - prepared.first_face[m];
  BaseColor base(corner_colors(scene, prepared, face));
  const int texture = face_texture(mesh, local);
  if (texture < 0) return base;
  base.texture = &mesh.textures[static_cast<std::size_t>(texture)];
  for (std::size_t i = 0; i < 3; ++i) base.texcoords[i] = mesh.texcoords[mesh.face_texcoords[local][i]];
  base.triangle = ndc_triangle(prepared, face);
  base.pixel = 2.0 / std::min(scene.width, scene.height);
  base.perspective_correct = is_perspective_correct(scene);
  return base;
}

/// Fragments of a pixel in face order.
inline std::vector<Fragment> pixel_fragments(const Scene& scene, const PreparedScene& prepared, int row,
                                             int column) {
  const Vec2d point = pixel_center(column, row, {scene.width, scene.height});
  std::vector<Fragment> fragments;
  for (std::size_t face : prepared.candidates[static_cast<std::size_t>(row * scene.width + column)]) {
    const auto fragment = face_fragment(prepared, face, point);
    if (fragment) fragments.push_back(*fragment);
  }
  return fragments;
}

inline Occupancy surface_occupancy(const Smoothing& s, const Fragment& fragment) {
  return occupancy_forward(s.occupancy_prior, fragment.distance, s.sigma);
}

inline BaseColor opacity_of_face(const Scene& scene, const PreparedScene& prepared, std::size_t face) {
  const std::size_t m = prepared.face_mesh[face];
  return opacity_base(base_of_face(scene, prepared, face), scene.meshes[m], face - prepared.first_face[m]);
}

/// Occupancies and colours of a pixel's fragments: what aggregation takes.
inline std::vector<FragmentInput> aggregate_inputs(const Scene& scene, const PreparedScene& prepared,
                                                   const std::vector<Fragment>& fragments) {
  std::vector<FragmentInput> inputs;
  for (const Fragment& fragment : fragments) {
    const Occupancy occupancy =
        opacity_forward(surface_occupancy(scene.smoothing, fragment),
                        opacity_of_face(scene, prepared, fragment.face), fragment.barycentric);
    const Vec3d color = shade_forward(prepared.shade, fragment.face, fragment.barycentric,
                                      base_of_face(scene, prepared, fragment.face));
    inputs.push_back({fragment.depth, occupancy.p, occupancy.log_p, color});
  }
  return inputs;
}

/// RGBA; alpha is the silhouette.
inline Image render(const Scene& scene) {
  const PreparedScene prepared = prepare(scene);
  Image image = make_image(scene.width, scene.height);
  for (int row = 0; row < scene.height; ++row) {
    for (int column = 0; column < scene.width; ++column) {
      const std::vector<Fragment> fragments = pixel_fragments(scene, prepared, row, column);
      const AggregateResult pixel =
          aggregate_forward(aggregate_inputs(scene, prepared, fragments), prepared.aggregate);
      double* rgba = &image.rgba[4 * static_cast<std::size_t>(row * scene.width + column)];
      for (std::size_t channel = 0; channel < 3; ++channel) rgba[channel] = pixel.color[channel];
      rgba[3] = pixel.silhouette;
    }
  }
  return image;
}

/// Sums over pixels before the transform is differentiated.
struct PixelSums {
  std::vector<Vec3d> ndc;          ///< per vertex: x, y in NDC and depth
  std::vector<Vec3d> homogeneous;  ///< per vertex, from faces that cross the near plane
  ShadeGradient shade;
  Projection projection;  ///< from those faces, where their corners stay
};

inline void add_color_gradient(const Scene& scene, const PreparedScene& prepared, std::size_t face,
                               const ShadeFragmentGradient& shade, Gradients& grad) {
  const std::size_t m = prepared.face_mesh[face];
  const Mesh& mesh = scene.meshes[m];
  const std::size_t local = face - prepared.first_face[m];
  if (!mesh.vertex_colors.empty()) {
    for (std::size_t i = 0; i < 3; ++i) grad.meshes[m].colors[mesh.faces[local][i]] += shade.corners[i];
  } else if (!mesh.face_colors.empty()) {
    grad.meshes[m].colors[local] += shade.corners[0] + shade.corners[1] + shade.corners[2];
  }
  const int texture = face_texture(mesh, local);
  if (texture < 0) return;
  std::vector<Vec3d>& texels = grad.meshes[m].textures[static_cast<std::size_t>(texture)];
  for (std::size_t i = 0; i < texels.size(); ++i) texels[i] += shade.texels[i];
  for (std::size_t i = 0; i < 3; ++i)
    grad.meshes[m].texcoords[mesh.face_texcoords[local][i]] += shade.texcoords[i];
}

inline void pixel_backward(const Scene& scene, const PreparedScene& prepared, int row, int column,
                           const Vec3d& grad_color, double grad_silhouette, Gradients& grad,
                           PixelSums& sums) {
  const Smoothing& s = scene.smoothing;
  const Vec2d point = pixel_center(column, row, {scene.width, scene.height});
  const std::vector<Fragment> fragments = pixel_fragments(scene, prepared, row, column);
  const AggregateGradient aggregate = aggregate_backward(aggregate_inputs(scene, prepared, fragments),
                                                         prepared.aggregate, grad_color, grad_silhouette);
  grad.gamma += aggregate.gamma;
  grad.alpha += aggregate.alpha;
  grad.background += aggregate.background;
  for (std::size_t k = 0; k < fragments.size(); ++k) {
    const Fragment& fragment = fragments[k];
    const FragmentInputGradient& input = aggregate.fragments[k];
    const OpacityGradient opacity =
        opacity_backward(surface_occupancy(s, fragment), opacity_of_face(scene, prepared, fragment.face),
                         fragment.barycentric, input.occupancy, input.log_occupancy);
    const std::size_t m = prepared.face_mesh[fragment.face];
    add_opacity_gradient(scene.meshes[m], fragment.face - prepared.first_face[m], opacity.surface,
                         grad.meshes[m]);
    const OccupancyGradient occupancy =
        occupancy_backward(s.occupancy_prior, fragment.distance, s.sigma, opacity.p, opacity.log_p);
    grad.sigma += occupancy.sigma;
    const ShadeFragmentGradient shade =
        shade_backward(prepared.shade, fragment.face, fragment.barycentric,
                       base_of_face(scene, prepared, fragment.face), input.color, sums.shade);
    add_color_gradient(scene, prepared, fragment.face, shade, grad);
    const FragmentGradient grad_fragment{occupancy.distance, input.depth,
                                         shade.barycentric + opacity.surface.barycentric};
    const bool clips = is_clipped(prepared, fragment.face);
    NdcTriangle corners;
    if (clips) {
      const ClippedGradient g =
          clipped_backward(homogeneous_face(prepared, fragment.face), prepared.projection, point,
                           prepared.rasterize, grad_fragment);
      corners = g.corners;
      sums.projection.scale += g.projection.scale;
      sums.projection.offset += g.projection.offset;
      for (std::size_t i = 0; i < g.distortion.size(); ++i) grad.camera.distortion[i] += g.distortion[i];
    } else {
      corners =
          rasterize_backward(ndc_triangle(prepared, fragment.face), point, prepared.rasterize, grad_fragment);
    }
    std::vector<Vec3d>& sum = clips ? sums.homogeneous : sums.ndc;
    for (std::size_t i = 0; i < 3; ++i) sum[prepared.shade.faces[fragment.face][i]] += corners[i];
  }
}

/// From the sums over the pixels to positions, transforms and camera.
inline void geometry_backward(const Scene& scene, const PreparedScene& prepared, const PixelSums& sums,
                              Gradients& grad) {
  Projection grad_projection = sums.projection;
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = scene.meshes[m];
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      const std::size_t vertex = prepared.first_vertex[m] + i;
      const TransformGradient g =
          transform_backward(mesh.positions[i], mesh.transform, scene.camera.view, prepared.projection,
                             sums.ndc[vertex], sums.shade.world[vertex], sums.homogeneous[vertex]);
      grad.meshes[m].positions[i] = g.position;
      grad.meshes[m].rotation += g.model_rotation;
      grad.meshes[m].translation += g.model_translation;
      grad.camera.rotation += g.view_rotation;
      grad.camera.translation += g.view_translation;
      grad_projection.scale += g.projection.scale;
      grad_projection.offset += g.projection.offset;
      for (std::size_t k = 0; k < g.distortion.size(); ++k) grad.camera.distortion[k] += g.distortion[k];
    }
  }
  const ViewGradient center = camera_center_backward(scene.camera, sums.shade.camera);
  grad.camera.rotation += center.rotation;
  grad.camera.translation += center.translation;
  const ProjectionGradient projection =
      projection_backward(scene.camera, {scene.width, scene.height}, grad_projection);
  grad.camera.fov_y_degrees = projection.fov_y_degrees;
  grad.camera.intrinsics = projection.intrinsics;
  grad.camera.orthographic_height = projection.orthographic_height;
}

/// Gradients of a scalar loss whose derivative for every value of the image is `grad_image` (RGBA, the
/// scene's size).
inline Gradients gradient(const Scene& scene, const Image& grad_image) {
  const PreparedScene prepared = prepare(scene);
  Gradients grad;
  for (const Mesh& mesh : scene.meshes) {
    const std::size_t colors =
        mesh.vertex_colors.empty() ? mesh.face_colors.size() : mesh.vertex_colors.size();
    grad.meshes.push_back({std::vector<Vec3d>(mesh.positions.size()),
                           std::vector<Vec3d>(colors),
                           {},
                           {},
                           std::vector<Vec2d>(mesh.texcoords.size()),
                           {}});
    for (const Texture& texture : mesh.textures)
      grad.meshes.back().textures.emplace_back(texture.texels.size());
    grad.meshes.back().opacities.resize(mesh.vertex_opacities.size() + mesh.face_opacities.size());
    for (const Texture& texture : mesh.opacity_textures)
      grad.meshes.back().texel_opacities.emplace_back(texture.texels.size());
  }
  PixelSums sums{std::vector<Vec3d>(prepared.vertices.size()),
                 std::vector<Vec3d>(prepared.vertices.size()),
                 make_shade_gradient(prepared.shade),
                 {}};
  for (int row = 0; row < scene.height; ++row) {
    for (int column = 0; column < scene.width; ++column) {
      const double* rgba = &grad_image.rgba[4 * static_cast<std::size_t>(row * scene.width + column)];
      pixel_backward(scene, prepared, row, column, {rgba[0], rgba[1], rgba[2]}, rgba[3], grad, sums);
    }
  }
  shade_finish_backward(prepared.shade, sums.shade);
  geometry_backward(scene, prepared, sums, grad);
  grad.lights = sums.shade.lights;
  return grad;
}

}  // namespace dpr::reference
