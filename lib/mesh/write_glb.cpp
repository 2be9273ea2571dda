// The writer of GLB: one mesh, whose faces are a primitive for each texture.
#include <array>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "dpr/error.hpp"
#include "image/codec.hpp"
#include "mesh/bounding_box.hpp"
#include "mesh/face_texture.hpp"
#include "mesh/little_endian.hpp"
#include "mesh/mesh_reader.hpp"

namespace dpr {
namespace {

using Json = nlohmann::ordered_json;

constexpr int k_float = 5126, k_unsigned_int = 5125;
constexpr std::size_t k_alignment = 4;

/// What tells a vertex of the file from another: numbers in the mesh's arrays.
struct Corner {
  std::uint32_t position, texcoord, normal, color;
  auto operator<=>(const Corner&) const = default;
};

class GlbWriter {
 public:
  GlbWriter(const std::filesystem::path& file, const Mesh& mesh) : file_(file), mesh_(mesh) {}

  std::string run() {
    Json attributes = write_vertices();
    Json primitives = Json::array();
    for (const auto& [texture, corners] : indices_) {
      Json primitive{{"attributes", attributes}, {"indices", write_indices(corners)}};
      if (texture != k_no_texture) primitive["material"] = write_material(texture);
      primitives.push_back(std::move(primitive));
    }
    json_["meshes"] = Json::array({{{"primitives", std::move(primitives)}}});
    json_["buffers"] = Json::array({{{"byteLength", bytes_.size()}}});
    return container();
  }

 private:
  /// Numbers the vertices and writes what they have; the attributes of every primitive.
  Json write_vertices() {
    std::map<Corner, std::uint32_t> numbers;
    std::vector<Corner> vertices;
    for (std::size_t f = 0; f < mesh_.faces.size(); ++f) {
      const std::uint32_t texture = texture_of(mesh_, f);
      for (int c = 0; c < 3; ++c) {
        const Corner corner{mesh_.faces[f][c], mesh_.face_texcoords.empty() ? 0 : mesh_.face_texcoords[f][c],
                            mesh_.face_normals.empty() ? 0 : mesh_.face_normals[f][c],
                            mesh_.face_colors.empty() ? 0 : static_cast<std::uint32_t>(f)};
        const auto [place, is_new] = numbers.try_emplace(corner, static_cast<std::uint32_t>(vertices.size()));
        if (is_new) vertices.push_back(corner);
        indices_[texture].push_back(place->second);
      }
    }
    Json attributes{
        {"POSITION", write(vertices, [&](const Corner& v) { return mesh_.positions[v.position]; })}};
    const Bounds box = bounding_box(mesh_.positions);
    Json& positions = json_["accessors"].back();
    positions["min"] = {box.low.x, box.low.y, box.low.z};
    positions["max"] = {box.high.x, box.high.y, box.high.z};
    if (!mesh_.face_normals.empty()) {
      attributes["NORMAL"] = write(vertices, [&](const Corner& v) {
        const glm::vec3& normal = mesh_.normals[v.normal];
        return normal == glm::vec3(0) ? glm::vec3(0, 0, 1) : glm::normalize(normal);
      });
    }
    if (!mesh_.face_texcoords.empty()) {
      attributes["TEXCOORD_0"] = write(vertices, [&](const Corner& v) {
        const glm::vec2 uv = mesh_.texcoords[v.texcoord];
        return glm::vec2(uv.x, 1 - uv.y);  // v is down there
      });
    }
    if (!mesh_.face_colors.empty())
      attributes["COLOR_0"] = write(vertices, [&](const Corner& v) { return mesh_.face_colors[v.color]; });
    if (!mesh_.vertex_colors.empty())
      attributes["COLOR_0"] =
          write(vertices, [&](const Corner& v) { return mesh_.vertex_colors[v.position]; });
    return attributes;
  }

