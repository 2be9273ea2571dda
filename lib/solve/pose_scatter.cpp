// Scatter over blocks, and the model's error.
#include "solve/pose_scatter.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace dpr {
namespace {

// Deviations of poses that the model's error makes, in those of the residuals' scatter by pixels: as pictures by other
// software have it (bench/results/notes.md).
constexpr double k_model = 7.5, k_robust_model = 75;
// Part of the weight of pixels that tell of the pose which a robust loss takes where there is clutter.
constexpr double k_cluttered = 0.15;
// Of the noise's scatter, as errors of poses in pictures with independent noise are (pose_uncertainty_test.cpp).
constexpr double k_rough = 2;
constexpr double k_deviation_of_median =
    1.4826;  // a normal distribution's standard deviation over the median of the sizes

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Sums over blocks of cells x cells, the first of which is cut by `offset`.
Eigen::MatrixXd blocks_of(const Eigen::Map<const RowMajor>& scores, Eigen::Index columns, Eigen::Index cells,
                          Eigen::Index offset) {
  const Eigen::Index rows = scores.cols() / columns;
  const Eigen::Index across = (columns + offset + cells - 1) / cells,
                     down = (rows + offset + cells - 1) / cells;
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(scores.rows(), across * down);
  for (Eigen::Index i = 0; i < scores.cols(); ++i) {
    const Eigen::Index row = (i / columns + offset) / cells, column = (i % columns + offset) / cells;
    sums.col(row * across + column) += scores.col(i);
  }
  return sums;
}

/// How many pixels' residuals go together, from the squares of their sums over blocks: 1 of independent ones.
double pixels_together(const ScoreCells& cells) {
  if (!(cells.squares > 0)) return 1;
  const auto count = std::ssize(cells.residuals) / 3;
  const Eigen::Map<const RowMajor> residuals(cells.residuals.data(), 3, count);
  double most = 1;
  for (const Eigen::Index side : {1, 2}) {
    const Eigen::MatrixXd sums = blocks_of(residuals, static_cast<Eigen::Index>(cells.columns), side, 0);
    most = std::max(most, sums.squaredNorm() / cells.squares);
  }
  return most;
}

}  // namespace

PoseSpace::Matrix score_scatter(const ScoreCells& cells, std::size_t parameters, float scale) {
  const auto n = static_cast<Eigen::Index>(parameters);
  const Eigen::MatrixXd hessian = Eigen::Map<const RowMajor>(cells.equations.hessian.data(), n, n);
  const Eigen::MatrixXd by_pixels = Eigen::Map<const RowMajor>(cells.equations.scatter.data(), n, n);
  const Eigen::LLT<Eigen::MatrixXd> factor(hessian);
  if (factor.info() != Eigen::Success) return cells.equations.scatter;
  const double size = factor.solve(by_pixels).trace();  // in units of the Hessian
  if (!(size > 0) || !std::isfinite(size)) return cells.equations.scatter;

  const double together = pixels_together(cells);
  Eigen::MatrixXd widest = together * by_pixels;
  double most = together * size;
  const Eigen::Map<const RowMajor> scores(cells.scores.data(), n, std::ssize(cells.scores) / n);
  for (const Eigen::Index side : {1, 2, 4}) {
    Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(n, n);
    double count = 0;  // of blocks, as many as would scatter alike
    const std::vector<Eigen::Index> offsets =
        side == 1 ? std::vector<Eigen::Index>{0} : std::vector<Eigen::Index>{0, side / 2};
    const double part = 1 / static_cast<double>(offsets.size());
    for (const Eigen::Index offset : offsets) {
      const Eigen::MatrixXd sums = blocks_of(scores, static_cast<Eigen::Index>(cells.columns), side, offset);
      const Eigen::VectorXd sizes = factor.matrixL().solve(sums).colwise().squaredNorm();
      if (!(sizes.squaredNorm() > 0)) continue;
      scatter += part * sums * sums.transpose();
      count += part * sizes.sum() * sizes.sum() / sizes.squaredNorm();
    }
    if (count < 2 * static_cast<double>(n)) break;
    scatter *= count / (count - static_cast<double>(n));
    const double of_blocks = factor.solve(scatter).trace();
    if (of_blocks > most) most = of_blocks, widest = scatter;
  }

  const double noise = std::pow(k_deviation_of_median * static_cast<double>(cells.median), 2);
  double model = k_model * std::max(0.0, 1 - noise * cells.weight * static_cast<double>(n) / size);
  if (scale > 0) {
    const double of_noise = std::pow(1 + 3 * noise / std::pow(static_cast<double>(scale), 2), -2);
    model = k_robust_model * std::clamp((1 - cells.kept / of_noise) / k_cluttered, 0.0, 1.0);
  }
  PoseSpace::Matrix result{};
  Eigen::Map<RowMajor>(result.data(), n, n) = k_rough * widest + model * model * by_pixels;
  return result;
}

void move_pivot(const glm::dvec3& arm, std::vector<double>& covariance) {
  const auto n = static_cast<Eigen::Index>(std::lround(std::sqrt(static_cast<double>(covariance.size()))));
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Matrix to = Matrix::Identity(n, n);
  if (n > 3) to.block<3, 3>(3, 0) << 0, arm.z, -arm.y, -arm.z, 0, arm.x, arm.y, -arm.x, 0;
  Eigen::Map<Matrix> mapped(covariance.data(), n, n);
  mapped = (to * mapped * to.transpose()).eval();
}

}  // namespace dpr
