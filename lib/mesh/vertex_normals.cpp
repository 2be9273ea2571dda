#include "mesh/vertex_normals.hpp"

#include <algorithm>
#include <string>

#include "base/checks.hpp"

namespace dpr {

std::vector<dvec3> normal_sums(std::span<const vec3> positions, std::span<const uvec3> faces) {
  std::vector<dvec3> sums(positions.size(), dvec3(0));
  for (const uvec3& face : faces) {
    const dvec3 a(positions[face.x]), b(positions[face.y]), c(positions[face.z]);
    const dvec3 normal = glm::cross(b - a, c - a);
    for (int corner = 0; corner < 3; ++corner) sums[face[corner]] += normal;
  }
  return sums;
}

std::vector<dvec3> normal_sums_backward(std::span<const vec3> positions, std::span<const uvec3> faces,
                                        std::span<const dvec3> grad) {
  std::vector<dvec3> sums(positions.size(), dvec3(0));
  for (const uvec3& face : faces) {
    const dvec3 g = grad[face.x] + grad[face.y] + grad[face.z];
    for (int corner = 0; corner < 3; ++corner) {
      const dvec3 next(positions[face[(corner + 1) % 3]]), previous(positions[face[(corner + 2) % 3]]);
      sums[face[corner]] += glm::cross(next - previous, g);
    }
  }
  return sums;
}

dvec3 direction_of(const dvec3& normal) {
  const double length = glm::length(normal);
  return length > 0 ? normal / length : dvec3(0);
}

dvec3 direction_backward(const dvec3& normal, const dvec3& grad) {
  const double length = glm::length(normal);
  if (!(length > 0)) return dvec3(0);
  const dvec3 direction = normal / length;
  return (grad - glm::dot(direction, grad) * direction) / length;
}

namespace {

void require_mesh(std::span<const vec3> positions, std::span<const uvec3> faces) {
  checks::require_numbers(checks::floats_of(positions), 3 * positions.size(), "positions (vertex_normals)");
  for (std::size_t i = 0; i < faces.size(); ++i)
    if (const std::uint32_t largest = std::max({faces[i].x, faces[i].y, faces[i].z});
        largest >= positions.size())
      throw InvalidArgument(checks::in(checks::element("faces", i), "vertex_normals"),
                            std::to_string(largest),
                            "indices below " + std::to_string(positions.size()) + ", the positions");
}

}  // namespace

std::vector<vec3> vertex_normals(std::span<const vec3> positions, std::span<const uvec3> faces) {
  require_mesh(positions, faces);
  std::vector<vec3> normals;
  normals.reserve(positions.size());
  for (const dvec3& sum : normal_sums(positions, faces)) normals.emplace_back(direction_of(sum));
  return normals;
}

std::vector<vec3> vertex_normals_backward(std::span<const vec3> positions, std::span<const uvec3> faces,
                                          std::span<const vec3> grad) {
  require_mesh(positions, faces);
  checks::require_numbers(checks::floats_of(grad), 3 * positions.size(), "grad (vertex_normals)");
  std::vector<dvec3> grad_sums = normal_sums(positions, faces);
  for (std::size_t i = 0; i < grad.size(); ++i)
    grad_sums[i] = direction_backward(grad_sums[i], dvec3(grad[i]));
  const std::vector<dvec3> found = normal_sums_backward(positions, faces, grad_sums);
  return {found.begin(), found.end()};
}

}  // namespace dpr
