// Penalty for bending a mesh away from its first shape.
#pragma once

#include <span>
#include <vector>

#include "dpr/mesh.hpp"
#include "mesh/adjacency.hpp"

namespace dpr {

/// As rigid as possible (Sorkine & Alexa 2007), of edges of equal weights:
///   E(p) = weight sum_v min_R sum_u |p_u - p_v - R (q_u - q_v)|^2 / sum_v sum_u |q_u - q_v|^2,
/// u in the one-ring of v, R a rotation, q the rest positions: the mean squared strain. It is 0 where the
/// mesh was moved rigidly, and the same whatever the unit of lengths. On the host, in double precision;
/// O(vertices + edges). Deterministic.
class Rigidity {
 public:
  Rigidity(const Mesh& rest, double weight);

  /// E and its gradient, both [vertex][3]. The best rotations have none of their own. Where edges are bent so
  /// far that two rotations are as good, it is that of one of them.
  double evaluate(std::span<const double> positions, std::vector<double>& gradient) const;

 private:
  Adjacency adjacency_;
  std::vector<double> rest_;  // [vertex][3]
  double scale_ = 0;          // weight over the sum of squared lengths
};

}  // namespace dpr
