// Scenes of the C interface.
#include <bit>
#include <cmath>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "c/handles.hpp"
#include "scene/gradient_table.hpp"
#include "scene/light_table.hpp"
#include "scene/scene_parts.hpp"
#include "smoothing/option_fields.hpp"

using dpr::InvalidArgument;
using namespace dpr::c;

namespace dpr::c {

std::vector<glm::vec3> to_vectors(std::span<const float> values) {
  std::vector<glm::vec3> vectors;
  vectors.reserve(values.size() / 3);
  for (std::size_t i = 0; i + 2 < values.size(); i += 3)
    vectors.emplace_back(values[i], values[i + 1], values[i + 2]);
  return vectors;
}

std::vector<glm::vec2> to_pairs(std::span<const float> values) {
  std::vector<glm::vec2> pairs;
  pairs.reserve(values.size() / 2);
  for (std::size_t i = 0; i + 1 < values.size(); i += 2) pairs.emplace_back(values[i], values[i + 1]);
  return pairs;
}

glm::mat4 to_matrix(const float* values) {
  glm::mat4 matrix;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) matrix[column][row] = values[4 * row + column];
  }
  return matrix;
}

Camera to_camera(const dpr_camera* camera, const char* argument) {
  const dpr_camera c = versioned<dpr_camera>(camera, DPR_CAMERA_INIT, argument);
  Camera converted{.view = to_matrix(c.view),
                   .fov_y_degrees = c.fov_y_degrees,
                   .intrinsics = {},
                   .znear = c.znear,
                   .zfar = c.zfar};
  if (c.fx != 0 || c.fy != 0 || c.cx != 0 || c.cy != 0)
    converted.intrinsics = Intrinsics{c.fx, c.fy, c.cx, c.cy};
  if (c.distortion != nullptr && c.fisheye != nullptr)
    throw InvalidArgument(checks::in("distortion and fisheye", argument), "both", "one of them, or none");
  if (const float* const k = c.distortion) converted.distortion = Distortion{k[0], k[1], k[2], k[3], k[4]};
  if (const float* const k = c.fisheye) converted.distortion = fisheye(k[0], k[1], k[2], k[3]);
  if (c.orthographic_height != 0) converted.orthographic_height = c.orthographic_height;
  validate(converted, argument);
  return converted;
}

glm::vec3 to_vector(const float* values) { return {values[0], values[1], values[2]}; }

