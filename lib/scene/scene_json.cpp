// The scene format: strict reading, so that a misspelt key is an error and not a default.
#include "scene/scene_json.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <string>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "dpr/scene.hpp"
#include "image/texture_words.hpp"
#include "scene/gradient_table.hpp"
#include "scene/light_table.hpp"
#include "scene/scene_parts.hpp"
#include "scene/see_through.hpp"
#include "scene/take_json.hpp"
#include "smoothing/choice_names.hpp"
#include "smoothing/option_fields.hpp"

namespace dpr {
namespace {

void take_vec3(const JsonNode& node, std::string_view key, glm::vec3& value) {
  take(node, key, value, [](const JsonNode& n) { return n.vec3(); });
}

void take_size(const JsonNode& node, std::string_view key, int& value) {
  take(node, key, value, [](const JsonNode& n) { return n.image_side(); });
}

std::vector<glm::vec3> vec3_list(const JsonNode& node) {
  std::vector<glm::vec3> list;
  for (const JsonNode& element : node.elements()) list.push_back(element.vec3());
  return list;
}

std::vector<glm::vec2> vec2_list(const JsonNode& node) {
  std::vector<glm::vec2> list;
  for (const JsonNode& element : node.elements()) {
    const std::vector<JsonNode> numbers = element.elements(2);
    list.emplace_back(numbers[0].number(), numbers[1].number());
  }
  return list;
}

std::vector<glm::uvec3> parse_faces(const JsonNode& node) {
  constexpr std::uint64_t k_most = std::numeric_limits<std::uint32_t>::max();
  std::vector<glm::uvec3> faces;
  for (const JsonNode& element : node.elements()) {
    const std::vector<JsonNode> corners = element.elements(3);
    glm::uvec3& face = faces.emplace_back();
    for (int i = 0; i < 3; ++i) {
      face[i] = static_cast<std::uint32_t>(corners[static_cast<std::size_t>(i)].whole_number(k_most));
    }
  }
  return faces;
}

// Colours beside a file take the place of the file's. A single colour stands for all.
void take_colors(const JsonNode& node, Mesh& mesh) {
  const auto of_vertices = node.find("vertex_colors"), of_faces = node.find("face_colors");
  if (of_vertices && of_faces) node.fail("vertex_colors and face_colors", "one of the two");
  if (!of_vertices && !of_faces) return;
  mesh.vertex_colors.clear();
  mesh.face_colors.clear();
  std::vector<glm::vec3>& colors = of_vertices ? mesh.vertex_colors : mesh.face_colors;
  const std::size_t count = of_vertices ? mesh.positions.size() : mesh.faces.size();
  const JsonNode& given = of_vertices ? *of_vertices : *of_faces;
  colors = vec3_list(given);
  if (colors.size() == 1) colors.assign(count, glm::vec3(colors[0]));
  if (colors.size() != count) {
    given.fail(std::to_string(colors.size()) + " colours", "one, or " + std::to_string(count));
  }
}

std::vector<float> numbers_of(const JsonNode& node) {
  std::vector<float> list;
  for (const JsonNode& element : node.elements()) list.push_back(element.number());
  return list;
}

// A texture beside a file takes the place of all of the file's.
void take_texture(const JsonNode& node, const std::filesystem::path& folder, Mesh& mesh) {
  if (node.find("texcoords").has_value() != node.find("face_texcoords").has_value())
    node.fail("one of texcoords and face_texcoords", "both or none");
  take(node, "texcoords", mesh.texcoords, vec2_list);
  take(node, "face_texcoords", mesh.face_texcoords, parse_faces);
  const auto texture = node.find("texture");
  if (!texture) return;
  texture->require_keys({"file", "wrap", "filter"});
  if (mesh.face_texcoords.empty())
    texture->fail("a texture on a mesh without texture coordinates",
                  "texcoords and face_texcoords, or a file with some");
  mesh.textures = {read_texture(texture->at("file").file_in(folder))};
  mesh.face_textures.clear();
  take_word(*texture, "wrap", mesh.textures[0].wrap, k_wrap_names);
  take_word(*texture, "filter", mesh.textures[0].filter, k_filter_names);
}

/// Normals beside a file take the place of the file's; two empty lists are none.
void take_normals(const JsonNode& node, Mesh& mesh) {
  if (node.find("normals").has_value() != node.find("face_normals").has_value())
    node.fail("one of normals and face_normals", "both or none");
  take(node, "normals", mesh.normals, vec3_list);
  take(node, "face_normals", mesh.face_normals, parse_faces);
}

/// A material beside a file takes the place of all of the file's.
void take_material(const JsonNode& node, Mesh& mesh) {
  const auto given = node.find("material");
  if (!given) return;
  given->require_keys({"specular", "shininess"});
  Material material;
  take_vec3(*given, "specular", material.specular);
  take(*given, "shininess", material.shininess, [](const JsonNode& n) { return n.number(); });
  mesh.materials = {material};
  mesh.face_materials.clear();
}

/// Another place of a mesh that is there.
Instance parse_place(const JsonNode& node) {
  constexpr std::uint64_t k_most = std::numeric_limits<std::uint32_t>::max();
  if (node.find("file") || node.find("positions"))
    node.fail("a mesh of its own and instance_of", "one of the two");
  node.require_keys({"instance_of", "transform"});
  Instance instance;
  instance.instance_of = node.at("instance_of").whole_number(k_most);
  take(node, "transform", instance.transform, [](const JsonNode& n) { return n.mat4(); });
  return instance;
}

Instance parse_instance(const JsonNode& node, const std::filesystem::path& folder, Notes& notes) {
  if (node.find("instance_of")) return parse_place(node);
  node.require_keys({"file", "positions", "faces", "transform", "vertex_colors", "face_colors", "texcoords",
                     "face_texcoords", "texture", "normals", "face_normals", "material", "instance_of",
                     "vertex_opacities", "face_opacities"});
  Instance instance;
  const auto file = node.find("file");
  if (file && (node.find("positions") || node.find("faces"))) {
    node.fail("file beside positions or faces", "a file, or positions and faces");
  }
  if (file) {
    instance.mesh = read_mesh(file->file_in(folder), notes);
  } else if (node.find("positions") || node.find("faces")) {
    instance.mesh.positions = vec3_list(node.at("positions"));
    instance.mesh.faces = parse_faces(node.at("faces"));
  } else {
    node.fail("no mesh", "a file, or positions and faces");
  }
  take_colors(node, instance.mesh);
  take_texture(node, folder, instance.mesh);
  take_normals(node, instance.mesh);
  take_material(node, instance.mesh);
  take(node, "vertex_opacities", instance.mesh.vertex_opacities, numbers_of);
  take(node, "face_opacities", instance.mesh.face_opacities, numbers_of);
  take(node, "transform", instance.transform, [](const JsonNode& n) { return n.mat4(); });
  return instance;
}

void read_member(const JsonNode& node, float& value) { value = node.number(); }

void read_member(const JsonNode& node, glm::vec3& value) { value = node.vec3(); }

template <typename Light>
Light parse_light(const JsonNode& node) {
  Light light;
  std::vector<std::string_view> keys;
  LightKind<Light>::for_each_member([&](std::string_view key, auto...) { keys.push_back(key); });
  node.require_keys(keys);
  LightKind<Light>::for_each_member([&](std::string_view key, auto member, auto...) {
    if (const auto value = node.find(key)) read_member(*value, light.*member);
  });
  return light;
}

Lights parse_lights(const JsonNode& node) {
  std::vector<std::string_view> keys{"ambient", "harmonics", "shininess", "shading"};
  for_each_light_kind([&](auto kind) { keys.push_back(kind.key); });
  node.require_keys(keys);
  Lights lights;
  take_vec3(node, "ambient", lights.ambient);
  take_number(node, "shininess", lights.shininess);
  take(node, "shading", lights.shading,
       [](const JsonNode& n) { return parse_shading(n.string(), n.name()); });
  if (const auto list = node.find("harmonics")) {
    for (const JsonNode& element : list->elements(k_harmonics)) lights.harmonics.push_back(element.vec3());
  }
  for_each_light_kind([&](auto kind) {
    const auto list = node.find(kind.key);
    if (!list) return;
    for (const JsonNode& element : list->elements())
      (lights.*kind.lights).push_back(parse_light<typename decltype(kind)::Light>(element));
  });
  return lights;
}

GradientRequest parse_gradients(const JsonNode& node) {
  GradientRequest request = no_gradients();
  for (const JsonNode& element : node.elements()) {
    bool& wanted = request.*parse_gradient(element.string(), element.name());
    if (wanted) element.fail("\"" + element.string() + "\" twice", "it once");
    wanted = true;
  }
  return request;
}

template <SmoothingChoice Choice>
void read_option(const JsonNode& node, std::optional<Choice>& option) {
  option = parse_choice<Choice>(node.string(), node.name());
}

void read_option(const JsonNode& node, std::optional<std::string>& preset) {
  require_preset(node.string(), node.name());
  preset = node.string();
}

void read_option(const JsonNode& node, std::optional<float>& option) { option = node.number(); }

template <std::unsigned_integral Number>
void read_option(const JsonNode& node, std::optional<Number>& option) {
  option = static_cast<Number>(node.whole_number(std::numeric_limits<Number>::max()));
}

/// All but the smoothing.
Scene parse_scene(const JsonNode& node, const std::filesystem::path& folder, Notes& notes) {
  node.require_keys({"width", "height", "camera", "background", "meshes", "lights", "smoothing",
                     "perspective_correct", "cull", "gradients"});
  Scene scene;
  take_size(node, "width", scene.width);
  take_size(node, "height", scene.height);
  take(node, "camera", scene.camera, parse_camera);
  take_vec3(node, "background", scene.background);
  for (const JsonNode& mesh : node.at("meshes").elements())
    scene.meshes.push_back(parse_instance(mesh, folder, notes));
  take(node, "lights", scene.lights, parse_lights);
  take(node, "perspective_correct", scene.perspective_correct, [](const JsonNode& n) { return n.boolean(); });
  take(node, "cull", scene.cull, [](const JsonNode& n) { return parse_cull(n.string(), n.name()); });
  take(node, "gradients", scene.gradients, parse_gradients);
  return scene;
}

}  // namespace

namespace {

constexpr std::string_view k_of_smoothing = " (smoothing)";

bool gives(const SmoothingOptions& options, std::string_view key) {
  bool found = false;
  for_each_option([&](std::string_view name, auto, auto member) {
    found = found || (name == key && (options.*member).has_value());
  });
  return found;
}

/// "camera.znear" for the argument "znear (camera)", "width" for "width (scene)".
std::string key_of(const std::string& argument) {
  const std::size_t bracket = argument.rfind(" (");
  if (bracket == std::string::npos) return argument;
  const std::string field = argument.substr(0, bracket);
  const std::string parent = argument.substr(bracket + 2, argument.size() - bracket - 3);
  return parent == "scene" ? field : parent + "." + field;
}

}  // namespace

SmoothingOptions parse_smoothing(const JsonNode& node) {
  node.require_keys(option_keys());
  SmoothingOptions options;
  for_each_option([&](std::string_view key, auto, auto member) {
    if (const auto value = node.find(key)) read_option(*value, options.*member);
  });
  return options;
}

bool have_same_shape(glm::ivec2 a, glm::ivec2 b) {
  constexpr std::int64_t k_hundred = 100;
  const std::int64_t across = std::int64_t{a.x} * b.y, down = std::int64_t{b.x} * a.y;
  const std::int64_t difference = std::abs(across - down);
  return difference <= std::max(a.x, b.x) && difference * k_hundred <= std::max(across, down);
}

void resize(Scene& scene, glm::ivec2 size) {
  if (auto& k = scene.camera.intrinsics) {
    const glm::vec2 factor = glm::vec2(size) / glm::vec2(scene.width, scene.height);
    *k = {k->fx * factor.x, k->fy * factor.y, k->cx * factor.x, k->cy * factor.y};
  }
  scene.width = size.x;
  scene.height = size.y;
}

namespace {

/// Intrinsics of a scene without a size are those of the picture.
void set_size(const JsonNode& node, const SceneOverrides& overrides, Scene& scene) {
  const auto& picture = overrides.picture;
  if (picture && !node.find("width") && !node.find("height")) {
    scene.width = picture->x;
    scene.height = picture->y;
  }
  if (overrides.size) resize(scene, *overrides.size);
  const glm::ivec2 size(scene.width, scene.height);
  if (picture && picture->x < size.x && have_same_shape(*picture, size)) resize(scene, *picture);
}

}  // namespace

void with_keys_of(const std::filesystem::path& file, const SmoothingOptions& smoothing,
                  const SmoothingOptions& overrides, const std::function<void()>& check) {
  try {
    check();
  } catch (const InvalidArgument& error) {
    const std::string& argument = error.argument();
    if (argument.ends_with(k_of_smoothing)) {
      const std::string_view key(argument.data(), argument.size() - k_of_smoothing.size());
      if (gives(overrides, key) || !(gives(smoothing, key) || says_nothing(overrides))) throw;
    }
    throw InvalidArgument(checks::in(key_of(argument), file.string()), error.got(), error.expected());
  }
}

Scene parse_scene(const std::filesystem::path& file, std::string_view text, Notes& notes,
                  const SceneOverrides& overrides) {
  const nlohmann::json document = parse_json(file, text);
  const JsonNode node(document, file);
  Scene scene = parse_scene(node, file.parent_path(), notes);
  set_size(node, overrides, scene);
  SmoothingOptions smoothing;
  take(node, "smoothing", smoothing, parse_smoothing);
  const std::string note = noise_note(smoothing, overrides.smoothing);
  if (!note.empty()) notes.push_back(note);
  with_keys_of(file, smoothing, overrides.smoothing, [&] {
    SmoothingOptions all = overlay(smoothing, overrides.smoothing);
    scene.smoothing = resolve_smoothing(all, scene.width, scene.height);
    validate(scene);
  });
  return scene;
}

Scene read_scene(const std::filesystem::path& file, Notes& notes) {
  return parse_scene(file, read_file(file), notes);
}

Scene read_scene(const std::filesystem::path& file) {
  Notes ignored;
  return read_scene(file, ignored);
}

}  // namespace dpr
