// Smoothing of the perturbed renderer: its noise, the noise's scales, and the estimator of the expectation.
#pragma once

#include <concepts>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "dpr/export.h"

namespace dpr {

/// Distribution of the noise. What the library knows of each is a row of lib/smoothing/priors.cpp.
enum class Prior { gaussian, cauchy, logistic, gumbel, uniform };

/// Combination of occupancy and depth. barrier: the paper's b = zeta + (gamma / alpha) ln p, eq. (7), (10).
/// joint: the expectation of the rigid image when distances and depths are both perturbed; alpha has no part
/// in it.
enum class Composition { barrier, joint };

/// Noise that moves edges. triangle: every triangle's distances have noise of their own, so the image
/// depends on how a surface is cut into triangles. pixel: the pixel's position has, in two dimensions, the
/// same for all triangles: the rigid image, whose depths alone are perturbed, is convolved with the density
/// of that noise. The image is the same for every tessellation of a surface, and its cost does not depend on
/// sigma.
enum class Noise { triangle, pixel };

/// exact: closed form or quadrature, no variance. monte_carlo: `samples` draws, eq. (11)-(16). With noise of
/// the pixel the occupancy's estimator is that of its position: monte_carlo is the mean of `samples` rigid
/// frames, each shifted by a draw that all pixels of a view share, in whole samples of the raster (so that it
/// is rendered once, and a sample costs a shift of it). Gradients are those of the shifted frames; that by
/// sigma is a score estimate.
enum class Estimator { exact, monte_carlo };

/// Control variate of the sampled gradients: what is subtracted from every sample. rigid: the unperturbed
/// solution, eq. (14). leave_one_out: the mean of the other samples.
enum class VarianceReduction { none, rigid, leave_one_out };

/// Way the samples' noise is drawn. The values are shared with the kernels (kernels/shared_types.h).
/// antithetic: in pairs, z and -z. stratified: a Latin hypercube, each variable once in each of `samples`
/// strata of equal probability.
enum class Draws { independent, antithetic, stratified };

/// Unit of the signed distance, of sigma and of the blur radius: NDC^2 with the sign attached, or NDC.
enum class DistanceMetric { squared, euclidean };

/// Width of the distance noise. fixed: sigma. variable, for the uniform prior: for every pixel the distance
/// between it and the edge, so that the noise just reaches the pixel. The image is the rigid one (to 1e-6 a
/// fragment: an occupancy of 0 would have no gradient), dp/ds = 1 / (|s| + sigma), and sigma only keeps that
/// finite. zero: no distance noise, p = H(s), eq. (1); sigma has no part in it. A sample on an edge belongs
/// to the triangle whose left or upper edge it is. The values are shared with the kernels
/// (kernels/shared_types.h).
enum class OccupancyWidth { fixed, variable, zero };

/// The default is the preset "pixel".
struct Smoothing {
  Prior occupancy_prior = Prior::gaussian;
  Prior depth_prior = Prior::gaussian;
  float sigma = 1e-3F;  ///< > 0, scale of the distance noise, in the unit of the metric
  float gamma = 1e-4F;  ///< > 0, scale of the depth noise; depth is normalised to 1 at znear, 0 at zfar
  float alpha = 1.0F;   ///< > 0, weight of the barrier
  Composition composition = Composition::joint;
  Estimator occupancy_estimator = Estimator::exact;
  Estimator aggregation_estimator = Estimator::exact;
  std::uint32_t samples = 8;  ///< 1 to 2^20, of Monte Carlo
  VarianceReduction variance_reduction = VarianceReduction::leave_one_out;
  Draws draws = Draws::independent;
  std::uint64_t seed = 1;  ///< the noise is a pure function of seed, view, pixel, face, sample and stage
  float occupancy_threshold = 1e-4F;  ///< in (0, 0.5): sets the blur radius where none is given
  std::optional<float>
      blur_radius;                  ///< >= 0, in the unit of the metric: triangles further away are not there
  float background_depth = 1e-10F;  ///< normalised depth of the background slot (barrier only)
  DistanceMetric distance = DistanceMetric::squared;
  OccupancyWidth occupancy_width = OccupancyWidth::fixed;
  Noise noise = Noise::pixel;
  std::uint32_t supersampling = 1;  ///< 1, 2 or 4: samples of a pixel along each axis, of its noise

