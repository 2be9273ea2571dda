// The data of a model as JSON, its long arrays in base64 of little-endian numbers.
#include "cli/page_model.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "cli/json.hpp"
#include "cli/page.hpp"
#include "image/codec.hpp"
#include "image/srgb.hpp"
#include "mesh/face_texture.hpp"

namespace dpr::cli {
namespace {

std::string base64(std::string_view bytes) {
  constexpr std::string_view k_digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < count; ++k)
      bits |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[i + k])) << (16 - 8 * k);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? k_digits[bits >> (18 - 6 * k) & 63U] : '=';
  }
  return text;
}

void append_little_endian(std::string& bytes, std::uint32_t value) {
  for (unsigned shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(value >> shift & 0xffU);
}

std::string positions_text(const std::vector<glm::vec3>& positions) {
  std::string bytes;
  for (const glm::vec3& p : positions)
    for (int k = 0; k < 3; ++k) append_little_endian(bytes, std::bit_cast<std::uint32_t>(p[k]));
  return base64(bytes);
}

std::string colors_text(const std::vector<glm::vec3>& colors) {
  std::string bytes;
  for (const glm::vec3& color : colors) {
    for (int k = 0; k < 3; ++k)
      bytes += static_cast<char>(std::lround(255 * encode_srgb(std::clamp(color[k], 0.0F, 1.0F))));
  }
  return base64(bytes);
}

std::string faces_text(const std::vector<glm::uvec3>& faces) {
  std::string bytes;
  for (const glm::uvec3& face : faces)
    for (int k = 0; k < 3; ++k) append_little_endian(bytes, face[k]);
  return base64(bytes);
}

std::string normals_text(const std::vector<glm::vec3>& normals) {
  std::string bytes;
  for (const glm::vec3& normal : normals)
    for (int k = 0; k < 3; ++k) bytes += static_cast<char>(std::lround(127 * normal[k]));
  return base64(bytes);
}

std::string texcoords_text(const std::vector<glm::vec2>& texcoords) {
  std::string bytes;
  for (const glm::vec2& t : texcoords)
    for (int k = 0; k < 2; ++k) append_little_endian(bytes, std::bit_cast<std::uint32_t>(t[k]));
  return base64(bytes);
}

std::string picture_address(const Texture& texture) {
  return "data:image/png;base64," + base64(encode_texture("picture.png", texture));
}

Texture texture_of(const Image& image) {
  Texture texture{image.width, image.height, {}};
  for (const glm::vec4& pixel : image.pixels) texture.texels.emplace_back(pixel);
  return texture;
}

/// Not too large for a page.
Json texture_data(const Texture& texture) {
  constexpr int k_longest = 1024;
  constexpr std::array<const char*, 3> k_wraps{"Repeat", "MirroredRepeat", "ClampToEdge"};
  Image image(texture.width, texture.height);
  for (std::size_t i = 0; i < texture.texels.size(); ++i) image.pixels[i] = glm::vec4(texture.texels[i], 1);
  return {{"picture", picture_address(texture_of(fitted(image, k_longest)))},
          {"wrap", k_wraps[static_cast<std::size_t>(texture.wrap)]}};
}

/// [vertex] of unit length, or 0 where no face says one.
std::vector<glm::vec3> normals_of(const std::vector<glm::vec3>& positions,
                                  const std::vector<glm::uvec3>& faces) {
  std::vector<glm::vec3> normals(positions.size(), glm::vec3(0));
  for (const glm::uvec3& face : faces) {
    const glm::vec3 origin = positions[face.x];
    const glm::vec3 normal = glm::cross(positions[face.y] - origin, positions[face.z] - origin);
    for (int k = 0; k < 3; ++k) normals[face[k]] += normal;
  }
  for (glm::vec3& normal : normals) {
    const float length = glm::length(normal);
    normal = length > 0 && std::isfinite(length) ? normal / length : glm::vec3(0);
  }
  return normals;
}

/// Corners of a picture that lies in a plane at some depth, from the lower left one to the right, world.
std::array<glm::vec3, 4> plane_corners(const Camera& camera, int width, int height, float depth) {
  const Projection p = projection(camera, width, height);
  const glm::vec2 edge = glm::vec2(width, height) / static_cast<float>(std::min(width, height));
  const glm::mat4 to_world = glm::inverse(camera.view);
  constexpr std::array<std::pair<float, float>, 4> k_corners{{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}};
  std::array<glm::vec3, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::vec2 ndc = edge * glm::vec2(k_corners[i].first, k_corners[i].second);
    const glm::vec2 at = (ndc - p.offset) / p.scale * (camera.orthographic_height ? 1.0F : depth);
    corners[i] = glm::vec3(to_world * glm::vec4(at, -depth, 1));
  }
  return corners;
}

