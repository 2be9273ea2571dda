#include "solve/large_steps.hpp"

#include <Eigen/SparseCholesky>

#include "mesh/adjacency.hpp"

namespace dpr {

struct LargeSteps::Impl {
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factorization;
};

LargeSteps::LargeSteps(const Mesh& mesh, double lambda) : impl_(std::make_unique<Impl>()) {
  const Adjacency adjacency = make_adjacency(mesh);
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(mesh.positions.size() + adjacency.ring.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const auto row = static_cast<int>(v);
    const std::uint32_t first = adjacency.ring_starts[v], last = adjacency.ring_starts[v + 1];
    entries.emplace_back(row, row, 1 + lambda * (last - first));
    for (std::uint32_t k = first; k < last; ++k)
      entries.emplace_back(row, static_cast<int>(adjacency.ring[k]), -lambda);
  }
  const auto size = static_cast<Eigen::Index>(mesh.positions.size());
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  impl_->factorization.compute(matrix);  // cannot fail: the matrix is diagonally dominant
}

LargeSteps::~LargeSteps() = default;

std::vector<double> LargeSteps::solve(std::span<const double> values) const {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
  std::vector<double> result(values.size());
  const auto rows = static_cast<Eigen::Index>(values.size() / 3);
  Eigen::Map<Rows>(result.data(), rows, 3) =
      impl_->factorization.solve(Eigen::MatrixX3d(Eigen::Map<const Rows>(values.data(), rows, 3)));
  return result;
}

}  // namespace dpr
