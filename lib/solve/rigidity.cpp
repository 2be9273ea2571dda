#include "solve/rigidity.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace dpr {
namespace {

using ConstVector = Eigen::Map<const Eigen::Vector3d>;

Eigen::Vector3d edge(std::span<const double> positions, std::size_t from, std::size_t to) {
  return ConstVector(&positions[3 * to]) - ConstVector(&positions[3 * from]);
}

/// The rotation R with the largest trace(R covariance): of sum |b - R a|^2, covariance = sum a b^T (Kabsch
/// 1976).
Eigen::Matrix3d best_rotation(const Eigen::Matrix3d& covariance) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((svd.matrixV() * u.transpose()).determinant() < 0) u.col(2) = -u.col(2);  // of the least singular value
  return svd.matrixV() * u.transpose();
}

}  // namespace

Rigidity::Rigidity(const Mesh& rest, double weight) : adjacency_(make_adjacency(rest)) {
  for (const glm::vec3& p : rest.positions) {
    for (int i = 0; i < 3; ++i) rest_.push_back(static_cast<double>(p[i]));
  }
  double sum = 0;
  for (std::size_t v = 0; v < rest.positions.size(); ++v) {
    for (std::size_t k = adjacency_.ring_starts[v]; k < adjacency_.ring_starts[v + 1]; ++k)
      sum += edge(rest_, v, adjacency_.ring[k]).squaredNorm();
  }
  scale_ = sum > 0 ? weight / sum : 0;
}

double Rigidity::evaluate(std::span<const double> positions, std::vector<double>& gradient) const {
  gradient.assign(positions.size(), 0);
  double sum = 0;
  for (std::size_t v = 0; 3 * v < positions.size(); ++v) {
    const std::span ring =
        std::span(adjacency_.ring)
            .subspan(adjacency_.ring_starts[v], adjacency_.ring_starts[v + 1] - adjacency_.ring_starts[v]);
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (const std::size_t u : ring) covariance += edge(rest_, v, u) * edge(positions, v, u).transpose();
    const Eigen::Matrix3d rotation = best_rotation(covariance);
    for (const std::size_t u : ring) {
      const Eigen::Vector3d strain = edge(positions, v, u) - rotation * edge(rest_, v, u);
      sum += strain.squaredNorm();
      Eigen::Map<Eigen::Vector3d>(&gradient[3 * u]) += 2 * scale_ * strain;
      Eigen::Map<Eigen::Vector3d>(&gradient[3 * v]) -= 2 * scale_ * strain;
    }
  }
  return scale_ * sum;
}

}  // namespace dpr
