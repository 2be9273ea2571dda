#include "mesh/weld.hpp"

#include <bit>
#include <limits>

namespace dpr {
namespace {

constexpr std::uint32_t k_empty = std::numeric_limits<std::uint32_t>::max();

std::size_t hash_of(const glm::vec3& v) {
  std::uint64_t hash = 0;
  for (int axis = 0; axis < 3; ++axis) {
    // Adding zero makes -0 and 0 one. The factor is 2^64 over the golden ratio.
    hash = (hash ^ std::bit_cast<std::uint32_t>(v[axis] + 0.0F)) * 0x9e3779b97f4a7c15U;
    hash ^= hash >> 32U;
  }
  return hash;
}

}  // namespace

std::vector<std::uint32_t> weld(std::span<const glm::vec3> positions) {
  const std::size_t places = std::bit_ceil(2 * positions.size() + 1);
  std::vector<std::uint32_t> table(places, k_empty), first(positions.size());
  for (std::uint32_t v = 0; v < positions.size(); ++v) {
    std::size_t place = hash_of(positions[v]) & (places - 1);
    while (table[place] != k_empty && positions[table[place]] != positions[v])
      place = (place + 1) & (places - 1);
    if (table[place] == k_empty) table[place] = v;
    first[v] = table[place];
  }
  return first;
}

std::vector<glm::uvec3> weld(std::span<const glm::uvec3> faces, std::span<const std::uint32_t> first) {
  std::vector<glm::uvec3> welded;
  welded.reserve(faces.size());
  for (const glm::uvec3& face : faces) welded.emplace_back(first[face.x], first[face.y], first[face.z]);
  return welded;
}

void weld(Mesh& mesh) {
  std::vector<std::uint32_t> vertex = weld(mesh.positions);
  std::uint32_t count = 0;
  for (std::uint32_t v = 0; v < vertex.size(); ++v) {
    if (vertex[v] == v) {
      mesh.positions[count] = mesh.positions[v];
      vertex[v] = count++;
    } else {
      vertex[v] = vertex[vertex[v]];
    }
  }
  mesh.positions.resize(count);
  mesh.faces = weld(mesh.faces, vertex);
}

}  // namespace dpr
