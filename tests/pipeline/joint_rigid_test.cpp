// Promises of the joint composition: its exact image is the mean of rigid images whose distances and depths
// are perturbed, and its colour and alpha agree, since what no triangle covers is the background.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "check/fragments.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/normal_draws.hpp"
#include "support/reduced.hpp"
#include "support/worst.hpp"

namespace joint_rigid_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::is_reduced;
using dpr::test::NormalDraws;
using dpr::test::reduced;
using dpr::test::Worst;

namespace {

/// How many standard errors a mean, and how many standard deviations a sum of squares, may be away.
constexpr double k_standard_errors = 4;
/// Error of a pixel by single precision and the quadrature of the exact renderer.
constexpr double k_rounding = 2e-6;
/// No noise is drawn for a distance of so many sigma: in a thousand million draws none is that large
/// (2e-19 each).
constexpr double k_certain = 9;

/// Mean of a pixel's rigid renders: colour and alpha, and their standard errors.
struct MeanPixel {
  glm::dvec4 mean{0.0}, standard_error{0.0};
};

/// How often each fragment was seen in `samples` rigid renders with noise of their own, and last the
/// background: of what covers, the nearest.
std::vector<int> count_seen(const Scene& scene, const Pixel& pixel, int samples, NormalDraws& normal) {
  struct Scaled {
    double distance = 0, depth = 0;  // in units of the noise; the depth grows towards the eye
  };
  std::vector<Scaled> fragments;
  for (const Fragment& f : pixel) {
    fragments.push_back({f.distance / static_cast<double>(scene.smoothing.sigma),
                         zeta(scene, f.depth) / static_cast<double>(scene.smoothing.gamma)});
  }
  std::vector<int> seen(fragments.size() + 1);
  for (int sample = 0; sample < samples; ++sample) {
    std::size_t nearest = fragments.size();
    double nearest_depth = -INFINITY;
    for (std::size_t k = 0; k < fragments.size(); ++k) {
      const double distance = fragments[k].distance;
      const bool covers = std::fabs(distance) < k_certain ? distance + normal() > 0 : distance > 0;
      if (!covers) continue;
      const double depth = fragments[k].depth + normal();
      if (depth <= nearest_depth) continue;
      nearest_depth = depth;
      nearest = k;
    }
    ++seen[nearest];
  }
  return seen;
}

MeanPixel mean_of(const Scene& scene, const Pixel& pixel, const std::vector<int>& seen, int samples) {
  const auto value = [&](std::size_t k) {
    return k < pixel.size() ? glm::dvec4(pixel[k].color, 1.0) : glm::dvec4(glm::dvec3(scene.background), 0.0);
  };
  MeanPixel result;
  for (std::size_t k = 0; k < seen.size(); ++k) result.mean += value(k) * (1.0 * seen[k] / samples);
  glm::dvec4 variance(0);
  for (std::size_t k = 0; k < seen.size(); ++k) {
    const glm::dvec4 difference = value(k) - result.mean;
    // One more than was seen: what never was may still be as likely as once in all samples.
    variance += difference * difference * ((seen[k] + 1.0) / samples);
  }
  result.standard_error = glm::sqrt(variance / (samples - 1.0));
  return result;
}

std::vector<MeanPixel> mean_image(const Renderer& renderer, const Scene& scene, int samples,
                                  std::uint64_t seed) {
  NormalDraws normal(seed);
  std::vector<MeanPixel> image;
  for (const Pixel& pixel : pixels_of(renderer)) {
    image.push_back(mean_of(scene, pixel, count_seen(scene, pixel, samples, normal), samples));
  }
  return image;
}

/// An exact image against the means, in their standard errors. The squares add up to a chi-square variable
/// for each channel, since every pixel has noise of its own.
struct Agreement {
  Worst worst;        ///< of all pixels and channels
  double sum = 0;     ///< of the channel whose sum of squares is furthest from its expectation: how many
                      ///< standard deviations it is away
  int uncertain = 0;  ///< pixels and channels whose squares are added up, as their means are normal
  bool holds() const { return worst.error < k_standard_errors && sum < k_standard_errors; }
};

Agreement compare(const Image& found, const std::vector<MeanPixel>& expected, int samples) {
  const double certain = 10 * std::max(k_rounding, 1.0 / samples);  // seen less than a hundred times
  Agreement result;
  for (int c = 0; c < 4; ++c) {
    double squares = 0;
    int count = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const double difference = static_cast<double>(found.pixels[i][c]) - expected[i].mean[c];
      const double standard_error = expected[i].standard_error[c];
      const double error = std::fabs(difference) / std::hypot(standard_error, k_rounding);
      result.worst.add(error, "pixel", i, "channel", c);
      if (standard_error < certain) continue;
      squares += error * error;
      ++count;
    }
    result.uncertain += count;
    if (count > 0) result.sum = std::max(result.sum, std::fabs(squares - count) / std::sqrt(2.0 * count));
  }
  return result;
}

