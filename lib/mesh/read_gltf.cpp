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
#include "image/codec.hpp"
#include "mesh/gltf_document.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/weld.hpp"

namespace dpr {
namespace {

constexpr std::uint64_t k_largest_index = std::numeric_limits<std::uint32_t>::max();

/// Extensions without which a file may not be read, and which are.
constexpr std::array<std::string_view, 4> k_extensions{"KHR_materials_unlit", "KHR_mesh_quantization",
                                                       "KHR_texture_transform", "KHR_materials_specular"};

glm::vec4 numbers(const JsonNode& list, std::size_t count) {
  glm::vec4 numbers(0);
  int i = 0;
  for (const JsonNode& number : list.elements(count)) numbers[i++] = number.number();
  return numbers;
}

glm::vec4 numbers_or(const JsonNode& node, std::string_view key, std::size_t count,
                     const glm::vec4& otherwise) {
  const std::optional<JsonNode> list = node.find(key);
  return list ? numbers(*list, count) : otherwise;
}

/// Where a node lies in its parent.
glm::mat4 transform_of(const JsonNode& node) {
  glm::mat4 transform(1);
  if (const std::optional<JsonNode> matrix = node.find("matrix")) {  // column by column
    const std::vector<JsonNode> entries = matrix->elements(16);
    for (int i = 0; i < 16; ++i) transform[i / 4][i % 4] = entries[static_cast<std::size_t>(i)].number();
    return transform;
  }
  const glm::vec4 translation = numbers_or(node, "translation", 3, glm::vec4(0));
  const glm::vec4 rotation = numbers_or(node, "rotation", 4, {0, 0, 0, 1});
  const glm::vec4 scale = numbers_or(node, "scale", 3, glm::vec4(1));
  transform = glm::mat4(glm::mat3_cast(glm::quat(rotation.w, rotation.x, rotation.y, rotation.z)));
  for (int axis = 0; axis < 3; ++axis) transform[axis] *= scale[axis];
  transform[3] = glm::vec4(glm::vec3(translation), 1);
  return transform;
}

/// Coordinates of a texture that is moved within its coordinates (KHR_texture_transform).
struct TextureTransform {
  glm::vec2 offset{0}, scale{1};
  float rotation = 0;  ///< radians

