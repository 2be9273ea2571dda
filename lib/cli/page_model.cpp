// The data of a model as JSON, its long arrays in base64 of little-endian numbers.
#include "cli/page_model.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string_view>
#include <utility>

#include "cli/json.hpp"
#include "cli/page.hpp"
#include "image/codec.hpp"
#include "image/srgb.hpp"

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

/// The nearest texel.
glm::vec3 texel_at(const Texture& texture, glm::vec2 uv) {
  const auto place = [&](float coordinate, int size) {
    switch (texture.wrap) {
      case Wrap::repeat:
        coordinate -= std::floor(coordinate);
        break;
      case Wrap::mirror:
        coordinate = 1 - std::abs(coordinate - 2 * std::floor(coordinate / 2) - 1);
        break;
      case Wrap::clamp:
        break;
    }
    const float texels = std::clamp(coordinate, 0.0F, 1.0F) * static_cast<float>(size);
    return static_cast<std::size_t>(std::min(static_cast<int>(texels), size - 1));
  };
  const std::size_t column = place(uv.x, texture.width), row = place(1 - uv.y, texture.height);
  return texture.texels[row * static_cast<std::size_t>(texture.width) + column];
}

/// What the texture of a face has at a corner; white where it has none.
glm::vec3 texture_color(const Mesh& mesh, std::size_t face, int corner) {
  if (mesh.textures.empty()) return glm::vec3(1);
  const std::uint32_t texture = mesh.face_textures.empty() ? 0 : mesh.face_textures[face];
  if (texture == k_no_texture) return glm::vec3(1);
  return texel_at(mesh.textures[texture], mesh.texcoords[mesh.face_texcoords[face][corner]]);
}

/// [vertex] the colours of a mesh whose faces have none of their own.
std::vector<glm::vec3> vertex_colors_of(const Mesh& mesh) {
  std::vector<glm::vec3> colors = mesh.vertex_colors;
  colors.resize(mesh.positions.size(), glm::vec3(1));
  if (mesh.textures.empty()) return colors;
  std::vector<glm::vec4> sums(colors.size(), glm::vec4(0));
  for (std::size_t face = 0; face < mesh.faces.size(); ++face)
    for (int k = 0; k < 3; ++k) sums[mesh.faces[face][k]] += glm::vec4(texture_color(mesh, face, k), 1);
  for (std::size_t i = 0; i < colors.size(); ++i)
    if (sums[i].w > 0) colors[i] *= glm::vec3(sums[i]) / sums[i].w;
  return colors;
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
  const Image picture = fitted(camera.picture);
  Texture texture{picture.width, picture.height, {}};
  for (const glm::vec4& pixel : picture.pixels) texture.texels.emplace_back(pixel);
  json["picture"] = "data:image/png;base64," + base64(encode_texture("picture.png", texture));
  return json;
}

/// An orthographic view becomes one from far away. `tangents`: of what must be in sight to either side and upwards.
Json start_to_json(const Viewpoint& start) {
  constexpr float k_far = 20;  // heights of the picture
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
  const auto first = static_cast<std::uint32_t>(model.positions.size());
  const auto add_vertex = [&](glm::vec3 position, glm::vec3 color) {
    model.positions.emplace_back(transform * glm::vec4(position, 1));
    model.colors.push_back(color);
  };
  if (mesh.face_colors.empty()) {
    const std::vector<glm::vec3> colors = vertex_colors_of(mesh);
    for (std::size_t i = 0; i < colors.size(); ++i) add_vertex(mesh.positions[i], colors[i]);
    for (const glm::uvec3& face : mesh.faces) model.faces.push_back(first + face);
    return;
  }
  for (std::size_t face = 0; face < mesh.faces.size(); ++face) {
    const auto corner = static_cast<std::uint32_t>(model.positions.size());
    for (int k = 0; k < 3; ++k)
      add_vertex(mesh.positions[mesh.faces[face][k]], mesh.face_colors[face] * texture_color(mesh, face, k));
    model.faces.emplace_back(corner, corner + 1, corner + 2);
  }
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
  Json json{{"positions", positions_text(model.positions)},
            {"colors", colors_text(model.colors)},
            {"faces", faces_text(model.faces)},
            {"pivot", to_json(glm::dvec3(model.pivot))},
            {"up", to_json(glm::dvec3(model.up))},
            {"start", start_to_json(model.start)}};
  Json& cameras = json["cameras"] = Json::array();
  for (const ModelCamera& camera : model.cameras) cameras.push_back(camera_data(camera));
  return script_safe(json);
}

}  // namespace dpr::cli