/// The coloured cube, blurred over about a pixel, front and back mixing; everything that one render in a
/// million would see is listed.
Scene cube(float degrees) {
  const int size = reduced(7, 5);
  Scene scene = cube_scene(size, size);
  scene.meshes[0].transform = placed(degrees);
  scene.smoothing.composition = Composition::joint;
  scene.smoothing.sigma = 1e-2F;
  scene.smoothing.gamma = 5e-2F;
  scene.smoothing.occupancy_threshold = 1e-7F;
  return scene;
}

Image render(Renderer& renderer, const Smoothing& smoothing) {
  renderer.set_smoothing(smoothing);
  renderer.forward();
  return renderer.image();
}

/// A scene in one colour before a background of one.
Scene two_tone(Mesh mesh, float object, float background) {
  mesh.vertex_colors.clear();
  mesh.face_colors.assign(mesh.faces.size(), glm::vec3(object));
  const int size = reduced(24, 6);
  Scene scene = scene_of(std::move(mesh), size, size);
  scene.background = glm::vec3(background);
  scene.smoothing.composition = Composition::joint;
  return scene;
}

/// White on black has the colour alpha, black on white 1 - alpha.
double disagreement(const Image& image, bool is_white) {
  Worst worst;
  for (const glm::vec4& pixel : image.pixels) {
    const double alpha = static_cast<double>(pixel.a), expected = is_white ? alpha : 1 - alpha;
    for (int c = 0; c < 3; ++c) worst.add(std::fabs(static_cast<double>(pixel[c]) - expected));
  }
  return worst.error;
}

}  // namespace

