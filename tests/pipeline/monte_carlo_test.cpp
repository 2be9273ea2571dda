// Sampled aggregation over exact occupancies, the sampled joint composition, and rigid frames shifted by
// samples of the pixel's noise, end to end: the mean over
// many seeds is the exact image, and the exact gradient of every block, within the standard error. Sampled
// inside sampled approaches neither (the logarithm of a sampled occupancy is biased): determinism_test.cpp.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/estimates.hpp"
#include "support/reduced.hpp"

namespace monte_carlo_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::is_reduced;
using dpr::test::reduced;

namespace {

/// How many standard errors a mean may be away: for a right estimator once in 16,000 figures.
constexpr double k_standard_errors = 4;
/// Error by single precision and the quadrature of the exact renderer, relative to the figure's own size.
constexpr double k_rounding = 1e-4;

/// One vector of a render: the image's colours, or a block of gradients.
struct Vector {
  std::string name;
  std::vector<double> values;
};

std::vector<Vector> render(Renderer& renderer, const Image& grad) {
  renderer.forward();
  std::vector<double> image;
  for (const glm::vec4& p : renderer.image().pixels) append(image, glm::vec3(p));
  std::vector<Vector> vectors{{"image", image}};
  for (Block& block : blocks_of(renderer.backward(std::span(&grad, 1)))) {
    if (norm(block.found) > 0) vectors.push_back({block.name, std::move(block.found)});
  }
  return vectors;
}

/// A number that stands for a vector: its component along a fixed direction.
struct Figure {
  std::string name;
  std::vector<double> direction;
  double expected = 0;
};

double component(const std::vector<double>& values, const std::vector<double>& direction) {
  double sum = 0;
  for (std::size_t i = 0; i < values.size(); ++i) sum += values[i] * direction[i];
  return sum / norm(direction);
}

/// Two a vector: along the exact vector itself, where an error of scale shows, and along a random direction.
std::vector<Figure> figures_of(const std::vector<Vector>& exact) {
  std::vector<Figure> figures;
  for (const Vector& vector : exact) {
    figures.push_back({vector.name, vector.values, norm(vector.values)});
    if (vector.values.size() == 1) continue;
    Random random(100);
    std::vector<double> direction;
    for (std::size_t i = 0; i < vector.values.size(); ++i) direction.push_back(random(-1.0F, 1.0F));
    figures.push_back({vector.name, direction, component(vector.values, direction)});
  }
  return figures;
}

struct Sample {
  std::vector<double> mean, standard_error;
};

Sample sample(const Device& device, Scene scene, const Image& grad, const std::vector<Figure>& figures,
              int seeds) {
  scene.smoothing.aggregation_estimator = Estimator::monte_carlo;
  if (scene.smoothing.composition == Composition::joint || scene.smoothing.noise == Noise::pixel) {
    scene.smoothing.occupancy_estimator = Estimator::monte_carlo;
  }
  Renderer renderer(device);
  renderer.set_scene(scene);
  std::vector<double> mean(figures.size()), squares(figures.size());
  for (int seed = 1; seed <= seeds; ++seed) {
    scene.smoothing.seed = static_cast<std::uint64_t>(seed);
    renderer.set_smoothing(scene.smoothing);
    const std::vector<Vector> vectors = render(renderer, grad);
    std::size_t v = 0;
    for (std::size_t i = 0; i < figures.size(); ++i) {
      while (vectors.at(v).name != figures[i].name) ++v;
      const double value = component(vectors[v].values, figures[i].direction);
      // Welford: the spread is far below the values.
      const double change = value - mean[i];
      mean[i] += change / seed;
      squares[i] += change * (value - mean[i]);
    }
  }
  Sample result{mean, {}};
  for (const double s : squares) result.standard_error.push_back(std::sqrt(s / (seeds - 1.0) / seeds));
  return result;
}

std::vector<Figure> exact_figures(const Device& device, const Scene& scene, const Image& grad) {
  Renderer renderer(device);
  renderer.set_scene(scene);
  return figures_of(render(renderer, grad));
}

/// |mean - expected| in standard errors, after what rounding explains; 0 where both vanish.
double deviation(double mean, double standard_error, double expected) {
  const double unexplained = std::fabs(mean - expected) - k_rounding * std::fabs(expected);
  return unexplained <= 0 ? 0 : unexplained / standard_error;
}

Scene test_scene(Prior prior, int size) {
  Scene scene = cube_scene(size, size);
  // Depths of the cube's sides differ by a few gamma, so that several of them win.
  scene.smoothing.gamma = 5e-2F;
  scene.smoothing.depth_prior = prior;
  scene.smoothing.samples = static_cast<std::uint32_t>(reduced(256, 16));
  return scene;
}

/// Settings of one comparison.
struct Case {
  Composition composition;
  Prior prior;
  dpr::test::SamplingMode mode;
  Noise noise = Noise::triangle;
  std::string name() const {
    return std::string(to_string(noise)) + " " + std::string(to_string(composition)) + " " +
           std::string(to_string(prior)) + " " + mode.name();
  }
};

bool is_usual(const Case& c) {
  return c.mode.reduction == VarianceReduction::rigid && c.mode.draws == Draws::independent;
}

/// With noise of the pixel: every prior that is symmetric, the Gaussian in every mode.
std::vector<Case> pixel_cases() {
  std::vector<Case> list;
  const dpr::test::SamplingMode usual{VarianceReduction::rigid, Draws::independent};
  for (const Prior prior : {Prior::cauchy, Prior::logistic, Prior::uniform})
    list.push_back({Composition::joint, prior, usual, Noise::pixel});
  for (const dpr::test::SamplingMode& mode : dpr::test::sampling_modes(Prior::gaussian))
    list.push_back({Composition::joint, Prior::gaussian, mode, Noise::pixel});
  list.push_back({Composition::barrier, Prior::gaussian, usual, Noise::pixel});
  return list;
}

/// Both compositions: every prior with the rigid baseline, the Gaussian in every mode.
std::vector<Case> cases() {
  std::vector<Case> list = pixel_cases();
  for (const Composition composition : {Composition::barrier, Composition::joint}) {
    for (const Prior prior : dpr::test::k_sampled_priors) {
      for (const dpr::test::SamplingMode& mode : dpr::test::sampling_modes(prior)) {
        if (const Case c{composition, prior, mode}; is_usual(c) || prior == Prior::gaussian)
          list.push_back(c);
      }
    }
  }
  return list;
}

Scene scene_of_case(const Case& c, int size) {
  Scene scene = test_scene(c.prior, size);
  scene.smoothing.composition = c.composition;
  scene.smoothing.variance_reduction = c.mode.reduction;
  scene.smoothing.draws = c.mode.draws;
  if (c.noise == Noise::pixel) {
    scene.smoothing.noise = Noise::pixel;
    scene.smoothing.occupancy_prior = c.prior;
    scene.smoothing.depth_prior = Prior::gaussian;
    scene.smoothing.sigma = static_cast<float>(std::pow(4.0 / size, 2));  // two pixels
    scene.smoothing.blur_radius.reset();
    return scene;
  }
  if (c.composition == Composition::barrier) return scene;
  // The exact joint composition has no Cauchy depths.
  scene.smoothing.occupancy_prior = c.prior;
  if (c.prior == Prior::cauchy) scene.smoothing.depth_prior = Prior::gaussian;
  return scene;
}

/// By which `image` shows `frame` inside its border, where the raster ends: at most so many pixels.
std::optional<std::pair<int, int>> shift_between(const Image& frame, const Image& image, int most) {
  const auto is_shifted_by = [&](int dx, int dy) {
    for (int y = std::max(0, 1 - dy); y < std::min(image.height, image.height - 1 - dy); ++y) {
      for (int x = std::max(0, 1 - dx); x < std::min(image.width, image.width - 1 - dx); ++x) {
        const auto from = static_cast<std::size_t>((y + dy) * image.width + x + dx);
        const glm::vec4 apart =
            glm::abs(image.pixels[static_cast<std::size_t>(y * image.width + x)] - frame.pixels[from]);
        if (std::max({apart.x, apart.y, apart.z, apart.w}) > 1e-4F) return false;
      }
    }
    return true;
  };
  for (int dy = -most; dy <= most; ++dy) {
    for (int dx = -most; dx <= most; ++dx) {
      if (is_shifted_by(dx, dy)) return std::pair(dx, dy);
    }
  }
  return std::nullopt;
}

/// Which way to a sharper image of the cube in another pose: the gradients of all blocks stand out in it.
Image test_grad(const Device& device, int size) {
  Scene scene = test_scene(Prior::gaussian, size);
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  Image grad = renderer.image();
  scene.meshes[0].transform = placed(33.0F, 1.05F, {0.1F, -0.05F, 0.2F});
  scene.smoothing = smoothing_preset("rigid");
  renderer.set_scene(scene);
  renderer.forward();
  const Image target = renderer.image();
  for (std::size_t i = 0; i < grad.pixels.size(); ++i) grad.pixels[i] -= target.pixels[i];
  return grad;
}

}  // namespace

