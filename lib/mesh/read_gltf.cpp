// The reader of glTF 2.0 and GLB: the triangles of a scene, moved to where its nodes place them, with normals,
// texture coordinates, colours, and the materials' base colours and textures.
//
// Read by this project's own strict JSON: a reader library would leave the checks of what the JSON names to this file.
#include <algorithm>
#include <array>
#include <glm/gtc/quaternion.hpp>
#include <set>

#include "base/checks.hpp"
#include "dpr/error.hpp"
#include "mesh/gltf_materials.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/weld.hpp"

namespace dpr {
namespace {

/// Extensions without which a file may not be read, and which are.
constexpr std::array<std::string_view, 4> k_extensions{"KHR_materials_unlit", "KHR_mesh_quantization",
                                                       "KHR_texture_transform", "KHR_materials_specular"};

/// Where a node lies in its parent.
glm::mat4 transform_of(const JsonNode& node) {
  glm::mat4 transform(1);
  if (const std::optional<JsonNode> matrix = node.find("matrix")) {  // column by column
    const std::vector<JsonNode> entries = matrix->elements(16);
    for (int i = 0; i < 16; ++i) transform[i / 4][i % 4] = entries[static_cast<std::size_t>(i)].number();
    return transform;
  }
  const glm::vec4 translation = gltf_numbers_or(node, "translation", 3, glm::vec4(0));
  const glm::vec4 rotation = gltf_numbers_or(node, "rotation", 4, {0, 0, 0, 1});
  const glm::vec4 scale = gltf_numbers_or(node, "scale", 3, glm::vec4(1));
  transform = glm::mat4(glm::mat3_cast(glm::quat(rotation.w, rotation.x, rotation.y, rotation.z)));
  for (int axis = 0; axis < 3; ++axis) transform[axis] *= scale[axis];
  transform[3] = glm::vec4(glm::vec3(translation), 1);
  return transform;
}

class GltfReader {
 public:
  GltfReader(const std::filesystem::path& file, std::string_view bytes, Notes& notes)
      : document_(file, bytes), notes_(notes) {}

  Mesh run() {
    const JsonNode version = document_.root().at("asset").at("version");
    if (!version.string().starts_with("2")) version.fail("\"" + version.string() + "\"", "2.0");
    if (const std::optional<JsonNode> required = document_.root().find("extensionsRequired")) {
      for (const JsonNode& extension : required->elements()) {
        if (std::ranges::find(k_extensions, extension.string()) == k_extensions.end())
          extension.fail("\"" + extension.string() + "\"", "a file that can be read without that extension");
      }
    }
    for (const char* const unread : {"animations", "skins"}) {
      if (const std::optional<JsonNode> found = document_.root().find(unread)) note(*found, "not read");
    }
    read_nodes();
    finish();
    return std::move(mesh_);
  }

 private:
  void note(const JsonNode& about, const std::string& text) { notes_.push_back(about.name() + ": " + text); }

  /// The nodes of the scene to show, or all that are nobody's children where the file names no scene.
  void read_nodes() {
    struct Place {
      JsonNode node;
      glm::mat4 parent;
    };
    std::vector<Place> places;
    const auto push = [&](const JsonNode& number, const glm::mat4& parent) {
      const JsonNode& node = document_.named("nodes", number);
      if (!visited_.insert(number.whole_number(k_largest_index)).second)
        number.fail("a node twice", "every node once");
      places.push_back({node, parent});
    };
    const std::optional<JsonNode> scenes = document_.root().find("scenes");
    if (!scenes) document_.root().fail("no \"scenes\"", "one");
    const std::vector<JsonNode> all = scenes->elements();
    if (all.empty()) scenes->fail("no scene", "one");
    const std::optional<JsonNode> shown = document_.root().find("scene");
    const JsonNode& scene = shown ? document_.named("scenes", *shown) : all.front();
    if (const std::optional<JsonNode> nodes = scene.find("nodes")) {
      for (const JsonNode& number : nodes->elements()) push(number, glm::mat4(1));
    }
    std::ranges::reverse(places);  // so that the first is taken first
    while (!places.empty()) {
      const Place place = places.back();
      places.pop_back();
      const glm::mat4 transform = place.parent * transform_of(place.node);
      if (const std::optional<JsonNode> number = place.node.find("mesh")) {
        for (const JsonNode& primitive : document_.named("meshes", *number).at("primitives").elements())
          read_primitive(primitive, transform);
      }
      if (const std::optional<JsonNode> children = place.node.find("children")) {
        const std::size_t first = places.size();
        for (const JsonNode& number : children->elements()) push(number, transform);
        std::reverse(places.begin() + static_cast<std::ptrdiff_t>(first), places.end());
      }
    }
  }