namespace {

/// An array of [count][3]; empty for NULL.
std::vector<glm::vec3> triples(const float* values, std::size_t count) {
  if (!values) return {};
  return to_vectors({values, 3 * count});
}

/// Indices of vertices are 32 bits wide.
void require_count(std::size_t count, const char* argument) {
  constexpr std::size_t k_most = 0xffffffffU / 3;
  if (count > 0 && count <= k_most) return;
  throw InvalidArgument(argument, std::to_string(count), "1 to " + std::to_string(k_most));
}

/// The lights of a kind, or the textures of a mesh; few of either.
template <class Item>
std::span<const Item> span_of(const Item* items, std::size_t count, const char* argument) {
  if (count > 0) deref(items, argument);
  constexpr std::size_t k_most = 1U << 16U;
  if (count > k_most)
    throw InvalidArgument("count (" + std::string(argument) + ")", std::to_string(count),
                          "at most " + std::to_string(k_most));
  return {items, count};
}

/// Lights of a kind, whose structs have the same members in both interfaces.
template <class Light, class Given>
std::vector<Light> to_list(const Given* given, std::size_t count, const char* argument) {
  std::vector<Light> list;
  for (const Given& light : span_of(given, count, argument)) list.push_back(std::bit_cast<Light>(light));
  return list;
}

/// Indices of a face's three corners.
std::vector<glm::uvec3> to_indices(const std::uint32_t* values, std::size_t count) {
  std::vector<glm::uvec3> indices;
  indices.reserve(count);
  for (std::size_t i = 0; i < 3 * count; i += 3)
    indices.emplace_back(values[i], values[i + 1], values[i + 2]);
  return indices;
}

Texture to_texture(const dpr_texture& given, const float* opacities, const std::string& argument) {
  deref(given.texels, (argument + ".texels").c_str());
  Texture texture{.width = given.width,
                  .height = given.height,
                  .texels = {},
                  .wrap = static_cast<Wrap>(given.wrap),
                  .filter = static_cast<Filter>(given.filter)};
  const auto can_be_side = [](int side) { return side >= 1 && side <= checks::k_largest_side; };
  if (can_be_side(given.width) && can_be_side(given.height)) {  // validate() tells of others
    const auto rows = static_cast<std::size_t>(given.height), columns = static_cast<std::size_t>(given.width);
    texture.texels = triples(given.texels, rows * columns);
    if (opacities) texture.opacities.assign(opacities, opacities + rows * columns);
  }
  return texture;
}

/// Copies the mesh's textures; validate() checks how their parts fit.
void copy_textures(const dpr_mesh& given, Mesh& mesh) {
  if (given.texcoords || given.texcoord_count > 0) {
    deref(given.texcoords, "mesh.texcoords");
    require_count(given.texcoord_count, "mesh.texcoord_count");
    mesh.texcoords = to_pairs({given.texcoords, 2 * given.texcoord_count});
  }
  if (given.face_texcoords) mesh.face_texcoords = to_indices(given.face_texcoords, given.face_count);
  for (const dpr_texture& texture : span_of(given.textures, given.texture_count, "mesh.textures")) {
    const std::size_t i = mesh.textures.size();
    mesh.textures.push_back(to_texture(texture, given.texel_opacities ? given.texel_opacities[i] : nullptr,
                                       checks::element("mesh.textures", i)));
  }
  if (given.face_textures)
    mesh.face_textures.assign(given.face_textures, given.face_textures + given.face_count);
}

/// Its normals, materials and opacities.
void copy_reflection(const dpr_mesh& given, Mesh& mesh) {
  if (given.normals) {
    if (!given.face_normals)
      throw InvalidArgument("mesh.normals", "no face_normals", "both, or neither of the two");
    require_count(given.normal_count, "mesh.normal_count");
    mesh.normals = triples(given.normals, given.normal_count);
  }
  if (given.face_normals) mesh.face_normals = to_indices(given.face_normals, given.face_count);
  mesh.materials = to_materials(given.materials, given.material_count, "mesh.materials");
  if (given.face_materials)
    mesh.face_materials.assign(given.face_materials, given.face_materials + given.face_count);
  if (given.vertex_opacities)
    mesh.vertex_opacities.assign(given.vertex_opacities, given.vertex_opacities + given.vertices);
  if (given.face_opacities)
    mesh.face_opacities.assign(given.face_opacities, given.face_opacities + given.face_count);
}

}  // namespace

std::vector<Material> to_materials(const dpr_material* given, std::size_t count, const char* argument) {
  std::vector<Material> materials;
  for (const dpr_material& material : span_of(given, count, argument)) {
    materials.push_back({to_vector(material.specular), std::nullopt});
    if (material.shininess != 0) materials.back().shininess = material.shininess;
  }
  return materials;
}

Mesh to_mesh(const dpr_mesh& mesh) {
  deref(mesh.positions, "mesh.positions");
  deref(mesh.faces, "mesh.faces");
  require_count(mesh.vertices, "mesh.vertices");
  require_count(mesh.face_count, "mesh.face_count");
  Mesh m;
  m.positions = triples(mesh.positions, mesh.vertices);
  m.faces = to_indices(mesh.faces, mesh.face_count);
  m.vertex_colors = triples(mesh.vertex_colors, mesh.vertices);
  m.face_colors = triples(mesh.face_colors, mesh.face_count);
  copy_textures(mesh, m);
  copy_reflection(mesh, m);
  validate(m);
  return m;
}

namespace {

/// NULL: the identity.
glm::mat4 to_transform(const float* given, const char* argument) {
  const glm::mat4 transform = given ? to_matrix(given) : glm::mat4(1);
  checks::require_affine(transform, argument);
  return transform;
}

Instance to_instance(const dpr_mesh* given) {
  const dpr_mesh mesh = versioned<dpr_mesh>(given, DPR_MESH_INIT, "mesh");
  return {to_mesh(mesh), to_transform(mesh.transform, "mesh.transform")};
}

}  // namespace

std::optional<Lights> to_lights(const dpr_lights* given) {
  if (!given) return std::nullopt;
  const dpr_lights lights = versioned<dpr_lights>(given, DPR_LIGHTS_INIT, "lights");
  const auto shading = static_cast<std::size_t>(lights.shading);
  if (shading >= k_shadings.size())
    throw InvalidArgument("lights.shading", std::to_string(shading), "a dpr_shading");
  Lights converted;
  converted.ambient = to_vector(lights.ambient);
  converted.shininess = lights.shininess;
  converted.shading = static_cast<Shading>(shading);
  converted.point = to_list<PointLight>(lights.point, lights.point_count, "lights.point");
  converted.directional =
      to_list<DirectionalLight>(lights.directional, lights.directional_count, "lights.directional");
  converted.spot = to_list<SpotLight>(lights.spot, lights.spot_count, "lights.spot");
  if (lights.harmonics) converted.harmonics = triples(lights.harmonics, k_harmonics);
  validate(converted);
  return converted;
}

