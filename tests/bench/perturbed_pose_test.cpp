// The perturbed pose: the score estimator against quadrature for every prior, baseline and kind of draws; the
// rigid renderer's expected loss and its derivatives against quadrature over one parameter; a pose found with
// it.
#include "experiments/pose/perturbed_pose.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "dpr/error.hpp"
#include "dpr/optimizer.hpp"
#include "dpr/pose.hpp"
#include "experiments/pose/score_estimator.hpp"
#include "reference/priors.hpp"
#include "smoothing/priors.hpp"
#include "support/messages.hpp"
#include "support/priors.hpp"
#include "support/reduced.hpp"
#include "support/rigid_image.hpp"

namespace perturbed_pose_test {

using namespace dpr;
using namespace dpr::bench;
using dpr::test::reduced;
using dpr::test::rigid_image;

namespace {

/// How many standard errors a mean may be away: for a right estimator once in 16,000 figures.
constexpr double k_standard_errors = 4;

reference::Prior to_reference(Prior prior) { return static_cast<reference::Prior>(prior); }

/// E[g(Z)] by the trapezoidal rule in t with z = sinh(t), which heavy tails do not spoil.
double expectation(Prior prior, const std::function<double(double)>& g) {
  constexpr double k_reach = 30, k_step = 1.0 / 64;
  double sum = 0;
  for (double t = -k_reach; t <= k_reach; t += k_step) {
    const double z = std::sinh(t), weight = reference::density(to_reference(prior), z) * std::cosh(t);
    if (weight > 0) sum += k_step * weight * g(z);
  }
  return sum;
}

/// f(x) = prod_k (1 + a_k tanh(x_k)): smooth, bounded, and its expectation is a product of one-dimensional
/// ones.
struct Product {
  std::vector<double> theta{0.3, -0.5, 0.8, 0.1, -0.2, 0.6}, scale{0.5, 0.9, 0.3, 0.7, 1.1, 0.4},
      a{0.6, -0.5, 0.7, 0.4, -0.6, 0.5};

  std::size_t dimensions() const { return theta.size(); }
  double factor(std::size_t k, double x) const { return 1 + a[k] * std::tanh(x); }
  double slope(std::size_t k, double x) const {
    return a[k] / std::pow(std::cosh(std::min(std::abs(x), 300.0)), 2);
  }
  double operator()(const double* noise) const {
    double product = 1;
    for (std::size_t k = 0; k < dimensions(); ++k) product *= factor(k, theta[k] + scale[k] * noise[k]);
    return product;
  }
};

struct Figures {
  double value = 0;
  std::vector<double> gradient;  // for theta / scale
  double sensitivity = 0;

  std::vector<double> all() const {
    std::vector<double> list{value, sensitivity};
    list.insert(list.end(), gradient.begin(), gradient.end());
    return list;
  }
};

Figures exact_figures(const Product& f, Prior prior) {
  std::vector<double> mean, slope, growth;
  for (std::size_t k = 0; k < f.dimensions(); ++k) {
    const auto at = [&](double z) { return f.theta[k] + f.scale[k] * z; };
    mean.push_back(expectation(prior, [&](double z) { return f.factor(k, at(z)); }));
    slope.push_back(expectation(prior, [&](double z) { return f.scale[k] * f.slope(k, at(z)); }));
    growth.push_back(expectation(prior, [&](double z) { return f.scale[k] * z * f.slope(k, at(z)); }));
  }
  Figures exact{1, {}, 0};
  for (const double m : mean) exact.value *= m;
  for (std::size_t k = 0; k < f.dimensions(); ++k) {
    exact.gradient.push_back(exact.value / mean[k] * slope[k]);
    exact.sensitivity += exact.value / mean[k] * growth[k];
  }
  return exact;
}

std::vector<double> values_of(const Product& f, const std::vector<double>& noise) {
  std::vector<double> values;
  for (std::size_t i = 0; i < noise.size(); i += f.dimensions()) values.push_back(f(noise.data() + i));
  return values;
}

/// Means of many estimates, with standard errors.
class Statistics {
 public:
  void add(const std::vector<double>& figures) {
    mean_.resize(figures.size());
    squares_.resize(figures.size());
    ++count_;
    for (std::size_t i = 0; i < figures.size(); ++i) {
      const double change = figures[i] - mean_[i];
      mean_[i] += change / count_;
      squares_[i] += change * (figures[i] - mean_[i]);
    }
  }
  double mean(std::size_t i) const { return mean_[i]; }
  double deviation(std::size_t i) const { return std::sqrt(squares_[i] / (count_ - 1)); }
  double standard_error(std::size_t i) const { return deviation(i) / std::sqrt(count_); }
  /// |mean - expected| in standard errors.
  double distance(std::size_t i, double expected) const {
    return std::abs(mean_[i] - expected) / standard_error(i);
  }