  /// Writes a vector of every vertex; the number of its accessor.
  template <typename Value>
  std::size_t write(const std::vector<Corner>& vertices, const Value& value) {
    using Vector = decltype(value(vertices.front()));
    const std::size_t begin = bytes_.size();
    for (const Corner& vertex : vertices) {
      const Vector vector = value(vertex);
      for (int i = 0; i < Vector::length(); ++i) append_little_endian(bytes_, vector[i]);
    }
    return accessor(view(begin), vertices.size(), k_float, "VEC" + std::to_string(Vector::length()));
  }

  std::size_t write_indices(const std::vector<std::uint32_t>& corners) {
    const std::size_t begin = bytes_.size();
    for (const std::uint32_t corner : corners) append_little_endian(bytes_, corner);
    return accessor(view(begin), corners.size(), k_unsigned_int, "SCALAR");
  }

  std::size_t write_material(std::uint32_t number) {
    const Texture& texture = mesh_.textures[number];
    const std::size_t begin = bytes_.size();
    bytes_ += encode_texture(file_, texture);
    const std::size_t image = append("images", {{"bufferView", view(begin)}, {"mimeType", "image/png"}});
    constexpr std::array k_wraps{10497, 33648, 33071};
    constexpr std::array<std::array<int, 2>, 3> k_filters{{{9728, 9728}, {9729, 9729}, {9729, 9987}}};
    const int wrap = k_wraps.at(static_cast<std::size_t>(texture.wrap));
    const std::array<int, 2>& filters = k_filters.at(static_cast<std::size_t>(texture.filter));
    const std::size_t sampler = append(
        "samplers", {{"magFilter", filters[0]}, {"minFilter", filters[1]}, {"wrapS", wrap}, {"wrapT", wrap}});
    const std::size_t index = append("textures", {{"sampler", sampler}, {"source", image}});
    return append("materials", {{"pbrMetallicRoughness",
                                 {{"baseColorTexture", {{"index", index}}}, {"metallicFactor", 0}}},
                                {"doubleSided", true}});
  }

  std::size_t append(const char* list, Json entry) {
    json_[list].push_back(std::move(entry));
    return json_[list].size() - 1;
  }

  /// The number of a view of the bytes from `begin` on; the next one's begin is aligned.
  std::size_t view(std::size_t begin) {
    const std::size_t length = bytes_.size() - begin;
    bytes_.resize((bytes_.size() + k_alignment - 1) / k_alignment * k_alignment, '\0');
    return append("bufferViews", {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", length}});
  }

  std::size_t accessor(std::size_t view, std::size_t count, int component, const std::string& type) {
    return append("accessors",
                  {{"bufferView", view}, {"componentType", component}, {"count", count}, {"type", type}});
  }

  std::string container() const {
    std::string text = json_.dump();
    text.resize((text.size() + k_alignment - 1) / k_alignment * k_alignment, ' ');
    constexpr std::size_t k_headers = 12 + 2 * 8;
    const std::size_t size = k_headers + text.size() + bytes_.size();
    if (size > std::numeric_limits<std::uint32_t>::max())
      throw IoError(file_, "GLB has no room for more than 4 GiB");
    std::string file = "glTF";
    append_little_endian(file, 2U);
    append_little_endian(file, static_cast<std::uint32_t>(size));
    append_little_endian(file, static_cast<std::uint32_t>(text.size()));
    file += "JSON" + text;
    append_little_endian(file, static_cast<std::uint32_t>(bytes_.size()));
    file += std::string("BIN\0", 4) + bytes_;
    return file;
  }

  const std::filesystem::path& file_;
  const Mesh& mesh_;
  std::map<std::uint32_t, std::vector<std::uint32_t>> indices_;  ///< by texture
  Json json_{{"asset", {{"version", "2.0"}, {"generator", "dpr"}}},
             {"scene", 0},
             {"scenes", Json::array({{{"nodes", {0}}}})},
             {"nodes", Json::array({{{"mesh", 0}}})}};
  std::string bytes_;
};

}  // namespace

std::string glb_bytes(const std::filesystem::path& file, const Mesh& mesh) {
  return GlbWriter(file, mesh).run();
}

}  // namespace dpr
