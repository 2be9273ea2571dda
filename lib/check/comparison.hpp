// The library against the double-precision reference: the same scene in its types, the gradients side by
// side, and the pixels where single and double precision may rightly differ.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "dpr/mesh_loss.hpp"
#include "dpr/renderer.hpp"
#include "reference/mesh_loss.hpp"
#include "reference/renderer.hpp"
#include "scene/lens.hpp"
#include "scene/light_table.hpp"

namespace dpr::check {

inline reference::Vec3d to_reference(const glm::vec3& v) { return {v.x, v.y, v.z}; }

inline std::vector<reference::Vec3d> to_reference(const std::vector<glm::vec3>& values) {
  std::vector<reference::Vec3d> result;
  for (const glm::vec3& v : values) result.push_back(to_reference(v));
  return result;
}

inline reference::Mat4d to_reference(const glm::mat4& m) {
  reference::Mat4d rows{};
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      rows[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] = m[column][row];
    }
  }
  return rows;
}

inline reference::Image to_reference(const Image& image) {
  reference::Image result = reference::make_image(image.width, image.height);
  for (std::size_t i = 0; i < result.rgba.size(); ++i) {
    result.rgba[i] = image.pixels[i / 4][static_cast<int>(i % 4)];
  }
  return result;
}

/// The reference's are in the same order.
inline reference::Prior to_reference(Prior prior) { return static_cast<reference::Prior>(prior); }

inline reference::Distortion to_reference(const Distortion& lens) {
  reference::Distortion result{.is_fisheye = lens.model == LensModel::fisheye};
  std::ranges::copy(coefficients(lens), result.coefficients.begin());
  return result;
}

inline reference::Camera to_reference(const Camera& camera) {
  reference::Camera result{
      to_reference(camera.view), camera.fov_y_degrees, {}, camera.znear, camera.zfar, {}, {}};
  if (camera.intrinsics) {
    const Intrinsics& k = *camera.intrinsics;
    result.intrinsics = {k.fx, k.fy, k.cx, k.cy};
  }
  if (camera.distortion) result.distortion = to_reference(*camera.distortion);
  if (camera.orthographic_height) result.orthographic_height = *camera.orthographic_height;
  return result;
}

inline reference::Smoothing to_reference(const Smoothing& s) {
  return {
      to_reference(s.occupancy_prior),
      to_reference(s.depth_prior),
      s.sigma,
      s.gamma,
      s.alpha,
      s.composition == Composition::joint ? reference::Composition::joint : reference::Composition::barrier,
      blur_radius(s),
      s.background_depth,
      s.distance == DistanceMetric::euclidean ? reference::DistanceMetric::euclidean
                                              : reference::DistanceMetric::squared};
}

template <typename LightsOrGradient>
std::vector<double> light_numbers(LightsOrGradient from) {
  std::vector<double> numbers;
  for_each_light_number(from, [&](std::string_view, auto number) { numbers.push_back(number); });
  return numbers;
}

/// As many lights of every kind, with these numbers.
inline reference::Lights reference_lights(const std::vector<double>& numbers, std::size_t harmonics,
                                          std::size_t point, std::size_t directional, std::size_t spot) {
  reference::Lights lights;
  lights.harmonics.resize(harmonics);
  lights.point.resize(point);
  lights.directional.resize(directional);
  lights.spot.resize(spot);
  return displaced(zero_like(lights), numbers);
}

inline reference::Lights to_reference(const Lights& lights) {
  reference::Lights result =
      reference_lights(light_numbers(lights), lights.harmonics.size(), lights.point.size(),
                       lights.directional.size(), lights.spot.size());
  result.shininess = lights.shininess;
  result.shading = static_cast<reference::Shading>(lights.shading);  // in the same order
  return result;
}