 private:
  std::vector<double> mean_, squares_;
  double count_ = 0;
};

std::vector<double> figures_of(const ScoreEstimate& e) {
  std::vector<double> list{e.value.value, e.sensitivity.value};
  for (const Estimate& g : e.gradient) list.push_back(g.value);
  return list;
}

bool is_allowed(const NoiseOptions& options) {
  try {
    validate(options);
  } catch (const InvalidArgument&) {
    return false;
  }
  return true;
}

Scene cube_scene(int size) {
  Scene scene;
  scene.width = scene.height = size;
  scene.camera = orbit_camera(6.7F, 30, 120);
  scene.meshes.push_back({make_cube(), glm::mat4(1.0F)});
  return scene;
}

/// The rigid loss along one parameter, tabulated: x at the cells' middles.
struct Table {
  double reach = 6;  // of Gaussian noise, in scales
  std::vector<double> losses;

  double noise(std::size_t i) const {
    return reach * (2 * (static_cast<double>(i) + 0.5) / static_cast<double>(losses.size()) - 1);
  }
  double mean(const std::function<double(double)>& weight) const {
    double sum = 0, mass = 0;
    for (std::size_t i = 0; i < losses.size(); ++i) {
      const double z = noise(i), density = std::exp(-0.5 * z * z);
      sum += density * losses[i] * weight(z);
      mass += density;
    }
    return sum / mass;
  }
};

Table tabulate(const Device& device, Scene scene, const Image& target, const PoseParameters& scale) {
  constexpr std::size_t k_batch = 250;
  Table table;
  table.losses.resize(static_cast<std::size_t>(reduced(4000, 250)));
  scene.smoothing = rigid_smoothing();
  Renderer renderer(device);
  renderer.set_scene(scene);
  const View start = renderer.views().front();
  ImageLoss loss(device, LossWeights::only(LossKind::mse), std::vector<Image>(k_batch, target));
  for (std::size_t first = 0; first < table.losses.size(); first += k_batch) {
    std::vector<View> views;
    for (std::size_t i = first; i < first + k_batch; ++i) {
      PoseParameters step = scale;
      step.mesh_rotation *= table.noise(i);
      step.camera_translation *= table.noise(i);
      step.fov_y_degrees *= table.noise(i);
      views.push_back(moved(start, 0, step));
    }
    renderer.set_views(views);
    renderer.forward();
    loss.evaluate(renderer);
    std::ranges::copy(loss.per_view(), table.losses.begin() + static_cast<std::ptrdiff_t>(first));
  }
  return table;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("the host's Philox gives the published known answers") {
    using Words = std::array<std::uint32_t, 4>;
    CHECK(philox4x32_10({0, 0, 0, 0}, {0, 0}) == Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8});
    const std::uint32_t ones = 0xffffffff;
    CHECK(philox4x32_10({ones, ones, ones, ones}, {ones, ones}) ==
          Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd});
  }

  TEST_CASE("quantiles and scores of the priors, in double precision") {
    for (const Prior prior : dpr::test::k_sampled_priors) {
      CAPTURE(to_string(prior));
      for (const double u : {1e-15, 1e-6, 0.01, 0.3, 0.5, 0.6, 0.999, 1 - 1e-9}) {
        const double x = quantile(prior, u);
        CHECK(std::exp(reference::log_cdf(to_reference(prior), x)) == doctest::Approx(u).epsilon(1e-12));
        CHECK(row_of(prior).score(x) ==
              doctest::Approx(reference::score(to_reference(prior), x)).epsilon(1e-14));
      }
    }
  }