  bool operator==(const Smoothing&) const = default;
};

/// Throws InvalidArgument for a value out of range, and for what has no estimator: sampling with the uniform
/// prior (its density is no exp(-nu), so it has no score), and one sampled and one exact stage in the joint
/// composition.
/// - A variable width needs the uniform prior, the exact estimator, Euclidean distances, the joint
///   composition (in the barrier an occupancy of nearly 0 still has weight) and a blur_radius (no occupancy
///   says where such noise ends). A width of zero needs the exact estimator.
/// - Antithetic draws need symmetric priors, so not Gumbel's, and an even number of samples.
/// - leave_one_out needs at least 2 samples; with antithetic draws 4, since it leaves out the pair: the other
///   half's value is correlated with the score. With stratified draws it is refused: every other sample's
///   stratum tells of one's own, which biases the gradient.
/// - Noise of the pixel needs a symmetric occupancy_prior, so not Gumbel's (it would shift the image), a
///   fixed width and no blur_radius: no triangle is blurred. Its scale is sigma with Euclidean distances,
///   else the root of sigma, NDC; the occupancy_threshold has no part in it. Each stage may be sampled by
///   itself, whatever the composition, and the position with the uniform prior too: its draws are whole
///   samples, whose probabilities have a score. `supersampling` is of the pixel's noise alone.
DPR_API void validate(const Smoothing& smoothing);

/// The blur radius in force: `blur_radius`, or the distance at which the occupancy has fallen to
/// `occupancy_threshold`: sigma times the prior's quantile at 1 - threshold. The Cauchy prior's tail is so
/// heavy that its radius is capped at 100 sigma, where p = 1/2 - atan(100)/pi = 3.18e-3: a threshold below
/// that has no effect there.
/// With noise of the pixel it is 0.
DPR_API float blur_radius(const Smoothing& smoothing);

/// Sets sigma; a blur radius, where there is one, stays the same number of sigmas. With a variable width it
/// stays as it is: there sigma is no width, but what keeps the derivative at an edge finite.
DPR_API void set_sigma(Smoothing& smoothing, float sigma);

/// True if either stage draws samples.
DPR_API bool is_sampled(const Smoothing& smoothing);

/// The rigid renderer itself, for targets and references: no blur, the nearest triangle wins, and of
/// triangles that share an edge exactly one covers a sample on it.
DPR_API Smoothing rigid_smoothing();

/// A named member of the family; throws InvalidArgument for another name and for a size below 1x1. What is
/// not said of a member of the triangles' noise is that of "gaussian". Equations in brackets are the paper's;
/// tests/pipeline/presets_test.cpp evaluates each formula by itself.
/// - "softras" (Liu et al. 2019): logistic occupancy, Gumbel depth, exact, which by (21) and (40) is
///   D_j = sigmoid(s_j / sigma), w_j = D_j exp(zeta_j / gamma) / (sum_k D_k exp(zeta_k / gamma) +
///   exp(background_depth / gamma)); blur radius 9.21 sigma, where D is 1e-4
/// - "opendr" (Loper & Black 2014): uniform occupancy one pixel wide, (30): p = clamp(d / pixel + 1/2, 0, 1)
///   with d in NDC and the pixel of an image of `width` x `height`; rigid depths. Images of other sizes need
///   another sigma, 2 / min(width, height)
/// - "nmr" (Kato, Ushiku & Harada 2018, section 3.2): uniform occupancy of variable width, (30). The image is
///   rigid; moving an edge by the distance d between it and a pixel changes the pixel by delta I, so the
///   derivative is taken as delta I / d, with the published 1e-3 NDC (sigma) added to |d|; rigid depths;
///   reaches 0.5 NDC (blur_radius), where the published program goes on to the border. Theirs has two rules
///   that no perturbation explains, and which are left out: gradients that would raise the loss are dropped,
///   and delta I at an edge that two triangles share is the difference of the two
/// - "paper_gaussian" (36), "paper_cauchy" (35): both stages of one prior, sampled 8 times as in (11) and
///   (14), blur radius 9.21 sigma: the published program
/// - "gaussian": Gaussian noise of the triangles in the barrier, exact: (36), (10); sigma 1e-3, gamma 1e-2
/// - "joint_gaussian": the joint composition, exact: the expectation of (3) under (8)
/// - "pixel": the default above, Gaussian noise of the pixel's position, joint composition, exact; gamma is
///   1e-4, so that what lies a thousandth of the depth range behind is not seen
/// - "rigid": rigid_smoothing()
DPR_API Smoothing smoothing_preset(std::string_view name, int width = 128, int height = 128);

/// The presets' names, in the order above.
DPR_API std::vector<std::string_view> smoothing_preset_names();

/// The enumerations whose values have names in files, on the command line and in messages.
template <typename Type>
concept SmoothingChoice = std::same_as<Type, Prior> || std::same_as<Type, Composition> ||
    std::same_as<Type, Estimator> || std::same_as<Type, VarianceReduction> || std::same_as<Type, Draws> ||
    std::same_as<Type, DistanceMetric> || std::same_as<Type, OccupancyWidth> || std::same_as<Type, Noise>;

/// "gaussian", "leave_one_out" and so on; empty for what is no value of the enumeration.
template <SmoothingChoice Choice>
DPR_API std::string_view to_string(Choice value);

/// The inverse; `where` names the argument in the InvalidArgument thrown for an unknown word.
template <SmoothingChoice Choice>
DPR_API Choice parse_choice(std::string_view word, std::string_view where);

/// All values, in the order of their declaration.
template <SmoothingChoice Choice>
DPR_API std::vector<Choice> choices();

}  // namespace dpr