TEST_SUITE("statistical") {
  TEST_CASE("monte carlo: the mean over seeds is the exact image and gradient, every prior, every mode") {
    const int size = reduced(24, 6), seeds = reduced(64, 2);
    const Device device = open_device();
    const Image grad = test_grad(device, size);
    double worst = 0;
    std::string worst_name;
    std::size_t count = 0;
    std::map<std::string, double> power;
    for (const Case& c : cases()) {
      // Every mode of these kernels is in aggregate_sampled_test and aggregate_joint_sampled_test.
      if (is_reduced() && c.noise == Noise::triangle && !is_usual(c)) continue;
      if (is_reduced() && (c.prior != Prior::gaussian || c.mode.draws == Draws::antithetic)) continue;
      const Scene scene = scene_of_case(c, size);
      const std::string name = c.name();
      CAPTURE(name);
      const std::vector<Figure> figures = exact_figures(device, scene, grad);
      const Sample found = sample(device, scene, grad, figures, seeds);
      for (std::size_t i = 0; i < figures.size(); ++i) {
        const double mean = found.mean[i], error = found.standard_error[i], expected = figures[i].expected;
        CAPTURE(figures[i].name);
        CAPTURE(expected);
        CAPTURE(mean);
        CAPTURE(error);
        const double z = deviation(mean, error, expected);
        if (is_reduced()) continue;  // few seeds say nothing of the error
        CHECK(z < k_standard_errors);
        ++count;
        if (z > worst) worst_name = name + ", " + figures[i].name;
        worst = std::max(worst, z);
        // A figure of twice the length, or with the other sign, must not pass.
        const double wrong =
            std::min(deviation(2 * mean, 2 * error, expected), deviation(-mean, error, expected));
        power[figures[i].name] = std::max(power[figures[i].name], wrong);
      }
    }
    MESSAGE("worst of " << count << " figures: " << worst << " standard errors, " << worst_name);
    if (is_reduced()) return;  // with few seeds nothing stands out
    std::string text;
    for (const auto& entry : power) {
      CAPTURE(entry.first);
      CHECK(entry.second > k_standard_errors);
      text += entry.first + " " + std::to_string(entry.second) + "\n";
    }
    MESSAGE("standard errors by which a factor of 2 or -1 would show:\n" << text);
  }

  TEST_CASE("monte carlo: the rigid baseline lowers the variance of the gradient where one face dominates") {
    if (is_reduced()) return;
    const Device device = open_device();
    const Image grad = test_grad(device, 24);
    Scene scene = test_scene(Prior::gaussian, 24);
    scene.smoothing.gamma = 1e-2F;
    const std::vector<Figure> figures = exact_figures(device, scene, grad);
    scene.smoothing.variance_reduction = VarianceReduction::none;
    const Sample none = sample(device, scene, grad, figures, 32);
    scene.smoothing.variance_reduction = VarianceReduction::rigid;
    const Sample rigid = sample(device, scene, grad, figures, 32);
    for (std::size_t i = 0; i < figures.size(); ++i) {
      CAPTURE(figures[i].name);
      if (figures[i].name == "positions" || figures[i].name == "gamma") {
        CHECK(rigid.standard_error[i] < none.standard_error[i]);
      }
      // The image itself has no baseline.
      if (figures[i].name == "image") CHECK(rigid.standard_error[i] == none.standard_error[i]);
    }
  }

  TEST_CASE("monte carlo: four times the samples halve the standard error") {
    if (is_reduced()) return;
    const Device device = open_device();
    const Image grad = test_grad(device, 24);
    Scene scene = test_scene(Prior::logistic, 24);
    scene.smoothing.samples = 16;
    const std::vector<Figure> figures = exact_figures(device, scene, grad);
    const Sample few = sample(device, scene, grad, figures, 64);
    scene.smoothing.samples = 64;
    const Sample many = sample(device, scene, grad, figures, 64);
    // A standard error of 64 seeds is known to 9%.
    REQUIRE(figures[0].name == "image");
    CHECK(few.standard_error[0] / many.standard_error[0] > 1.5);
    CHECK(few.standard_error[0] / many.standard_error[0] < 2.7);
  }

  TEST_CASE("monte carlo: with noise of the pixel a sample is a rigid frame, shifted") {
    const int size = reduced(32, 10);
    Scene scene = scene_of_case({Composition::joint, Prior::gaussian, {}, Noise::pixel}, size);
    scene.smoothing.gamma = 1e-8F;
    scene.smoothing.occupancy_estimator = Estimator::monte_carlo;
    scene.smoothing.samples = 1;
    Scene rigid = scene;
    rigid.smoothing.occupancy_estimator = Estimator::exact;
    rigid.smoothing.sigma = 1e-12F;
    const Device device = open_device();
    Renderer sampled(device), still(device);
    still.set_scene(rigid);
    still.forward();
    const Image frame = still.image();
    std::set<std::pair<int, int>> shifts;
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      scene.smoothing.seed = seed;
      sampled.set_scene(scene);
      sampled.forward();
      const Image image = sampled.image();
      sampled.forward();
      CHECK(image.pixels == sampled.image().pixels);
      if (const auto shift = shift_between(frame, image, size / 4)) shifts.insert(*shift);
    }
    // Those that are shifted further leave too little to compare.
    CHECK(shifts.size() >= static_cast<std::size_t>(reduced(4, 2)));
  }
}

}  // namespace monte_carlo_test