inline void add_textures(const Mesh& mesh, reference::Mesh& result) {
  for (const glm::vec2& uv : mesh.texcoords) result.texcoords.push_back({uv.x, uv.y});
  for (const glm::uvec3& face : mesh.face_texcoords)
    result.face_texcoords.push_back({face.x, face.y, face.z});
  for (const Texture& t : mesh.textures) {
    result.textures.push_back({t.width, t.height, to_reference(t.texels),
                               static_cast<reference::Wrap>(t.wrap),
                               static_cast<reference::Filter>(t.filter)});
    reference::Texture opacities = result.textures.back();
    opacities.texels.clear();
    for (const float a : t.opacities) opacities.texels.push_back(to_reference(glm::vec3(a)));
    result.opacity_textures.push_back(opacities);
  }
  for (const std::uint32_t texture : mesh.face_textures)
    result.face_textures.push_back(texture == k_no_texture ? -1 : static_cast<int>(texture));
}

inline void add_looks(const Mesh& mesh, reference::Mesh& result) {
  result.normals = to_reference(mesh.normals);
  for (const glm::uvec3& face : mesh.face_normals) result.face_normals.push_back({face.x, face.y, face.z});
  for (const Material& m : mesh.materials)
    result.materials.push_back({to_reference(m.specular), m.shininess.value_or(0.0F)});
  result.face_materials.assign(mesh.face_materials.begin(), mesh.face_materials.end());
  result.vertex_opacities.assign(mesh.vertex_opacities.begin(), mesh.vertex_opacities.end());
  result.face_opacities.assign(mesh.face_opacities.begin(), mesh.face_opacities.end());
}

inline reference::Scene to_reference(const Scene& scene) {
  reference::Scene result;
  result.width = scene.width;
  result.height = scene.height;
  result.camera = to_reference(scene.camera);
  result.background = to_reference(scene.background);
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& from = mesh_of(scene, m);
    reference::Mesh mesh{to_reference(from.positions),
                         {},
                         to_reference(from.vertex_colors),
                         to_reference(from.face_colors),
                         to_reference(scene.meshes[m].transform),
                         {},
                         {},
                         {},
                         {}};
    add_textures(from, mesh);
    add_looks(from, mesh);
    for (const glm::uvec3& face : from.faces) mesh.faces.push_back({face.x, face.y, face.z});
    result.meshes.push_back(mesh);
  }
  if (scene.lights) result.lights = to_reference(*scene.lights);
  result.smoothing = to_reference(scene.smoothing);
  result.perspective_correct = scene.perspective_correct;
  return result;
}

/// The reference's loss of a mesh with other positions, [vertex][3].
inline double reference_loss(const Mesh& mesh, const MeshLossWeights& w, const std::vector<double>& flat) {
  std::vector<reference::Vec3d> positions;
  for (std::size_t i = 0; i < flat.size(); i += 3) positions.push_back({flat[i], flat[i + 1], flat[i + 2]});
  std::vector<reference::Face> faces;
  for (const glm::uvec3& f : mesh.faces) faces.push_back({f.x, f.y, f.z});
  const auto terms = reference::mesh_terms(positions, faces, static_cast<double>(w.edge_target));
  return static_cast<double>(w.laplacian) * terms.laplacian +
         static_cast<double>(w.edge_length) * terms.edge_length +
         static_cast<double>(w.normal_consistency) * terms.normal_consistency +
         static_cast<double>(w.flatness) * terms.flatness;
}

inline void append(std::vector<double>& list, double v) { list.push_back(v); }
inline void append(std::vector<double>& list, const glm::vec3& v) {
  list.insert(list.end(), {v.x, v.y, v.z});
}
inline void append(std::vector<double>& list, const glm::dvec3& v) {
  list.insert(list.end(), {v.x, v.y, v.z});
}
inline void append(std::vector<double>& list, const glm::vec2& v) { list.insert(list.end(), {v.x, v.y}); }
inline void append(std::vector<double>& list, const reference::Vec2d& v) {
  list.insert(list.end(), {v.x, v.y});
}
inline void append(std::vector<double>& list, const reference::Vec3d& v) {
  list.insert(list.end(), {v.x, v.y, v.z});
}

template <typename Value>
std::vector<double> flat(const std::vector<Value>& values) {
  std::vector<double> list;
  for (const Value& v : values) check::append(list, v);
  return list;
}

inline double norm(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return std::sqrt(sum);
}

/// A group of gradients that is compared as one vector.
struct Block {
  std::string name;  ///< the same for all meshes and lights
  std::vector<double> found;
  std::vector<double> expected;
};