Smoothing smoothing_of(const dpr_scene& scene) {
  return resolve_smoothing(scene.smoothing, scene.scene.width, scene.scene.height, scene.of_file);
}

Scene resolved(const dpr_scene& scene) {
  Scene resolved = scene.scene;
  resolved.smoothing = smoothing_of(scene);
  return resolved;
}

namespace {

void set_smoothing(dpr_scene* scene, const char* key, const OptionValue& value) {
  SmoothingOptions& options = deref(scene, "scene").smoothing;
  const std::string name = &deref(key, "key");
  if (set_option(options, name, value, name)) return;
  throw InvalidArgument("key (smoothing)", "\"" + name + "\"", one_of(option_keys()));
}

}  // namespace

GradientRequest to_request(const char* const* names, std::size_t count) {
  if (count > 0) deref(names, "names");
  if (count > gradient_names().size()) {
    throw InvalidArgument("count (names)", std::to_string(count),
                          "at most " + std::to_string(gradient_names().size()));
  }
  GradientRequest request = no_gradients();
  for (const char* name : std::span(names, count))
    request.*parse_gradient(&deref(name, "names"), "names") = true;
  return request;
}

}  // namespace dpr::c

dpr_status dpr_scene_create(int width, int height, dpr_scene** scene) {
  return guarded([&] {
    deref(scene, "scene");
    require_size(width, height, "size (scene)");
    dpr_scene made;
    made.scene.width = width;
    made.scene.height = height;
    give(scene, std::move(made));
  });
}

dpr_status dpr_scene_read(const char* file, dpr_scene** scene) {
  return guarded([&] {
    deref(file, "file");
    deref(scene, "scene");
    dpr::Scene read = dpr::read_scene(file);
    const dpr::Smoothing smoothing = read.smoothing;
    give(scene, std::move(read), dpr::SmoothingOptions{}, smoothing);
  });
}

dpr_status dpr_scene_add_mesh(dpr_scene* scene, const dpr_mesh* mesh) {
  return guarded([&] { deref(scene, "scene").scene.meshes.push_back(to_instance(mesh)); });
}

dpr_status dpr_scene_add_instance(dpr_scene* scene, std::size_t mesh, const float* transform) {
  return guarded([&] {
    dpr::Scene& s = deref(scene, "scene").scene;
    dpr::require_source(s.meshes, s.meshes.size(), mesh, "mesh (instance)");
    s.meshes.push_back({{}, to_transform(transform, "transform"), mesh});
  });
}

dpr_status dpr_scene_set_camera(dpr_scene* scene, const dpr_camera* camera) {
  return guarded([&] { deref(scene, "scene").scene.camera = to_camera(camera, "camera"); });
}

dpr_status dpr_scene_set_background(dpr_scene* scene, const float color[3]) {
  return guarded([&] {
    deref(scene, "scene");
    const glm::vec3 background = to_vector(&deref(color, "color"));
    dpr::checks::require_finite(background, "color");
    scene->scene.background = background;
  });
}

dpr_status dpr_scene_set_cull(dpr_scene* scene, const char* word) {
  return guarded([&] { deref(scene, "scene").scene.cull = dpr::parse_cull(&deref(word, "word"), "word"); });
}

dpr_status dpr_scene_set_lights(dpr_scene* scene, const dpr_lights* lights) {
  return guarded([&] { deref(scene, "scene").scene.lights = to_lights(lights); });
}

dpr_status dpr_scene_set_smoothing_word(dpr_scene* scene, const char* key, const char* word) {
  return guarded([&] { set_smoothing(scene, key, std::string(&deref(word, "word"))); });
}

dpr_status dpr_scene_set_smoothing_number(dpr_scene* scene, const char* key, double number) {
  return guarded([&] {
    if (!std::isfinite(number)) throw InvalidArgument("number", dpr::checks::text(number), "a finite number");
    set_smoothing(scene, key, number);
  });
}

dpr_status dpr_scene_set_gradients(dpr_scene* scene, const char* const* names, std::size_t count) {
  return guarded([&] { deref(scene, "scene").scene.gradients = to_request(names, count); });
}

void dpr_scene_destroy(dpr_scene* scene) { destroy(scene); }
