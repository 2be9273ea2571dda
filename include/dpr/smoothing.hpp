// What is random in the perturbed renderer, how strongly, and how its expectation is computed.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace dpr {

/// Distribution of the noise. The values are shared with the kernels (kernels/shared_types.h).
enum class Prior { gaussian, cauchy, logistic, gumbel, uniform };

/// How occupancy and depth combine. barrier: the paper's b = zeta + (gamma / alpha) ln p, eq. (7), (10).
/// joint: the expectation of the rigid image when distances and depths are both perturbed; alpha has no part
/// in it.
enum class Composition { barrier, joint };

/// exact: closed form or quadrature, no variance. monte_carlo: `samples` draws, eq. (11)-(16).
enum class Estimator { exact, monte_carlo };

/// Control variate of the sampled gradients: what is subtracted from every sample. rigid: the unperturbed
/// solution, eq. (14). leave_one_out: the mean of the other samples.
enum class VarianceReduction { none, rigid, leave_one_out };

/// How the samples' noise is drawn. The values are shared with the kernels (kernels/shared_types.h).
/// antithetic: in pairs, z and -z. stratified: a Latin hypercube, each variable once in each of `samples`
/// strata of equal probability.
enum class Draws { independent, antithetic, stratified };

/// Unit of the signed distance, of sigma and of the blur radius: NDC^2 with the sign attached, or NDC.
enum class DistanceMetric { squared, euclidean };

struct Smoothing {
  Prior occupancy_prior = Prior::gaussian;
  Prior depth_prior = Prior::gaussian;
  float sigma = 1e-3F;  ///< > 0, scale of the distance noise, in the unit of the metric
  float gamma = 1e-2F;  ///< > 0, scale of the depth noise; depth is normalised to 1 at znear, 0 at zfar
  float alpha = 1.0F;   ///< > 0, weight of the barrier
  Composition composition = Composition::barrier;
  Estimator occupancy_estimator = Estimator::exact;
  Estimator aggregation_estimator = Estimator::exact;
  std::uint32_t samples = 8;  ///< 1 to 2^20, of Monte Carlo
  VarianceReduction variance_reduction = VarianceReduction::rigid;
  Draws draws = Draws::independent;
  std::uint64_t seed = 1;  ///< the noise is a pure function of seed, view, pixel, face, sample and stage
  float occupancy_threshold = 1e-4F;  ///< in (0, 0.5): sets the blur radius where none is given
  std::optional<float>
      blur_radius;                  ///< >= 0, in the unit of the metric: triangles further away are not there
  float background_depth = 1e-10F;  ///< normalised depth of the background slot (barrier only)
  DistanceMetric distance = DistanceMetric::squared;
};

/// Throws InvalidArgument for a value out of range, and for what has no estimator: sampling with the uniform
/// prior (its density is no exp(-nu), so it has no score), one sampled and one exact stage in the joint
/// composition, uniform depths, and exact Cauchy depths in the joint composition. Of what is sampled:
/// - antithetic draws need symmetric priors, so not Gumbel's, and an even number of samples;
/// - leave_one_out needs at least 2 samples; with antithetic draws 4, since it leaves out the pair: the other
///   half's value is correlated with the score;
/// - leave_one_out with stratified draws is refused: every other sample's stratum tells of one's own, which
///   biases the gradient.
void validate(const Smoothing& smoothing);

/// The blur radius in force: `blur_radius`, or the distance at which the occupancy has fallen to
/// `occupancy_threshold`: sigma times the prior's quantile at 1 - threshold. The Cauchy prior's tail is so
/// heavy that its radius is capped at 100 sigma, where p = 1/2 - atan(100)/pi = 3.18e-3: a threshold below
/// that has no effect there.
float blur_radius(const Smoothing& smoothing);

/// The rigid renderer itself, for targets and references: no blur, the nearest triangle wins.
Smoothing rigid_smoothing();

/// A named member of the family; throws InvalidArgument for another name. What is not said is the default
/// above.
/// - "softras": logistic occupancy, Gumbel depth, exact; blur radius 9.21 sigma, where the logistic p is 1e-4
/// - "paper_gaussian", "paper_cauchy": both stages of one prior, sampled 8 times, rigid variance reduction,
///   blur radius 9.21 sigma: the published program
/// - "joint_gaussian": the joint composition, exact
/// - "rigid": rigid_smoothing()
Smoothing smoothing_preset(std::string_view name);

std::string_view to_string(Prior);
std::string_view to_string(Composition);
std::string_view to_string(Estimator);
std::string_view to_string(VarianceReduction);
std::string_view to_string(Draws);
std::string_view to_string(DistanceMetric);

/// The inverse of to_string; `where` names the argument in the InvalidArgument thrown for an unknown word.
Prior parse_prior(std::string_view word, std::string_view where);
Composition parse_composition(std::string_view word, std::string_view where);
Estimator parse_estimator(std::string_view word, std::string_view where);
VarianceReduction parse_variance_reduction(std::string_view word, std::string_view where);
Draws parse_draws(std::string_view word, std::string_view where);
DistanceMetric parse_distance_metric(std::string_view word, std::string_view where);

}  // namespace dpr