  /// Coordinates with v down.
  glm::vec2 operator()(const glm::vec2& uv) const {
    const glm::vec2 scaled = uv * scale;
    const float c = std::cos(rotation), s = std::sin(rotation);
    return offset + glm::vec2(c * scaled.x + s * scaled.y, c * scaled.y - s * scaled.x);
  }
};

/// What a material says of its colour.
struct BaseColor {
  glm::vec3 factor{1};
  std::uint32_t texture = k_no_texture;  ///< in the mesh
  std::string texcoords = "TEXCOORD_0";  ///< the attribute
  TextureTransform transform;
};

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
    const BaseColor color = material ? base_color(*material) : BaseColor();
    const std::vector<glm::vec4> texcoords = attribute(color.texcoords);
    if (color.texture != k_no_texture && texcoords.empty())
      note(primitive, "a texture without " + color.texcoords + ": its faces have their other colours alone");
    append(corners, positions, attribute("NORMAL"), texcoords, attribute("COLOR_0"), color, transform);
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
    }
    lacks_normals_ = lacks_normals_ || normals.empty();
    lacks_texcoords_ = lacks_texcoords_ || texcoords.empty();
    has_colors_ = has_colors_ || !colors.empty();
  }

  /// Leaves out what says nothing, and makes the form that Mesh asks for.
  void finish() {
    const auto is_white = [](const glm::vec3& color) { return color == glm::vec3(1); };
    const bool has_factors = !std::ranges::all_of(mesh_.face_colors, is_white);
    if (has_colors_ && has_factors) {  // every primitive has vertices of its own
      std::vector<bool> is_done(mesh_.positions.size());
      for (std::size_t f = 0; f < mesh_.faces.size(); ++f) {
        for (int c = 0; c < 3; ++c) {
          const std::uint32_t v = mesh_.faces[f][c];
          if (!is_done[v]) mesh_.vertex_colors[v] *= mesh_.face_colors[f];
          is_done[v] = true;
        }
      }
    }
    if (has_colors_ || !has_factors) mesh_.face_colors.clear();
    if (!has_colors_) mesh_.vertex_colors.clear();
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
    if (!has_colors_) weld(mesh_);
  }

  const BaseColor& base_color(const JsonNode& number) {
    const JsonNode& material = document_.named("materials", number);
    const auto [place, is_new] = colors_.try_emplace(number.whole_number(k_largest_index));
    BaseColor& color = place->second;
    if (!is_new) return color;
    std::string unread;
    const auto look_for = [&](const JsonNode& node, std::initializer_list<std::string_view> keys) {
      for (const std::string_view key : keys) {
        if (node.find(key)) unread += (unread.empty() ? "" : ", ") + std::string(key);
      }
    };
    look_for(material, {"alphaMode", "emissiveTexture", "normalTexture", "occlusionTexture"});
    if (const std::optional<JsonNode> surface = material.find("pbrMetallicRoughness")) {
      look_for(*surface, {"metallicRoughnessTexture"});
      color.factor = glm::vec3(numbers_or(*surface, "baseColorFactor", 4, glm::vec4(1)));
      if (const std::optional<JsonNode> texture = surface->find("baseColorTexture"))
        read_texture_of(*texture, color);
    }
    if (!unread.empty()) note(material, "not read: " + unread);
    return color;
  }

  void read_texture_of(const JsonNode& reference, BaseColor& color) {
    std::uint64_t set = 0;
    if (const std::optional<JsonNode> texcoord = reference.find("texCoord"))
      set = texcoord->whole_number(k_largest_index);
    if (const std::optional<JsonNode> extensions = reference.find("extensions")) {
      if (const std::optional<JsonNode> moved = extensions->find("KHR_texture_transform")) {
        color.transform.offset = glm::vec2(numbers_or(*moved, "offset", 2, glm::vec4(0)));
        color.transform.scale = glm::vec2(numbers_or(*moved, "scale", 2, glm::vec4(1)));
        if (const std::optional<JsonNode> rotation = moved->find("rotation"))
          color.transform.rotation = rotation->number();
        if (const std::optional<JsonNode> texcoord = moved->find("texCoord"))
          set = texcoord->whole_number(k_largest_index);
      }
    }
    color.texcoords = "TEXCOORD_" + std::to_string(set);
    const JsonNode index = reference.at("index");
    const JsonNode& texture = document_.named("textures", index);
    const auto [place, is_new] = textures_.try_emplace(index.whole_number(k_largest_index), k_no_texture);
    if (is_new) {
      std::optional<Texture> read = image_of(texture);
      if (read) {
        if (const std::optional<JsonNode> sampler = texture.find("sampler"))
          apply_sampler(document_.named("samplers", *sampler), *read);
        place->second = static_cast<std::uint32_t>(mesh_.textures.size());
        mesh_.textures.push_back(std::move(*read));
      }
    }
    color.texture = place->second;
  }

  std::optional<Texture> image_of(const JsonNode& texture) {
    const std::optional<JsonNode> source = texture.find("source");
    if (!source) {
      note(texture, "no image that is read: its faces have their other colours alone");
      return {};
    }
    const JsonNode& image = document_.named("images", *source);
    if (const std::optional<JsonNode> view = image.find("bufferView"))
      return decode_texture(image.name(), document_.view(*view));
    const JsonNode uri = image.at("uri");
    std::string data;
    if (GltfDocument::decode(uri, data)) return decode_texture(image.name(), data);
    const std::filesystem::path path = document_.beside(uri);
    std::error_code error;
    if (std::filesystem::is_regular_file(path, error)) return read_texture(path);
    note(uri, "the texture \"" + uri.string() + "\"" + what_is_wrong(path) +
                  ": its faces have their other colours alone");
    return {};
  }

  void apply_sampler(const JsonNode& sampler, Texture& texture) {
    const auto value = [&](std::string_view key, std::uint64_t otherwise) {
      const std::optional<JsonNode> found = sampler.find(key);
      return found ? found->whole_number(k_largest_index) : otherwise;
    };
    constexpr std::uint64_t k_repeat = 10497, k_clamp = 33071, k_mirror = 33648, k_nearest = 9728;
    constexpr std::uint64_t k_first_of_mips = 9984, k_last_of_mips = 9987;
    const std::uint64_t wrap = value("wrapS", k_repeat);
    if (wrap == k_clamp) texture.wrap = Wrap::clamp;
    if (wrap == k_mirror) texture.wrap = Wrap::mirror;
    if (value("wrapT", k_repeat) != wrap) note(sampler, "\"wrapT\" is not read: both ways as \"wrapS\"");
    const std::uint64_t smaller = value("minFilter", 0);
    if (smaller >= k_first_of_mips && smaller <= k_last_of_mips) {
      texture.filter = Filter::trilinear;
    } else if (value("magFilter", 0) == k_nearest) {
      texture.filter = Filter::nearest;
    }
  }

  static constexpr std::uint64_t k_triangles = 4, k_strip = 5, k_fan = 6;

  GltfDocument document_;
  Notes& notes_;
  Mesh mesh_;
  std::set<std::uint64_t> visited_;                  // nodes
  std::map<std::uint64_t, BaseColor> colors_;        // by material
  std::map<std::uint64_t, std::uint32_t> textures_;  // of the mesh, by texture
  bool lacks_normals_ = false, lacks_texcoords_ = false, has_colors_ = false;
};

}  // namespace

Mesh read_gltf(const std::filesystem::path& file, std::string_view bytes, Notes& notes) {
  return GltfReader(file, bytes, notes).run();
}

}  // namespace dpr
