/// Reference for the losses of a mesh's shape: Laplacian (77), edge length, normal consistency, flatness.
/// Neighbourhoods by sets, one edge after the other.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "reference/vec.hpp"

namespace dpr::reference {

using Face = std::array<std::size_t, 3>;

struct MeshTerms {
  double laplacian = 0.0;           ///< sum over vertices
  double edge_length = 0.0;         ///< mean over edges
  double normal_consistency = 0.0;  ///< mean over pairs of faces at an edge
  double flatness = 0.0;            ///< mean over these
};

/// A face at an edge, and its corner across.
struct EdgeFace {
  std::size_t face, across;
};

/// The faces of every edge.
inline std::map<std::pair<std::size_t, std::size_t>, std::vector<EdgeFace>> edges_of(
    const std::vector<Face>& faces) {
  std::map<std::pair<std::size_t, std::size_t>, std::vector<EdgeFace>> edges;
  for (std::size_t face = 0; face < faces.size(); ++face) {
    const Face& f = faces[face];
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t a = f[i], b = f[(i + 1) % 3];
      if (a != b) edges[{a < b ? a : b, a < b ? b : a}].push_back({face, f[(i + 2) % 3]});
    }
  }
  return edges;
}

/// Cosine of the angle between the normals of two faces at an edge, both formed along it: 1 where they are
/// flat, whatever the faces' orientation; 1 also where one has no area.
inline double hinge_cosine(const Vec3d& a, const Vec3d& b, const Vec3d& e0, const Vec3d& e1) {
  const Vec3d n0 = cross(a - e0, e1 - e0), n1 = cross(e1 - e0, b - e0);
  if (length(n0) <= k_no_direction || length(n1) <= k_no_direction) return 1.0;
  return dot(unit(n0), unit(n1));
}

inline MeshTerms mesh_terms(const std::vector<Vec3d>& positions, const std::vector<Face>& faces,
                            double edge_target) {
  MeshTerms terms;
  std::vector<std::set<std::size_t>> rings(positions.size());
  const auto edges = edges_of(faces);
  std::size_t hinges = 0;
  for (const auto& [ends, at_edge] : edges) {
    rings[ends.first].insert(ends.second);
    rings[ends.second].insert(ends.first);
    const Vec3d &e0 = positions[ends.first], &e1 = positions[ends.second];
    const double excess = length(e1 - e0) - edge_target;
    terms.edge_length += excess * excess / static_cast<double>(edges.size());
    for (std::size_t i = 0; i < at_edge.size(); ++i) {
      for (std::size_t k = i + 1; k < at_edge.size(); ++k) {
        if (at_edge[i].face == at_edge[k].face) continue;
        const double bend =
            1.0 - hinge_cosine(positions[at_edge[i].across], positions[at_edge[k].across], e0, e1);
        terms.normal_consistency += bend;
        terms.flatness += bend * bend;
        ++hinges;
      }
    }
  }
  if (hinges > 0) {
    terms.normal_consistency /= static_cast<double>(hinges);
    terms.flatness /= static_cast<double>(hinges);
  }
  for (std::size_t v = 0; v < positions.size(); ++v) {
    if (rings[v].empty()) continue;
    Vec3d mean;
    for (const std::size_t other : rings[v])
      mean += (1.0 / static_cast<double>(rings[v].size())) * positions[other];
    const Vec3d laplacian = positions[v] - mean;
    terms.laplacian += dot(laplacian, laplacian);
  }
  return terms;
}

}  // namespace dpr::reference