TEST_SUITE("statistical") {
  TEST_CASE("joint, rigid: the normal draws have the normal distribution") {
    const int draws = reduced(10'000'000, 100'000);
    constexpr std::array<double, 9> k_bounds{-4, -3.4, -2, -0.7, 0, 0.3, 1.5, 3, 3.6};
    std::array<int, k_bounds.size()> below{};
    NormalDraws normal(11);
    for (int i = 0; i < draws; ++i) {
      const double x = normal();
      for (std::size_t b = 0; b < k_bounds.size(); ++b) below[b] += x < k_bounds[b] ? 1 : 0;
    }
    for (std::size_t b = 0; b < k_bounds.size(); ++b) {
      const double p = 0.5 * std::erfc(-k_bounds[b] / std::sqrt(2.0));
      CAPTURE(k_bounds[b]);
      CHECK(std::fabs(below[b] - draws * p) < k_standard_errors * std::sqrt(draws * p * (1 - p)));
    }
  }

  TEST_CASE("joint, rigid: the exact image is the mean of a million perturbed rigid images") {
    const int samples = reduced(1'000'000, 10'000);
    // An error of a hundredth at a million samples; of a tenth at a hundredth of them.
    const float wrong = 1 + 10 / std::sqrt(static_cast<float>(samples));
    Renderer renderer(open_device());
    for (const float degrees : {23.0F, 131.0F, 250.0F}) {
      if (is_reduced() && degrees > 23) continue;
      const Scene scene = cube(degrees);
      renderer.set_scene(scene);
      const Image exact = render(renderer, scene.smoothing);
      const std::vector<MeanPixel> mean =
          mean_image(renderer, scene, samples, static_cast<std::uint64_t>(degrees));
      const Agreement agreement = compare(exact, mean, samples);
      CAPTURE(degrees);
      CAPTURE(agreement.worst.where);
      CHECK(agreement.worst.error < k_standard_errors);
      CHECK(agreement.sum < k_standard_errors);
      CHECK(agreement.uncertain > static_cast<int>(mean.size()));  // of four times as many
      MESSAGE(degrees << " degrees: worst " << agreement.worst.error << " standard errors, sum of squares "
                      << agreement.sum << " standard deviations away, " << agreement.uncertain << " of "
                      << 4 * mean.size() << " uncertain");

      const auto agreement_with = [&](const std::string& name, auto change) {
        Smoothing smoothing = scene.smoothing;
        change(smoothing);
        const Agreement found = compare(render(renderer, smoothing), mean, samples);
        MESSAGE(name << ": worst " << found.worst.error << ", sum " << found.sum);
        return found.holds();
      };
      CHECK_FALSE(agreement_with("wrong sigma", [&](Smoothing& s) { s.sigma *= wrong; }));
      CHECK_FALSE(agreement_with("wrong gamma", [&](Smoothing& s) { s.gamma *= wrong; }));
      CHECK_FALSE(agreement_with("barrier", [](Smoothing& s) { s.composition = Composition::barrier; }));
    }
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("joint, rigid: colour and alpha agree for every prior, w_0 = 1 - alpha") {
    constexpr float k_sigmas[] = {1e-4F, 2e-3F, 5e-2F}, k_gammas[] = {1e-4F, 3e-2F, 1.0F};
    Renderer renderer(open_device());
    for (const Prior prior : choices<Prior>()) {
      if (is_reduced() && prior != Prior::gaussian) continue;
      Worst worst;
      double barrier = 0;
      int soft = 0;
      for (const bool is_cube : {true, false}) {
        for (const bool is_white : {true, false}) {
          Scene scene =
              two_tone(is_cube ? make_cube() : random_soup(20, 8), is_white ? 1 : 0, is_white ? 0 : 1);
          renderer.set_scene(scene);
          for (const Prior occupancy : choices<Prior>()) {
            if (is_reduced() && occupancy != prior) continue;
            for (const float sigma : k_sigmas) {
              for (const float gamma : k_gammas) {
                Smoothing s = scene.smoothing;
                s.occupancy_prior = occupancy;
                s.depth_prior = prior;
                s.sigma = sigma;
                s.gamma = gamma;
                const Image image = render(renderer, s);
                worst.add(disagreement(image, is_white), is_cube ? "cube" : "soup",
                          is_white ? "white" : "black", to_string(occupancy), "sigma", sigma, "gamma", gamma);
                soft += static_cast<int>(std::ranges::count_if(
                    image.pixels, [](const glm::vec4& p) { return p.a > 0.01F && p.a < 0.99F; }));
              }
            }
          }
          // There triangles stay opaque out to the blur radius.
          Smoothing s = scene.smoothing;
          s.depth_prior = prior;
          s.composition = Composition::barrier;
          barrier = std::max(barrier, disagreement(render(renderer, s), is_white));
        }
      }
      CAPTURE(to_string(prior));
      DPR_CHECK_WORST(worst, 1e-6);
      CHECK(barrier > 1e-3);
      CHECK(soft > 100);
      MESSAGE(to_string(prior) << ": colour and alpha differ by at most " << worst.error << " ("
                               << worst.where << "), in the barrier by " << barrier);
    }
  }
}

}  // namespace joint_rigid_test