glm::vec3 centre_of(const Camera& camera) { return glm::vec3(glm::inverse(camera.view)[3]); }

float largest_distance(const std::vector<glm::vec3>& points, glm::vec3 from) {
  float largest = 0;
  for (const glm::vec3& p : points) largest = std::max(largest, glm::distance(p, from));
  return largest;
}

Json corners_to_json(const std::array<glm::vec3, 4>& corners) {
  Json list = Json::array();
  for (const glm::vec3& corner : corners) list.push_back(to_json(glm::dvec3(corner)));
  return list;
}

Json camera_data(const ModelCamera& camera) {
  Json json{{"label", camera.label}, {"name", camera.name}, {"standsOut", camera.stands_out}};
  json["near"] = corners_to_json(plane_corners(camera.camera, camera.width, camera.height, 0));
  json["far"] = corners_to_json(plane_corners(camera.camera, camera.width, camera.height, camera.depth));
  if (camera.picture.pixels.empty()) return json;
  json["picture"] = picture_address(texture_of(fitted(camera.picture)));
  return json;
}

/// An orthographic view becomes one from far away. `tangents`: of what must be in sight to either side and upwards.
Json start_to_json(const Viewpoint& start) {
  constexpr float k_far = 100;  // heights of the picture
  const float depth = start.camera.orthographic_height ? k_far * *start.camera.orthographic_height : 1.0F;
  const glm::mat4 to_world = glm::inverse(start.camera.view);
  glm::mat4 placed = to_world;
  if (start.camera.orthographic_height) placed[3] += depth * to_world[2];
  glm::vec2 tangents(0);
  for (const glm::vec3& corner : plane_corners(start.camera, start.width, start.height, depth)) {
    const glm::vec2 seen = glm::abs(glm::vec2(start.camera.view * glm::vec4(corner, 1)));
    tangents = glm::max(tangents, seen / depth);
  }
  Json matrix = Json::array();
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row) matrix.push_back(number(placed[column][row]));
  return {{"matrix", matrix}, {"tangents", {number(tangents.x), number(tangents.y)}}};
}

}  // namespace

void add_mesh(Model& model, const Mesh& mesh, const glm::mat4& transform) {
  std::vector<glm::vec3> positions;
  for (const glm::vec3& p : mesh.positions) positions.emplace_back(transform * glm::vec4(p, 1));
  const std::vector<glm::vec3> normals = normals_of(positions, mesh.faces);
  const auto first_texture = static_cast<std::uint32_t>(model.textures.size());
  const bool is_textured = !mesh.textures.empty();
  // A vertex of the mesh is one of the model for each of its texture coordinates, and for each coloured face.
  std::unordered_map<std::uint64_t, std::uint32_t> known;
  for (std::size_t face = 0; face < mesh.faces.size(); ++face) {
    if (!mesh.face_colors.empty()) known.clear();
    glm::uvec3 corners;
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t vertex = mesh.faces[face][k];
      const std::uint32_t texcoord = is_textured ? mesh.face_texcoords[face][k] : 0;
      const auto next = static_cast<std::uint32_t>(model.positions.size());
      const auto [found, is_new] = known.try_emplace(std::uint64_t{vertex} << 32U | texcoord, next);
      corners[k] = found->second;
      if (!is_new) continue;
      model.positions.push_back(positions[vertex]);
      model.normals.push_back(normals[vertex]);
      model.texcoords.push_back(is_textured ? mesh.texcoords[texcoord] : glm::vec2(0));
      const glm::vec3 own = mesh.vertex_colors.empty() ? glm::vec3(1) : mesh.vertex_colors[vertex];
      model.colors.push_back(mesh.face_colors.empty() ? own : mesh.face_colors[face]);
    }
    model.faces.push_back(corners);
    const std::uint32_t texture = texture_of(mesh, face);
    model.face_textures.push_back(texture == k_no_texture ? k_no_texture : first_texture + texture);
  }
  model.textures.insert(model.textures.end(), mesh.textures.begin(), mesh.textures.end());
}