  TEST_CASE("noise is a function of seed, sample and dimension") {
    NoiseOptions few{.draws = Draws::independent, .samples = 8, .seed = 3};
    NoiseOptions many = few;
    many.samples = 32;
    const std::vector<double> a = draw_noise(few, 2), b = draw_noise(many, 5);
    for (std::size_t m = 0; m < 8; ++m) {
      for (std::size_t k = 0; k < 2; ++k) CHECK(a[2 * m + k] == b[5 * m + k]);
    }
    few.seed = 4;
    CHECK(draw_noise(few, 2) != a);
    few.seed = 3 + (std::uint64_t{1} << 40U);
    CHECK(draw_noise(few, 2) != a);
  }

  TEST_CASE("antithetic draws come in mirrored pairs, stratified ones fill every stratum once") {
    const std::vector<double> pairs = draw_noise({.draws = Draws::antithetic, .samples = 6}, 3);
    for (std::size_t m = 0; m < 6; m += 2) {
      for (std::size_t k = 0; k < 3; ++k) CHECK(pairs[3 * m + k] == -pairs[3 * (m + 1) + k]);
    }
    CHECK(pairs[0] != pairs[6]);
    const std::vector<double> strata = draw_noise(
        {.variance_reduction = VarianceReduction::none, .draws = Draws::stratified, .samples = 16}, 3);
    for (std::size_t k = 0; k < 3; ++k) {
      std::vector<bool> seen(16);
      for (std::size_t m = 0; m < 16; ++m) {
        const double u = reference::cdf(reference::Prior::gaussian, strata[3 * m + k]);
        seen[static_cast<std::size_t>(u * 16)] = true;
      }
      CHECK(std::ranges::count(seen, true) == 16);
    }
  }

  TEST_CASE("a view is moved in the chart of its gradients") {
    View view{orbit_camera(5, 20, 30), {glm::mat4(1.0F), glm::mat4(1.0F)}};
    view.transforms[1][3] = {1, 2, 3, 1};
    const View same = moved(view, 1, {});
    CHECK(same.transforms == view.transforms);
    const View turned =
        moved(view, 1, {.mesh_rotation = {0, 0, glm::radians(90.0)}, .mesh_translation = {1, 0, 0}});
    CHECK(turned.transforms[0] == view.transforms[0]);
    CHECK(glm::length(turned.transforms[1][0] - glm::vec4(0, 1, 0, 0)) < 1e-6F);
    CHECK(turned.transforms[1][3] == glm::vec4(2, 2, 3, 1));  // the column is not turned
    CHECK(moved(view, 0, {.fov_y_degrees = 1e6}).camera.fov_y_degrees < 180);
    CHECK(moved(view, 0, {.fov_y_degrees = -1e6}).camera.fov_y_degrees > 0);
  }
}