  /// The corners of a primitive's triangles, three each.
  std::vector<std::uint32_t> triangles(const JsonNode& primitive, std::size_t vertices, std::uint64_t mode) {
    std::vector<std::uint32_t> corners;
    const std::optional<JsonNode> indices = primitive.find("indices");
    if (indices) {
      corners = document_.indices(*indices);
      const auto wrong = std::ranges::find_if(corners, [&](std::uint32_t i) { return i >= vertices; });
      if (wrong != corners.end())
        indices->fail("the index " + std::to_string(*wrong), "indices below " + std::to_string(vertices));
    } else {
      for (std::uint32_t i = 0; i < vertices; ++i) corners.push_back(i);
    }
    if (mode == k_triangles) {
      if (corners.size() % 3 != 0)
        primitive.fail(std::to_string(corners.size()) + " corners", "three times the triangles");
      return corners;
    }
    std::vector<std::uint32_t> split;
    for (std::size_t i = 2; i < corners.size(); ++i) {
      // Every second triangle of a strip is turned over.
      const bool is_odd = mode == k_strip && i % 2 == 1;
      const std::size_t first = mode == k_fan ? 0 : i - 2;
      split.insert(split.end(), {corners[first], corners[is_odd ? i : i - 1], corners[is_odd ? i - 1 : i]});
    }
    return split;
  }

  void read_primitive(const JsonNode& primitive, const glm::mat4& transform) {
    const std::optional<JsonNode> mode_node = primitive.find("mode");
    const std::uint64_t mode = mode_node ? mode_node->whole_number(k_fan) : k_triangles;
    if (const std::optional<JsonNode> extensions = primitive.find("extensions");
        extensions && extensions->find("KHR_draco_mesh_compression"))
      primitive.fail("a mesh compressed by Draco", "one that is not compressed");
    if (primitive.find("targets")) note(primitive, "morph targets are not read");
    const JsonNode attributes = primitive.at("attributes");
    const std::optional<JsonNode> position = attributes.find("POSITION");
    if (mode < k_triangles || !position) {
      note(primitive, "left out: it has no " + std::string(position ? "triangles" : "positions"));
      return;
    }
    const std::vector<glm::vec4> positions = document_.vectors(*position);
    const std::vector<std::uint32_t> corners = triangles(primitive, positions.size(), mode);
    const auto attribute = [&](const std::string& name) -> std::vector<glm::vec4> {
      const std::optional<JsonNode> number = attributes.find(name);
      if (!number) return {};
      std::vector<glm::vec4> vectors = document_.vectors(*number);
      if (vectors.size() != positions.size())
        number->fail(std::to_string(vectors.size()) + " elements",
                     std::to_string(positions.size()) + ", one a vertex");
      return vectors;
    };
    const std::optional<JsonNode> material = primitive.find("material");
    const BaseColor color = material ? materials_.base_color(*material) : BaseColor();
    const std::vector<glm::vec4> texcoords = attribute(color.texcoords);
    if (color.texture != k_no_texture && texcoords.empty())
      note(primitive, "a texture without " + color.texcoords + ": its faces have their other colours alone");
    const std::vector<glm::vec4> colors = attribute("COLOR_0");
    const bool has_alpha =
        std::ranges::any_of(colors, [](const glm::vec4& of_vertex) { return of_vertex.a < 1; });
    if (has_alpha && color.threshold && *color.threshold > 0) note(primitive, "COLOR_0: alpha is not masked");
    append(corners, positions, attribute("NORMAL"), texcoords, colors, color, transform);
  }

