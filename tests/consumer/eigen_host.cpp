// A program that aligns vectors as a processor with AVX wants them: what it compiles from Eigen's headers
// allocates otherwise than what the library did, and nlohmann-json has other members. Each frees what it has
// allocated.
#define EIGEN_MAX_ALIGN_BYTES 32
#define JSON_DIAGNOSTICS 1
#include <Eigen/SparseCholesky>
#include <cstdio>
#include <dpr/dpr.hpp>
#include <nlohmann/json.hpp>

namespace {

/// The solution of a sparse system, which allocates and frees as the library's own do.
double solved(Eigen::Index size) {
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setIdentity();
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factorization(matrix);
  const Eigen::MatrixX3d right = Eigen::MatrixX3d::Ones(size, 3);
  return Eigen::MatrixX3d(factorization.solve(right)).sum();
}

}  // namespace

int main() {
  dpr::ShapeView view{dpr::Image(16, 16, glm::vec4(1)), dpr::orbit_camera(4, 30, 120)};
  dpr::ShapeViews views{.width = 16, .height = 16, .views = {view}, .initial = dpr::make_icosphere(1)};
  const dpr::ShapeResult result =
      dpr::ShapeSolver(dpr::open_device(), views, {.levels = 1, .iterations = 2}).solve();
  const double sum = solved(5) + nlohmann::json::parse("[1, 2]").at(1).get<double>();
  std::printf("%zu iterations, %g\n", result.history.size(), sum);
  return result.history.size() == 2 && sum == 17 ? 0 : 1;
}
