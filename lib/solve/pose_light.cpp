// Light in closed form.
#include "solve/pose_light.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "dpr/light.hpp"

namespace dpr {
namespace {

// The prior on directional light, and on what does not depend on the colour, in pixels that show nothing of
// them: it matters in coarse images, which would else explain any pose.
constexpr double k_prior_pixels = 0.1;

// Weighing and solving in turn: until the loss falls by no more than a part, but no more often than that. The
// loss of a hypothesis must be at its least for its derivatives to hold.
constexpr int k_most_reweightings = 30;
constexpr double k_least_fall = 1e-5;

/// Real spherical harmonics, each with a mean square of 1 over the sphere.
std::array<float, k_harmonics> harmonics(const glm::vec3& n) {
  const float first = std::sqrt(3.0F), second = std::sqrt(15.0F), zonal = std::sqrt(1.25F);
  return {1,
          first * n.x,
          first * n.y,
          first * n.z,
          second * n.x * n.y,
          second * n.y * n.z,
          second * n.z * n.x,
          zonal * (3 * n.z * n.z - 1),
          second / 2 * (n.x * n.x - n.y * n.y)};
}

glm::vec3 unit(const cl_float4& v) {
  const glm::vec3 n(v.s[0], v.s[1], v.s[2]);
  const float length = glm::length(n);
  return length > 0 ? n / length : n;
}

}  // namespace

LightFit::LightFit(const WeighedTarget& target, std::span<const std::size_t> shown,
                   const HypothesisImages& images)
    : target_(target), shown_(shown) {
  const auto pixels = static_cast<Eigen::Index>(shown.size());
  for (int c = 0; c < 3; ++c) terms_[static_cast<std::size_t>(c)] = terms(images, c);
  wanted_.resize(pixels, 3);
  residuals_.resize(pixels, 3);
  weights_.resize(pixels);
  for (Eigen::Index i = 0; i < pixels; ++i) {
    const std::size_t pixel = shown[static_cast<std::size_t>(i)];
    const float behind = 1 - images.colors[pixel].s[3];
    weights_[i] = target.weights[pixel];
    for (int c = 0; c < 3; ++c) wanted_(i, c) = target.colors[pixel].s[c] - behind * target.background[c];
  }
  solve();
  weigh();
  if (target.inverse_scale_squared <= 0) return;
  for (int i = 0; i < k_most_reweightings; ++i) {
    const double before = loss_;
    solve();
    weigh();
    if (loss_ > (1 - k_least_fall) * before) break;
  }
}

Eigen::MatrixXf LightFit::terms(const HypothesisImages& images, int channel) const {
  const Eigen::Index directional = images.normals != nullptr ? Eigen::Index{k_harmonics} : 1;
  Eigen::MatrixXf result(static_cast<Eigen::Index>(shown_.size()), directional + 1);
  for (Eigen::Index i = 0; i < result.rows(); ++i) {
    const std::size_t pixel = shown_[static_cast<std::size_t>(i)];
    const cl_float4& color = images.colors[pixel];
    result(i, 0) = color.s[channel];
    if (images.normals != nullptr) {
      const auto basis = harmonics(unit(images.normals[pixel]));
      for (Eigen::Index k = 1; k < Eigen::Index{k_harmonics}; ++k)
        result(i, k) = color.s[channel] * basis[static_cast<std::size_t>(k)];
    }
    result(i, directional) = color.s[3];
  }
  return result;
}

void LightFit::solve() {
  for (int c = 0; c < 3; ++c) solve(c);
}

void LightFit::solve(int channel) {
  const auto c = static_cast<std::size_t>(channel);
  const Eigen::MatrixXf weighed = weights_.matrix().asDiagonal() * terms_[c];
  Eigen::MatrixXd normal = (weighed.transpose() * terms_[c]).cast<double>();
  const Eigen::VectorXd right = (weighed.transpose() * wanted_.col(channel)).cast<double>();
  const Eigen::Index last = normal.rows() - 1;
  // A channel in which nothing is seen has no light: what is added keeps the matrix invertible.
  constexpr double k_least = 1e-6;
  Eigen::VectorXd prior = Eigen::VectorXd::Constant(last + 1, k_least * normal(last, last) + 1e-20);
  const double part = k_prior_pixels / std::max(normal(last, last), k_prior_pixels);
  prior.segment(1, last - 1).array() += part * normal(0, 0);
  prior[last] += part * normal(last, last);
  normal.diagonal() += prior;
  inverse_[c] = normal.llt().solve(Eigen::MatrixXd::Identity(last + 1, last + 1));
  light_[c] = inverse_[c] * right;
  if ((weighed * light_[c].cast<float>()).sum() < 0) light_[c].setZero();  // light takes nothing away
  prior_loss_[c] = light_[c].cwiseAbs2().dot(prior);
  residuals_.col(channel) = terms_[c] * light_[c].cast<float>() - wanted_.col(channel);
}

void LightFit::weigh() {
  const float inverse = target_.inverse_scale_squared;
  loss_ = prior_loss_[0] + prior_loss_[1] + prior_loss_[2];
  for (Eigen::Index i = 0; i < weights_.size(); ++i) {
    const float weight = target_.weights[shown_[static_cast<std::size_t>(i)]];
    const float squared = residuals_.row(i).squaredNorm();
    const float slope = 1 / (1 + squared * inverse);
    loss_ += static_cast<double>(weight * squared * slope);
    weights_[i] = weight * slope * slope;
  }
}

float LightFit::deviation() const {
  std::vector<float> sizes(static_cast<std::size_t>(residuals_.size()));
  Eigen::Map<Eigen::MatrixX3f>(sizes.data(), residuals_.rows(), 3) = residuals_.cwiseAbs();
  return robust_deviation(sizes);
}

Eigen::VectorXf LightFit::difference(const HypothesisImages& moved, int channel) const {
  const auto c = static_cast<std::size_t>(channel);
  const Eigen::MatrixXf there = terms(moved, channel);
  // The background shows where the object does not.
  return (there - terms_[c]) * light_[c].cast<float>() -
         target_.background[channel] * (there.rightCols<1>() - terms_[c].rightCols<1>());
}

Eigen::MatrixXf LightFit::project(const Eigen::MatrixXf& jacobian, int channel) const {
  const auto c = static_cast<std::size_t>(channel);
  const Eigen::MatrixXd taken =
      inverse_[c] * (terms_[c].transpose() * (weights_.matrix().asDiagonal() * jacobian)).cast<double>();
  return jacobian - terms_[c] * taken.cast<float>();
}

float robust_deviation(std::span<float> sizes) {
  constexpr float k_normal = 1.4826F;
  if (sizes.empty()) return 0;
  const auto middle = sizes.begin() + std::ssize(sizes) / 2;
  std::ranges::nth_element(sizes, middle);
  return k_normal * *middle;
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

Mesh colored_by_normals(const Mesh& mesh, const glm::dmat3& stretch, CornerNormals normals) {
  const std::vector<glm::dvec3> of_corners =
      mesh.face_normals.empty() ? normals_of_faces(mesh, stretch, normals) : given_normals(mesh, stretch);
  Mesh result;
  for (const glm::uvec3& f : mesh.faces) {
    const auto first = static_cast<unsigned>(result.positions.size());
    result.faces.emplace_back(first, first + 1, first + 2);
    for (int k = 0; k < 3; ++k) {
      const glm::dvec3& normal = of_corners[result.positions.size()];
      const double length = glm::length(normal);
      result.positions.push_back(mesh.positions[f[k]]);
      result.vertex_colors.emplace_back(length > 0 ? normal / length : normal);
    }
  }
  return result;
}

}  // namespace dpr