  /// Appends triangles with the vertices that they use.
  void append(const std::vector<std::uint32_t>& corners, const std::vector<glm::vec4>& positions,
              const std::vector<glm::vec4>& normals, const std::vector<glm::vec4>& texcoords,
              const std::vector<glm::vec4>& colors, const BaseColor& color, const glm::mat4& transform) {
    const glm::mat3 linear(transform);
    // A mirror turns triangles over; normals follow the plane, not the vector: by the cofactors.
    const bool is_mirrored = glm::determinant(linear) < 0;
    const glm::mat3 cofactors(glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                              glm::cross(linear[0], linear[1]));
    std::vector<std::uint32_t> numbers(positions.size(), k_no_texture);  // of vertices in the mesh
    const auto vertex = [&](std::uint32_t v) {
      if (numbers[v] != k_no_texture) return numbers[v];
      numbers[v] = static_cast<std::uint32_t>(mesh_.positions.size());
      mesh_.positions.emplace_back(transform * glm::vec4(glm::vec3(positions[v]), 1));
      mesh_.vertex_colors.push_back(colors.empty() ? glm::vec3(1) : glm::vec3(colors[v]));
      mesh_.vertex_opacities.push_back(
          colors.empty() || color.threshold ? 1.0F : glm::clamp(colors[v].a, 0.0F, 1.0F));
      mesh_.normals.push_back(normals.empty()
                                  ? glm::vec3(0)
                                  : (is_mirrored ? -1.0F : 1.0F) * (cofactors * glm::vec3(normals[v])));
      const glm::vec2 uv = texcoords.empty() ? glm::vec2(0) : color.transform(glm::vec2(texcoords[v]));
      mesh_.texcoords.emplace_back(uv.x, 1 - uv.y);
      return numbers[v];
    };
    for (std::size_t i = 0; i < corners.size(); i += 3) {
      glm::uvec3 face(0);
      for (int c = 0; c < 3; ++c) face[c] = vertex(corners[i + static_cast<std::size_t>(c)]);
      if (is_mirrored) std::swap(face.y, face.z);
      mesh_.faces.push_back(face);
      mesh_.face_colors.push_back(color.factor);
      mesh_.face_textures.push_back(texcoords.empty() ? k_no_texture : color.texture);
      mesh_.face_opacities.push_back(color.opacity(mesh_.face_textures.back() != k_no_texture));
    }
    lacks_normals_ = lacks_normals_ || normals.empty();
    lacks_texcoords_ = lacks_texcoords_ || texcoords.empty();
    has_colors_ = has_colors_ || !colors.empty();
  }

  /// Of the values of vertices, all 1 unless `of_vertices`, and of faces: leaves one list, or none where all are 1.
  template <class Value>
  void join(std::vector<Value>& vertices, std::vector<Value>& faces, bool of_vertices) const {
    const bool of_faces = std::ranges::any_of(faces, [](const Value& value) { return value != Value(1); });
    if (of_vertices && of_faces) {  // every primitive has vertices of its own
      std::vector<bool> is_done(vertices.size());
      for (std::size_t f = 0; f < faces.size(); ++f) {
        for (int c = 0; c < 3; ++c) {
          const std::uint32_t v = mesh_.faces[f][c];
          if (!is_done[v]) vertices[v] *= faces[f];
          is_done[v] = true;
        }
      }
    }
    if (of_vertices || !of_faces) faces.clear();
    if (!of_vertices) vertices.clear();
  }

  /// Leaves out what says nothing, and makes the form that Mesh asks for.
  void finish() {
    join(mesh_.vertex_colors, mesh_.face_colors, has_colors_);
    const bool has_opacities =
        std::ranges::any_of(mesh_.vertex_opacities, [](float opacity) { return opacity < 1; });
    join(mesh_.vertex_opacities, mesh_.face_opacities, has_opacities);
    const auto is_untextured = [](std::uint32_t texture) { return texture == k_no_texture; };
    if (std::ranges::all_of(mesh_.face_textures, is_untextured)) {
      mesh_.textures.clear();
      mesh_.face_textures.clear();
      if (lacks_texcoords_) mesh_.texcoords.clear();
    } else if (std::ranges::all_of(mesh_.face_textures, [](std::uint32_t texture) { return texture == 0; })) {
      mesh_.face_textures.clear();
    }
    if (lacks_normals_) mesh_.normals.clear();
    if (!mesh_.texcoords.empty()) mesh_.face_texcoords = mesh_.faces;
    if (!mesh_.normals.empty()) mesh_.face_normals = mesh_.faces;
    if (!has_colors_ && !has_opacities) weld(mesh_);
  }

  static constexpr std::uint64_t k_triangles = 4, k_strip = 5, k_fan = 6;

  GltfDocument document_;
  Notes& notes_;
  Mesh mesh_;
  GltfMaterials materials_{document_, notes_, mesh_.textures};
  std::set<std::uint64_t> visited_;  // nodes
  bool lacks_normals_ = false, lacks_texcoords_ = false, has_colors_ = false;
};

}  // namespace

Mesh read_gltf(const std::filesystem::path& file, std::string_view bytes, Notes& notes) {
  return GltfReader(file, bytes, notes).run();
}

}  // namespace dpr
