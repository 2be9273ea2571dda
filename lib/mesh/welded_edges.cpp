#include "mesh/welded_edges.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <tuple>

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

/// For every vertex the first one at its position.
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

/// A side of a face: face * 3 + the corner at which it begins; and the higher of its ends, welded.
struct Side {
  std::uint32_t high, side;
};

/// The sides of all faces by the lower of their ends: [starts[v], starts[v + 1]).
struct SideLists {
  std::vector<std::uint32_t> starts;
  std::vector<Side> sides;
};

SideLists list_sides(std::span<const glm::uvec3> faces, const std::vector<std::uint32_t>& welded) {
  SideLists lists;
  lists.starts.assign(welded.size() + 1, 0);
  const auto for_each_side = [&](auto visit) {
    for (std::uint32_t face = 0; face < faces.size(); ++face) {
      for (std::uint32_t corner = 0; corner < 3; ++corner) {
        const std::uint32_t a = welded[faces[face][static_cast<int>(corner)]],
                            b = welded[faces[face][static_cast<int>((corner + 1) % 3)]];
        if (a != b) visit(std::min(a, b), std::max(a, b), 3 * face + corner);
      }
    }
  };
  for_each_side([&](std::uint32_t low, std::uint32_t, std::uint32_t) { ++lists.starts[low + 1]; });
  for (std::size_t v = 0; v < welded.size(); ++v) lists.starts[v + 1] += lists.starts[v];
  lists.sides.resize(lists.starts.back());
  std::vector<std::uint32_t> next(lists.starts.begin(), lists.starts.end() - 1);
  for_each_side([&](std::uint32_t low, std::uint32_t high, std::uint32_t side) {
    lists.sides[next[low]++] = {high, side};
  });
  return lists;
}

WeldedEdge lone_edge(std::span<const glm::uvec3> faces, std::uint32_t side) {
  const glm::uvec3& face = faces[side / 3];
  const int corner = static_cast<int>(side % 3);
  return {.first = face[corner], .second = face[(corner + 1) % 3], .face = side / 3, .other = {}};
}

void add_pair(std::span<const glm::uvec3> faces, const std::vector<std::uint32_t>& welded,
              std::uint32_t own_side, std::uint32_t other_side, std::vector<WeldedEdge>& edges) {
  WeldedEdge own = lone_edge(faces, own_side), other = lone_edge(faces, other_side);
  own.other = other.face;
  other.other = own.face;
  own.same_direction = other.same_direction = welded[own.first] == welded[other.first];
  own.shares_vertices = own.same_direction ? own.first == other.first && own.second == other.second
                                           : own.first == other.second && own.second == other.first;
  edges.push_back(own);
  if (!own.shares_vertices) edges.push_back(other);
}

}  // namespace

std::vector<WeldedEdge> make_welded_edges(std::span<const glm::vec3> positions,
                                          std::span<const glm::uvec3> faces) {
  const std::vector<std::uint32_t> welded = weld(positions);
  SideLists lists = list_sides(faces, welded);
  std::vector<WeldedEdge> edges;
  edges.reserve(faces.size() * 3 / 2);
  for (std::size_t v = 0; v < positions.size(); ++v) {
    const auto begin = lists.sides.begin() + lists.starts[v], end = lists.sides.begin() + lists.starts[v + 1];
    std::sort(begin, end, [](const Side& a, const Side& b) {
      return std::tie(a.high, a.side) < std::tie(b.high, b.side);
    });
    for (auto first = begin, last = begin; first != end; first = last) {
      last = std::find_if(first, end, [&](const Side& s) { return s.high != first->high; });
      if (last - first == 2 && first->side / 3 != (first + 1)->side / 3) {
        add_pair(faces, welded, first->side, (first + 1)->side, edges);
      } else {
        for (auto side = first; side != last; ++side) edges.push_back(lone_edge(faces, side->side));
      }
    }
  }
  return edges;
}

}  // namespace dpr
