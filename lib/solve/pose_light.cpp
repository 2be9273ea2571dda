// Light in closed form.
#include "solve/pose_light.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>

#include "dpr/light.hpp"

namespace dpr {
namespace {

// The prior on directional light, and on what does not depend on the colour, in pixels that show nothing of
// them: it matters in coarse images, which would else explain any pose.
constexpr double k_prior_pixels = 0.1;

/// Mean squares over the sphere of the polynomials that the kernels take for harmonics.
constexpr std::array<double, k_harmonics> k_mean_squares{1,        1.0 / 3, 1.0 / 3,  1.0 / 3, 1.0 / 15,
                                                         1.0 / 15, 4.0 / 5, 1.0 / 15, 4.0 / 15};

}  // namespace

ChannelLight solve_light(const LightSums& sums) {
  const Eigen::Index last = sums.normal.rows() - 1;
  const double whole = sums.normal(last, last), part = k_prior_pixels / std::max(whole, k_prior_pixels);
  // A channel in which nothing is seen has no light: what is added keeps the matrix invertible.
  constexpr double k_least = 1e-6;
  Eigen::VectorXd prior = Eigen::VectorXd::Constant(last + 1, k_least * whole + 1e-20);
  for (Eigen::Index k = 1; k < last; ++k)
    prior[k] = k_mean_squares[static_cast<std::size_t>(k)] * (prior[k] + part * sums.normal(0, 0));
  prior[last] += part * whole;
  Eigen::MatrixXd normal = sums.normal;
  normal.diagonal() += prior;
  Eigen::VectorXd right = sums.right;
  ChannelLight result;
  const auto solve = [&] {
    result.inverse = normal.llt().solve(Eigen::MatrixXd::Identity(last + 1, last + 1));
    result.light = result.inverse * right;
  };
  const auto solve_without = [&](Eigen::Index first) {  // the terms before it
    normal.topRows(first).setZero();
    normal.leftCols(first).setZero();
    normal.diagonal().head(first).setOnes();
    right.head(first).setZero();
    solve();
    result.inverse.diagonal().head(first).setZero();
  };
  solve();
  // Less than no light would make a negative of the colours, everywhere or where the object is seen: there is none.
  if (result.light[0] < 0) solve_without(1);
  if (sums.sum.head(last).dot(result.light.head(last)) < 0) solve_without(last);
  if (sums.sum.dot(result.light) < 0) result.light.setZero();  // light takes nothing away
  result.prior_loss = result.light.cwiseAbs2().dot(prior);
  result.seen = whole;
  return result;
}

namespace {

/// [face * 3 + corner] of any length, from the faces around the vertices.
std::vector<glm::dvec3> normals_of_faces(const Mesh& mesh, const glm::dmat3& stretch, CornerNormals normals) {
  constexpr double k_sharp = 0.7;        // cosine
  std::vector<glm::dvec3> face_normals;  // as long as twice their areas
  std::vector<std::vector<std::size_t>> faces_at(mesh.positions.size());
  for (const glm::uvec3& f : mesh.faces) {
    const auto corner = [&](int k) { return stretch * glm::dvec3(mesh.positions[f[k]]); };
    for (int k = 0; k < 3; ++k) faces_at[f[k]].push_back(face_normals.size());
    face_normals.push_back(glm::cross(corner(1) - corner(0), corner(2) - corner(0)));
  }
  const auto is_parted = [&](const glm::dvec3& a, const glm::dvec3& b) {
    return glm::dot(a, b) <= k_sharp * glm::length(a) * glm::length(b);
  };
  std::vector<glm::dvec3> result;
  for (std::size_t face = 0; face < mesh.faces.size(); ++face) {
    for (int k = 0; k < 3; ++k) {
      glm::dvec3 sum(0);
      for (const std::size_t other : faces_at[mesh.faces[face][k]]) {
        const bool counts = other == face || normals == CornerNormals::smooth ||
                            !is_parted(face_normals[face], face_normals[other]);
        if (counts) sum += face_normals[other];
      }
      result.push_back(sum);
    }
  }
  return result;
}

/// [face * 3 + corner], of a mesh that gives them.
std::vector<glm::dvec3> given_normals(const Mesh& mesh, const glm::dmat3& stretch) {
  const glm::dmat3 turned = glm::transpose(glm::inverse(stretch));
  std::vector<glm::dvec3> result;
  for (const glm::uvec3& f : mesh.face_normals) {
    for (int k = 0; k < 3; ++k) result.push_back(turned * glm::dvec3(mesh.normals[f[k]]));
  }
  return result;
}

}  // namespace

void give_normals(Mesh& mesh, const glm::dmat3& stretch, CornerNormals normals) {
  const std::vector<glm::dvec3> of_corners =
      mesh.face_normals.empty() ? normals_of_faces(mesh, stretch, normals) : given_normals(mesh, stretch);
  mesh.normals.clear();
  mesh.face_normals.clear();
  for (const glm::dvec3& normal : of_corners) {
    const double length = glm::length(normal);
    mesh.normals.emplace_back(length > 0 ? normal / length : normal);
  }
  for (unsigned face = 0; face < mesh.faces.size(); ++face)
    mesh.face_normals.emplace_back(3 * face, 3 * face + 1, 3 * face + 2);
}

}  // namespace dpr
