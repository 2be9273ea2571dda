// The preconditioner of steps on a mesh's vertices.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "dpr/mesh.hpp"

namespace dpr {

/// (I + lambda L)^-1, L the combinatorial Laplacian of the mesh's edges: degrees on the diagonal, -1 for each
/// edge (Nicolet, Jacobson & Jakob, Large Steps in Inverse Rendering of Geometry, 2021). By a sparse Cholesky
/// factorization, made once. Deterministic.
class LargeSteps {
 public:
  LargeSteps(const Mesh& mesh, double lambda);
  ~LargeSteps();

  /// Applies it to each coordinate of [vertex][3].
  std::vector<double> solve(std::span<const double> values) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dpr