TEST_SUITE("statistical") {
  TEST_CASE("value, gradient and sensitivity of every estimator against quadrature, six dimensions") {
    const Product f;
    const int runs = 4000;
    double worst = 0;
    for (const Prior prior : dpr::test::k_sampled_priors) {
      const std::vector<double> exact = exact_figures(f, prior).all();
      for (const VarianceReduction baseline :
           {VarianceReduction::none, VarianceReduction::rigid, VarianceReduction::leave_one_out}) {
        for (const Draws draws : {Draws::independent, Draws::antithetic, Draws::stratified}) {
          NoiseOptions options{prior, baseline, draws, 8, 0};
          if (!is_allowed(options)) continue;
          const std::vector<double> zero(f.dimensions());
          Statistics statistics;
          for (int run = 0; run < runs; ++run) {
            options.seed = static_cast<std::uint64_t>(run);
            const std::vector<double> noise = draw_noise(options, f.dimensions());
            statistics.add(figures_of(estimate(options, values_of(f, noise), noise, f(zero.data()))));
          }
          for (std::size_t i = 0; i < exact.size(); ++i) {
            CAPTURE(to_string(prior));
            CAPTURE(static_cast<int>(baseline));
            CAPTURE(static_cast<int>(draws));
            CAPTURE(i);
            CHECK(statistics.distance(i, exact[i]) < k_standard_errors);
            worst = std::max(worst, statistics.distance(i, exact[i]));
          }
        }
      }
    }
    MESSAGE("worst: " << worst << " standard errors");
  }

  TEST_CASE("a sensitivity with -1 in place of -d fails, and so does leaving out one sample of a pair") {
    const Product f;
    const double exact = exact_figures(f, Prior::gaussian).sensitivity;
    const double rigid = f(std::vector<double>(f.dimensions()).data());
    NoiseOptions options{Prior::gaussian, VarianceReduction::rigid, Draws::antithetic, 4, 0};
    Statistics wrong_constant, half_pair, right;
    for (int run = 0; run < 4000; ++run) {
      options.seed = static_cast<std::uint64_t>(run);
      const std::vector<double> noise = draw_noise(options, f.dimensions());
      const std::vector<double> values = values_of(f, noise);
      double mean = 0;
      for (const double v : values) mean += v / 4;
      const double found = estimate(options, values, noise, rigid).sensitivity.value;
      right.add({found});
      wrong_constant.add({found + static_cast<double>(f.dimensions() - 1) * (mean - rigid)});
      // The mean of the three others as a baseline, the mirrored sample among them.
      NoiseOptions single = options;
      single.variance_reduction = VarianceReduction::leave_one_out;
      single.draws = Draws::independent;
      half_pair.add({estimate(single, values, noise, rigid).sensitivity.value});
    }
    CHECK(right.distance(0, exact) < k_standard_errors);
    CHECK(wrong_constant.distance(0, exact) > 2 * k_standard_errors);
    CHECK(half_pair.distance(0, exact) > 2 * k_standard_errors);
  }

  TEST_CASE("leave-one-out over stratified draws would be biased") {
    // Stratified draws are refused: the mean of the others knows which stratum is left.
    const Product f;
    const std::vector<double> exact = exact_figures(f, Prior::gaussian).all();
    Statistics biased;
    for (int run = 0; run < 4000; ++run) {
      NoiseOptions options{Prior::gaussian, VarianceReduction::none, Draws::stratified, 4,
                           static_cast<std::uint64_t>(run)};
      const std::vector<double> noise = draw_noise(options, f.dimensions());
      options.draws = Draws::independent;
      options.variance_reduction = VarianceReduction::leave_one_out;
      biased.add(figures_of(estimate(options, values_of(f, noise), noise, 0)));
    }
    double worst = 0;
    for (std::size_t i = 1; i < exact.size(); ++i) worst = std::max(worst, biased.distance(i, exact[i]));
    CHECK(worst > 2 * k_standard_errors);
  }

  TEST_CASE(
      "the standard errors are those that repeated estimates have; of stratified draws at least those") {
    const Product f;
    for (const Draws draws : {Draws::independent, Draws::antithetic, Draws::stratified}) {
      NoiseOptions options{Prior::gaussian, VarianceReduction::rigid, draws, 64, 0};
      Statistics spread, errors;
      for (int run = 0; run < 600; ++run) {
        options.seed = static_cast<std::uint64_t>(run);
        const std::vector<double> noise = draw_noise(options, f.dimensions());
        const double rigid = f(std::vector<double>(f.dimensions()).data());
        const ScoreEstimate found = estimate(options, values_of(f, noise), noise, rigid);
        spread.add(figures_of(found));
        std::vector<double> squares{std::pow(found.value.error, 2), std::pow(found.sensitivity.error, 2)};
        for (const Estimate& g : found.gradient) squares.push_back(std::pow(g.error, 2));
        errors.add(squares);
      }
      for (std::size_t i = 0; i < 2 + f.dimensions(); ++i) {
        CAPTURE(static_cast<int>(draws));
        CAPTURE(i);
        const double ratio = std::sqrt(errors.mean(i)) / spread.deviation(i);
        CHECK(ratio > 0.85);  // of 600 runs a deviation is known to 3%
        if (draws != Draws::stratified) CHECK(ratio < 1.15);
      }
    }
  }

  TEST_CASE("the renderer's expected loss and its derivatives against quadrature over one parameter") {
    const Device device = open_device();
    const Scene scene = cube_scene(reduced(16, 6));
    Scene other = scene;
    other.meshes[0].transform = glm::mat4(glm::dmat4(rotation_from_vector({0.2, 0.3, -0.1})));
    other.camera.view[3].x += 0.3F;
    other.camera.fov_y_degrees = 44;
    const Image target = rigid_image(device, other);
    const std::vector<PoseParameters> scales{
        {.mesh_rotation = {0, 0.25, 0}, .mesh_translation = glm::dvec3(0)},
        {.camera_translation = {0.4, 0, 0}},
        {.fov_y_degrees = 5}};
    const std::vector<std::function<double(const PoseParameters&)>> pick{
        [](const PoseParameters& p) { return p.mesh_rotation.y; },
        [](const PoseParameters& p) { return p.camera_translation.x; },
        [](const PoseParameters& p) { return p.fov_y_degrees; }};
    for (std::size_t i = 0; i < scales.size(); ++i) {
      const double scale = pick[i](scales[i]);
      const Table table = tabulate(device, scene, target, scales[i]);
      const double loss = table.mean([](double) { return 1.0; });
      const double gradient = table.mean([&](double z) { return z / scale; });
      const double sensitivity = table.mean([](double z) { return z * z - 1; });
      for (const VarianceReduction baseline : {VarianceReduction::rigid, VarianceReduction::leave_one_out}) {
        PerturbedPoseOptions options;
        options.scale = scales[i];
        options.samples = static_cast<std::uint32_t>(reduced(1024, 32));
        options.variance_reduction = baseline;
        PerturbedPose perturbed(device, scene, target, options);
        const PerturbedPoseResult found = perturbed.evaluate(perturbed.scene_view(), 5);
        CAPTURE(i);
        CHECK(found.dimensions == 1);
        CHECK(std::abs(found.loss - loss) < k_standard_errors * found.loss_error);
        CHECK(std::abs(pick[i](found.gradient) - gradient) <
              k_standard_errors * pick[i](found.gradient_error));
        CHECK(std::abs(found.sensitivity - sensitivity) < k_standard_errors * found.sensitivity_error);
        if (!dpr::test::is_reduced()) {
          CHECK(std::abs(gradient) >
                2 * k_standard_errors * pick[i](found.gradient_error));  // the sign shows
        }
        CHECK(found.gradient.mesh_translation == glm::dvec3(0));  // not perturbed
      }
    }
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("gradient descent on the perturbed loss finds a pose from 20 degrees away") {
    if (dpr::test::is_reduced()) return;
    const Device device = open_device();
    const Scene scene = cube_scene(32);
    const Image target = rigid_image(device, scene);
    PerturbedPoseOptions options;
    options.scale = {.mesh_rotation = glm::dvec3(0.15)};
    PerturbedPose perturbed(device, scene, target, options);
    const glm::dvec3 axis = glm::normalize(glm::dvec3(1, 2, -1));
    View view = moved(perturbed.scene_view(), 0, {.mesh_rotation = glm::radians(20.0) * axis});
    Optimizer optimizer({.learning_rate = 0.02});
    constexpr unsigned k_iterations = 120;
    for (unsigned i = 0; i < k_iterations; ++i) {
      const double shrunk = 0.15 * std::pow(0.1, static_cast<double>(i) / k_iterations);
      perturbed.set_scale({.mesh_rotation = glm::dvec3(shrunk)});
      const glm::dvec3 g = perturbed.evaluate(view, i).gradient.mesh_rotation;
      const double gradient[] = {g.x, g.y, g.z};
      const auto step = optimizer.step(gradient);
      view = moved(view, 0, {.mesh_rotation = {step[0], step[1], step[2]}});
    }
    const double angle = angle_degrees(glm::dmat3(glm::mat3(view.transforms[0])), glm::dmat3(1.0));
    MESSAGE("final angle: " << angle << " degrees");
    CHECK(angle < 3);
  }

  TEST_CASE("the same every time, whatever was evaluated before") {
    const Device device = open_device();
    const Scene scene = cube_scene(16);
    PerturbedPoseOptions options;
    options.samples = 8;
    PerturbedPose perturbed(device, scene, Image(16, 16), options);
    const PerturbedPoseResult first = perturbed.evaluate(perturbed.scene_view(), 7);
    perturbed.evaluate(perturbed.scene_view(), 8);
    const PerturbedPoseResult again = perturbed.evaluate(perturbed.scene_view(), 7);
    CHECK(first.dimensions == 6);
    CHECK(first.loss == again.loss);
    CHECK(first.gradient.mesh_rotation == again.gradient.mesh_rotation);
    CHECK(first.sensitivity == again.sensitivity);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("what has no unbiased estimator is refused") {
    const auto check = [](NoiseOptions options, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(options), part);
    };
    check({.prior = Prior::uniform}, "has no score");
    check({.prior = Prior::gumbel}, "a symmetric prior");
    check({.draws = Draws::stratified}, "leave_one_out with stratified draws");
    check({.samples = 7}, "got 7, expected an even number");
    check({.samples = 2}, "two pairs, for leave_one_out");
    check({.samples = 0}, "samples (perturbed pose): got 0");
    check({.samples = 4098}, "samples (perturbed pose): got 4098");
    check({.draws = Draws::independent, .samples = 1}, "two independent draws");
    CHECK_NOTHROW(validate(NoiseOptions{
        .variance_reduction = VarianceReduction::none, .draws = Draws::independent, .samples = 1}));
  }

  TEST_CASE("wrong options and views are refused before any work") {
    const Device device = open_device();
    const Scene scene = cube_scene(16);
    const Image target(16, 16);
    const auto refuses = [&](const PerturbedPoseOptions& options, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, PerturbedPose(device, scene, target, options), part);
    };
    PerturbedPoseOptions options;
    options.scale = {};
    refuses(options, "scale (perturbed pose): got 0");
    options.scale.mesh_rotation.x = -1;
    refuses(options, "scale (perturbed pose): got -1");
    options.scale.mesh_rotation.x = std::numeric_limits<double>::quiet_NaN();
    refuses(options, "scale (perturbed pose)");
    options.scale = {.intrinsics = {1, 1, 0, 0}};
    refuses(options, "noise on intrinsics");
    options = {};
    options.mesh = 1;
    refuses(options, "mesh (perturbed pose): got 1");
    options = {};
    options.loss = {};
    refuses(options, "weights (loss)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, PerturbedPose(device, scene, Image(16, 17), {}), "got 16x17");

    PerturbedPose perturbed(device, scene, target, {});
    View view = perturbed.scene_view();
    view.transforms.clear();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, perturbed.evaluate(view, 1), "transforms (perturbed pose): got 0");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, perturbed.set_scale({.fov_y_degrees = 1}), "other parameters");
  }

  TEST_CASE("heavy tails on every parameter give finite numbers") {
    const Device device = open_device();
    Scene scene = cube_scene(reduced(16, 4));
    PerturbedPoseOptions options;
    options.samples = static_cast<std::uint32_t>(reduced(64, 8));
    options.prior = Prior::cauchy;
    options.scale = {glm::dvec3(1), glm::dvec3(1), glm::dvec3(1), glm::dvec3(1), 20, {}};
    for (const bool has_intrinsics : {false, true}) {
      if (has_intrinsics) {
        scene.camera.intrinsics = Intrinsics{14, 14, 8, 8};
        options.scale.fov_y_degrees = 0;
        options.scale.intrinsics = {10, 10, 10, 10};
      }
      PerturbedPose perturbed(device, scene, Image(scene.width, scene.height, glm::vec4(0.5F)), options);
      const PerturbedPoseResult found = perturbed.evaluate(perturbed.scene_view(), 1);
      CHECK(found.dimensions == (has_intrinsics ? 16 : 13));
      CHECK(std::isfinite(found.loss + found.loss_error + found.sensitivity + found.sensitivity_error));
      CHECK(std::isfinite(glm::length(found.gradient.camera_translation) + found.gradient.fov_y_degrees));
    }
  }
}

}  // namespace perturbed_pose_test
