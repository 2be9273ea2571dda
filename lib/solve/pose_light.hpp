// The light that a hypothesis is seen in: linear in what its image is made of, so that the best one is known
// in closed form.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "device/opencl_bindings.hpp"
#include "dpr/mesh.hpp"

namespace dpr {

/// Images of a hypothesis from which its light is found.
struct HypothesisImages {
  const cl_float4* colors = nullptr;  ///< without light, over black; alpha is the coverage
  const cl_float4* normals =
      nullptr;  ///< as colours, object space, over black; null: light without direction
};

/// A level's target: colours and weights of its pixels.
struct WeighedTarget {
  std::vector<cl_float4> colors;
  std::vector<float> weights;  ///< in [0, 1]
  glm::vec3 background{0.0F};
  float inverse_scale_squared = 0;  ///< of the robust loss; 0: squares
};

/// The light that explains the target best at the pixels that show the object, and what it leaves.
/// A pixel of coverage a, colour c and unit normal n is modelled in each channel as
///   c sum_k l_k Y_k(n) + o a + background (1 - a),
/// Y being the real spherical harmonics up to the second order, nine that hold the irradiance of any distant
/// light (Ramamoorthi & Hanrahan 2001), or the first of them alone; o is reflected whatever the colour.
/// Rotations map the harmonics of an order onto themselves: the object's own normals will do. A prior holds
/// the light's directional part and o near 0 where the picture says little of them.
class LightFit {
 public:
  /// All must outlive the fit. `shown`: pixels to look at.
  LightFit(const WeighedTarget& target, std::span<const std::size_t> shown, const HypothesisImages& images);

  /// The sum over pixels and channels of the loss, with the prior's.
  double loss() const { return loss_; }
  /// 1.4826 times the median of the residuals' sizes: their standard deviation if they were normal but for
  /// outliers.
  float deviation() const;
  /// The light's even part in a channel, and what is reflected whatever the colour.
  double gain(int channel) const { return light_[static_cast<std::size_t>(channel)][0]; }
  double offset(int channel) const { return light_[static_cast<std::size_t>(channel)].tail<1>()[0]; }
  /// [pixel][channel] image in its light minus target.
  const Eigen::MatrixX3f& residuals() const { return residuals_; }
  /// [pixel] of the squares that have the robust loss's derivative here.
  const Eigen::ArrayXf& weights() const { return weights_; }
  /// [pixel] another hypothesis in this light, minus this one.
  Eigen::VectorXf difference(const HypothesisImages& moved, int channel) const;
  /// Derivatives of the image by parameters [pixel][parameter] without what a change of the light makes up
  /// for. The light being at its best, they are those of the residuals (variable projection: Golub & Pereyra
  /// 1973, in the approximation of Kaufman 1975).
  Eigen::MatrixXf project(const Eigen::MatrixXf& jacobian, int channel) const;

 private:
  Eigen::MatrixXf terms(const HypothesisImages& images, int channel) const;
  void solve();
  void solve(int channel);
  void weigh();

  const WeighedTarget& target_;
  std::span<const std::size_t> shown_;
  std::array<Eigen::MatrixXf, 3> terms_;  // [pixel][term]
  Eigen::MatrixX3f wanted_, residuals_;
  std::array<Eigen::VectorXd, 3> light_;
  std::array<Eigen::MatrixXd, 3> normal_, inverse_;  // of the light's least squares, the prior included
  std::array<double, 3> prior_loss_{};
  Eigen::ArrayXf weights_;
  double loss_ = 0;
};

/// The same of residuals' sizes, which come out in another order; 0 of none.
float robust_deviation(std::span<float> sizes);

/// Normals of corners where the mesh gives none: the mean over those faces at their vertex that
/// no sharp edge parts from theirs, or over all.
enum class CornerNormals { parted, smooth };

/// The mesh with a corner of its own for each corner of each face, coloured by its unit normal after
/// `stretch`.
Mesh colored_by_normals(const Mesh& mesh, const glm::dmat3& stretch, CornerNormals normals);

}  // namespace dpr