Viewpoint overview(const Model& model) {
  constexpr float k_fov_degrees = 40, k_most_radii = 3.5F, k_above_degrees = 25, k_beside_degrees = 30;
  std::vector<glm::vec3> centres;
  for (const ModelCamera& camera : model.cameras) centres.push_back(centre_of(camera.camera));
  const float own = std::max(largest_distance(model.positions, model.pivot), 1e-6F);
  const float radius = std::clamp(1.1F * largest_distance(centres, model.pivot), own, k_most_radii * own);

  const glm::vec3 towards = centres.empty() ? glm::vec3(0, 0, 1) : centres.front() - model.pivot;
  glm::vec3 level = towards - glm::dot(towards, model.up) * model.up;
  if (glm::length(level) < 1e-3F * glm::length(towards)) {
    const glm::vec3 other = std::abs(model.up.x) < 0.5F ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0);
    level = glm::cross(model.up, other);
  }
  level = glm::normalize(level);
  const glm::vec3 side = glm::cross(model.up, level);
  const float above = glm::radians(k_above_degrees), beside = glm::radians(k_beside_degrees);
  const glm::vec3 back =
      std::cos(above) * (std::cos(beside) * level + std::sin(beside) * side) + std::sin(above) * model.up;
  const glm::vec3 right = glm::normalize(glm::cross(model.up, back));
  const float distance = radius / std::sin(glm::radians(k_fov_degrees / 2));
  glm::mat4 to_world(1.0F);
  to_world[0] = glm::vec4(right, 0);
  to_world[1] = glm::vec4(glm::cross(back, right), 0);
  to_world[2] = glm::vec4(back, 0);
  to_world[3] = glm::vec4(model.pivot + distance * back, 1);
  Viewpoint viewpoint{{}, 1, 1};
  viewpoint.camera.view = glm::inverse(to_world);
  viewpoint.camera.fov_y_degrees = k_fov_degrees;
  return viewpoint;
}

glm::vec3 common_up(const std::vector<ModelCamera>& cameras) {
  constexpr float k_least = 0.2F;  // of the sum's length where all agree
  glm::vec3 sum(0);
  for (const ModelCamera& camera : cameras)
    sum += glm::normalize(glm::vec3(glm::inverse(camera.camera.view)[1]));
  const float length = glm::length(sum);
  return length > k_least * static_cast<float>(cameras.size()) ? sum / length : glm::vec3(0, 1, 0);
}

std::string model_data(const Model& model) {
  std::vector<std::size_t> order(model.faces.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return model.face_textures[i]; });
  std::vector<glm::uvec3> faces;
  for (const std::size_t i : order) faces.push_back(model.faces[i]);
  Json json{{"positions", positions_text(model.positions)}, {"normals", normals_text(model.normals)},
            {"colors", colors_text(model.colors)},          {"faces", faces_text(faces)},
            {"pivot", to_json(glm::dvec3(model.pivot))},    {"up", to_json(glm::dvec3(model.up))},
            {"start", start_to_json(model.start)}};
  // How many faces have each of the textures; what is left has none.
  Json& textures = json["textures"] = Json::array();
  for (std::size_t i = 0; i < model.textures.size(); ++i) {
    textures.push_back(texture_data(model.textures[i]));
    textures.back()["faces"] = std::ranges::count(model.face_textures, static_cast<std::uint32_t>(i));
  }
  if (!model.textures.empty()) json["texcoords"] = texcoords_text(model.texcoords);
  Json& cameras = json["cameras"] = Json::array();
  for (const ModelCamera& camera : model.cameras) cameras.push_back(camera_data(camera));
  return script_safe(json);
}

}  // namespace dpr::cli