/// Gradients of lights: a block for what has one name of one light.
inline std::vector<Block> blocks_of(const reference::Lights& grad) {
  std::vector<Block> blocks;
  reference::for_each_light_value(grad, [&](const char* name, const auto& value) {
    if (blocks.empty() || blocks.back().name != name) blocks.push_back({name, {}, {}});
    check::append(blocks.back().found, value);
  });
  return blocks;
}

/// Every gradient of a scene with one view, by block.
inline std::vector<Block> blocks_of(const SceneGradient& found) {
  std::vector<Block> blocks;
  const auto add = [&](const std::string& name, std::vector<double> values) {
    blocks.push_back({name, std::move(values), {}});
  };
  for (std::size_t m = 0; m < found.meshes.size(); ++m) {
    add("positions", flat(found.meshes[m].positions));
    add("colors", flat(found.meshes[m].colors));
    if (!found.meshes[m].texcoords.empty()) add("texcoords", flat(found.meshes[m].texcoords));
    const std::vector<float>& opacities = found.meshes[m].opacities;
    if (!opacities.empty()) add("opacities", {opacities.begin(), opacities.end()});
    for (const std::vector<float>& texels : found.meshes[m].texel_opacities)
      if (!texels.empty()) add("texel opacities", {texels.begin(), texels.end()});
    for (const std::vector<glm::vec3>& texels : found.meshes[m].textures) add("texels", flat(texels));
    const PoseGradient& pose = found.views[0].transforms[m];
    add("rotation", flat<glm::dvec3>({pose.rotation}));
    add("translation", flat<glm::dvec3>({pose.translation}));
  }
  const CameraGradient& camera = found.views[0].camera;
  add("camera rotation", flat<glm::dvec3>({camera.view.rotation}));
  add("camera translation", flat<glm::dvec3>({camera.view.translation}));
  add("fov", {camera.fov_y_degrees});
  add("intrinsics", {camera.intrinsics.begin(), camera.intrinsics.end()});
  add("orthographic height", {camera.orthographic_height});
  std::vector<double> lens(camera.distortion.begin(), camera.distortion.end());
  for (std::size_t k = 0; k < camera.fisheye.size(); ++k) lens[k] += camera.fisheye[k];  // one of them is 0
  add("distortion", lens);
  add("sigma", {found.sigma});
  add("gamma", {found.gamma});
  add("alpha", {found.alpha});
  add("background", flat<glm::dvec3>({found.background}));
  for (Block& block :
       blocks_of(reference_lights(light_numbers(found), found.harmonics.size(), found.lights.size(),
                                  found.directional.size(), found.spot.size()))) {
    blocks.push_back(std::move(block));
  }
  return blocks;
}

/// The same with the reference's values beside them.
inline std::vector<Block> blocks_of(const SceneGradient& found, const reference::Gradients& expected) {
  std::vector<Block> blocks = blocks_of(found);
  std::size_t next = 0;
  const auto set = [&](std::vector<double> values) { blocks.at(next++).expected = std::move(values); };
  for (const reference::MeshGradient& mesh : expected.meshes) {
    set(flat(mesh.positions));
    set(flat(mesh.colors));
    if (!mesh.texcoords.empty()) set(flat(mesh.texcoords));
    if (!mesh.opacities.empty()) set(mesh.opacities);
    for (const std::vector<double>& texels : mesh.texel_opacities)
      if (!texels.empty()) set(texels);
    for (const std::vector<reference::Vec3d>& texels : mesh.textures) set(flat(texels));
    set(flat<reference::Vec3d>({mesh.rotation}));
    set(flat<reference::Vec3d>({mesh.translation}));
  }
  set(flat<reference::Vec3d>({expected.camera.rotation}));
  set(flat<reference::Vec3d>({expected.camera.translation}));
  set({expected.camera.fov_y_degrees});
  const reference::Intrinsics& k = expected.camera.intrinsics;
  set({k.fx, k.fy, k.cx, k.cy});
  set({expected.camera.orthographic_height});
  set({expected.camera.distortion.begin(), expected.camera.distortion.end()});
  set({expected.sigma});
  set({expected.gamma});
  set({expected.alpha});
  set(flat<reference::Vec3d>({expected.background}));
  for (Block& block : blocks_of(expected.lights)) set(std::move(block.found));
  return blocks;
}

/// Euclidean norm of the difference relative to the reference's; where that is tiny, relative to what makes
/// `tolerance` 1e-7 absolute. Infinite where the sizes differ or a value is not finite.
inline double block_error(const Block& block, double tolerance) {
  if (block.found.size() != block.expected.size()) return INFINITY;
  std::vector<double> difference = block.found;
  for (std::size_t i = 0; i < difference.size(); ++i) difference[i] -= block.expected[i];
  const double error = norm(difference) / std::max(norm(block.expected), 1e-7 / tolerance);
  return std::isfinite(error) ? error : INFINITY;
}

/// Pixels at which the image jumps or kinks within a few roundings, in NDC.
struct Delicate {
  std::vector<bool> jump;  ///< [pixel] a triangle's distance equals the blur radius
  std::vector<bool> kink;  ///< [pixel] a jump, or on an edge's line, or as near to one edge as to another
};

inline void find_delicate(const reference::NdcTriangle& t, const reference::Vec2d& point, double reach,
                          double margin, std::vector<bool>::reference jump,
                          std::vector<bool>::reference kink) {
  const bool inside = reference::is_inside(t, point);
  const double distance = std::sqrt(reference::nearest_edge(t, point).squared_distance);
  if (!inside && std::fabs(distance - reach) < margin) jump = kink = true;
  if (!inside && distance > reach) return;
  // Nearer together than this, two closest points are one for the gradient.
  constexpr double apart2 = 1e-6;
  std::array<double, 3> to_edge{};
  std::array<reference::Vec2d, 3> nearest{};
  for (std::size_t i = 0; i < 3; ++i) {
    const reference::Vec2d start = reference::screen(t[i]);
    const reference::Vec2d along = reference::screen(t[(i + 1) % 3]) - start;
    const double squared = reference::dot(along, along);
    // Height over the edge's line: where it is zero a barycentric changes its sign.
    if (std::fabs(reference::cross(along, point - start)) < margin * std::sqrt(squared)) kink = true;
    const double at = std::clamp(reference::dot(point - start, along) / squared, 0.0, 1.0);
    nearest[i] = start + at * along;
    const reference::Vec2d difference = point - nearest[i];
    to_edge[i] = std::sqrt(reference::dot(difference, difference));
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const reference::Vec2d apart = nearest[i] - nearest[j];
    const bool are_nearest = std::min(to_edge[i], to_edge[j]) < distance + margin;
    if (are_nearest && std::fabs(to_edge[i] - to_edge[j]) < margin && reference::dot(apart, apart) > apart2) {
      kink = true;
    }
  }
}

inline Delicate delicate_pixels(const reference::Scene& scene, double margin = 2e-6) {
  reference::Scene wider = scene;
  wider.smoothing.blur_radius = scene.smoothing.blur_radius * 1.001 + 1e-9;
  const reference::PreparedScene prepared = reference::prepare(wider);
  const double reach = scene.smoothing.distance == reference::DistanceMetric::squared
                           ? std::sqrt(scene.smoothing.blur_radius)
                           : scene.smoothing.blur_radius;
  const std::size_t pixels = prepared.candidates.size();
  Delicate delicate{std::vector<bool>(pixels), std::vector<bool>(pixels)};
  for (std::size_t i = 0; i < pixels; ++i) {
    const int row = static_cast<int>(i) / scene.width;
    const int column = static_cast<int>(i) % scene.width;
    const reference::Vec2d point = reference::pixel_center(column, row, {scene.width, scene.height});
    for (const std::size_t face : prepared.candidates[i]) {
      const std::vector<reference::Vec3d> corners = reference::visible_corners(prepared, face);
      for (std::size_t k = 1; k + 1 < corners.size(); ++k) {
        find_delicate({corners[0], corners[k], corners[k + 1]}, point, reach, margin, delicate.jump[i],
                      delicate.kink[i]);
      }
    }
  }
  return delicate;
}

}  // namespace dpr::check
