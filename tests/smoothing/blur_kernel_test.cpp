// The kernel of the blur by noise of the pixel's position: its error against the density, its sum and its
// moments, its derivative by the scale, and what is refused.
#include "smoothing/blur_kernel.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "dpr/error.hpp"
#include "support/blur_matrix.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/worst.hpp"

namespace blur_kernel_test {

namespace {

using dpr::BlurKernel;
using dpr::Prior;
using dpr::test::BlurMatrix;
using dpr::test::Worst;

constexpr std::array k_smooth_priors = {Prior::gaussian, Prior::logistic, Prior::cauchy};
constexpr std::array k_priors = {Prior::gaussian, Prior::logistic, Prior::cauchy, Prior::uniform};

const std::vector k_scales = {0.0, 1e-9, 1e-3, 0.1, 0.3, 0.5, 0.9, 1.7, 4.2, 7.9, 8.1, 13.7, 33.0, 130.0};

/// The scales; of the reduced test, which takes as long as the widest kernel, none above `largest`.
std::vector<double> up_to(double largest, std::vector<double> scales) {
  if (dpr::test::is_reduced()) std::erase_if(scales, [largest](double scale) { return scale > largest; });
  return scales;
}

dpr::reference::Prior reference(Prior prior) {
  return dpr::reference::k_priors.at(static_cast<std::size_t>(prior));
}

BlurMatrix matrix_of(const BlurKernel& kernel, int pixels) {
  return dpr::test::matrix_of(kernel, kernel.weights, pixels);
}

/// Largest difference, relative to the largest entry of `expected`.
Worst error(const BlurMatrix& found, const BlurMatrix& expected) {
  double largest = 0;
  for (const auto& row : expected)
    for (const double value : row) largest = std::max(largest, std::abs(value));
  Worst worst;
  REQUIRE(found.size() == expected.size());
  for (std::size_t row = 0; row < expected.size(); ++row) {
    REQUIRE(found[row].size() == expected[row].size());
    for (std::size_t k = 0; k < expected[row].size(); ++k)
      worst.add(std::abs(found[row][k] - expected[row][k]) / largest, "pixel", row, "sample", k);
  }
  return worst;
}

Worst density_error(Prior prior, double scale, int supersampling, double expected_scale) {
  const int pixels = 7;
  const BlurKernel kernel = dpr::blur_kernel(prior, scale, supersampling);
  return error(matrix_of(kernel, pixels),
               dpr::reference::blur_matrix(reference(prior), expected_scale * supersampling, pixels,
                                           supersampling, kernel.margin));
}

double variance_of(const std::vector<double>& weights, double middle) {
  double sum = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double offset = static_cast<double>(i) - middle;
    sum += weights[i] * offset * offset;
  }
  return sum;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("smooth densities are met to 1e-4 of their peak at every scale") {
    for (const Prior prior : k_smooth_priors) {
      for (const int supersampling : {1, 2, 4}) {
        for (const double scale : up_to(9.1, {1.0, 1.37, 1.99, 2.0, 3.3, 5.0, 7.99, 8.0, 9.1, 11.9, 12.0,
                                              17.9, 18.0, 40.5, 100.0})) {
          CAPTURE(static_cast<int>(prior));
          CAPTURE(supersampling);
          CAPTURE(scale);
          const Worst worst =
              density_error(prior, scale / supersampling, supersampling, scale / supersampling);
          DPR_CHECK_WORST(worst, 1e-4);
        }
      }
    }
  }

  TEST_CASE("the Gaussian is cut at 1e-4 of its peak") {
    const BlurKernel kernel = dpr::blur_kernel(Prior::gaussian, 3, 1);
    for (int offset = -kernel.margin; offset <= kernel.margin; ++offset) {
      const double x = offset / 3.0;
      const double density = std::exp(-x * x / 2) / (3 * std::sqrt(2 * std::numbers::pi));
      const double found =
          static_cast<double>(kernel.weights[static_cast<std::size_t>(offset + kernel.margin)]);
      CHECK(std::abs(found - density) < 1e-4 / (3 * std::sqrt(2 * std::numbers::pi)));
    }
  }

  TEST_CASE("a kernel of another scale is found out") {
    CHECK(density_error(Prior::gaussian, 5, 1, 5.01).error > 1e-3);
    CHECK(density_error(Prior::gaussian, 50, 1, 50.1).error > 1e-3);
  }

  TEST_CASE("the scale 0 leaves the mean of a pixel's samples") {
    for (const Prior prior : k_priors) {
      for (const int supersampling : {1, 2, 4}) {
        const BlurKernel kernel = dpr::blur_kernel(prior, 0, supersampling);
        REQUIRE(kernel.margin == 2);  // for the contours beside the frame
        std::vector<float> mean(static_cast<std::size_t>(supersampling + 2 * kernel.margin));
        std::fill(mean.begin() + kernel.margin, mean.end() - kernel.margin,
                  1.0F / static_cast<float>(supersampling));
        CHECK(kernel.weights == mean);
        CHECK(kernel.weights_by_scale == std::vector<float>(mean.size(), 0.0F));
      }
    }
  }

  TEST_CASE("at every pixel the weights add up to 1, whatever the scale") {
    for (const Prior prior : k_priors) {
      for (const double scale : up_to(8.1, k_scales)) {
        for (const int supersampling : {1, 2, 4}) {
          for (const auto& row : matrix_of(dpr::blur_kernel(prior, scale, supersampling), 5)) {
            CAPTURE(scale);
            CHECK(std::accumulate(row.begin(), row.end(), 0.0) == doctest::Approx(1).epsilon(3e-7));
          }
        }
      }
    }
  }

  TEST_CASE("all weights are symmetric, so that a pass is the transpose of another") {
    Worst asymmetry;
    for (const Prior prior : k_priors) {
      for (const double scale : k_scales) {
        for (const int supersampling : {1, 2, 4}) {
          const BlurKernel kernel = dpr::blur_kernel(prior, scale, supersampling);
          for (const auto* weights :
               {&kernel.weights, &kernel.weights_by_scale, &kernel.reduce, &kernel.expand}) {
            for (std::size_t i = 0; i < weights->size(); ++i) {
              const double here = static_cast<double>((*weights)[i]);
              asymmetry.add(std::abs(here - static_cast<double>((*weights)[weights->size() - 1 - i])), scale);
            }
          }
        }
      }
    }
    DPR_CHECK_WORST(asymmetry, 3e-8);
  }

  TEST_CASE(
      "areas are kept: away from the border a sample's weights over all pixels add up to a sample's area") {
    for (const double scale : {0.4, 3.0, 9.0, 20.0}) {
      const BlurKernel kernel = dpr::blur_kernel(Prior::gaussian, scale, 1);
      const int pixels = 4 * kernel.margin + 3;
      const BlurMatrix matrix = matrix_of(kernel, pixels);
      for (int sample = 3 * kernel.margin; sample < 3 * kernel.margin + 3; ++sample) {
        double sum = 0;
        for (const auto& row : matrix) sum += row[static_cast<std::size_t>(sample)];
        CHECK(sum == doctest::Approx(1).epsilon(3e-7));
      }
    }
  }

  TEST_CASE("the variance is the density's, below the distance of the samples too") {
    for (const double scale : {1e-3, 0.05, 0.2, 0.5, 0.7, 1.0, 3.0, 7.0, 8.0, 30.0}) {
      for (const auto& [prior, unit_variance] : {std::pair{Prior::gaussian, 1.0},
                                                 {Prior::logistic, std::numbers::pi * std::numbers::pi / 3},
                                                 {Prior::uniform, 1.0 / 12}}) {
        const BlurKernel kernel = dpr::blur_kernel(prior, scale, 1);
        const std::vector<double> weights = matrix_of(kernel, 1).front();
        CAPTURE(scale);
        // The ends of the tails are cut off.
        CHECK(variance_of(weights, kernel.margin) ==
              doctest::Approx(unit_variance * scale * scale).epsilon(5e-3).scale(1));
      }
    }
  }

  TEST_CASE("weights of samples are not negative") {
    for (const Prior prior : k_priors) {
      for (const double scale : {0.01, 0.3, 1.0, 7.9}) {
        for (const float weight : dpr::blur_kernel(prior, scale, 1).weights) CHECK(weight >= 0);
      }
    }
  }

  TEST_CASE("the uniform density is a box") {
    const BlurKernel kernel = dpr::blur_kernel(Prior::uniform, 21, 1);
    const float middle = kernel.weights[kernel.weights.size() / 2];
    CHECK(static_cast<double>(middle) == doctest::Approx(1 / 21.0).epsilon(2e-3));
    int inside = 0;
    for (const float weight : kernel.weights) inside += weight > 0.99F * middle ? 1 : 0;
    CHECK(inside >= 19);
    CHECK(inside <= 21);
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("the derivative of the weights by the scale in pixels is that of the matrix") {
    const int pixels = 3;
    for (const Prior prior : k_priors) {
      for (const int supersampling : {1, 2, 4}) {
        for (const double scale : up_to(2.6, {0.17, 0.4, 0.77, 1.6, 2.6, 9.4, 41.3})) {
          const BlurKernel kernel = dpr::blur_kernel(prior, scale, supersampling);
          const bool has_jumps = prior == Prior::uniform;
          const double step = (has_jumps ? 1e-3 : 1e-2) * scale;
          const BlurKernel above = dpr::blur_kernel(prior, scale + step, supersampling);
          const BlurKernel below = dpr::blur_kernel(prior, scale - step, supersampling);
          // At least as wide as each of them; what lies beyond a narrower one's margin is zero.
          const int margin = std::max({above.margin, kernel.margin, below.margin});
          const auto wide = [&](const BlurKernel& k, const std::vector<float>& weights) {
            BlurMatrix matrix = dpr::test::matrix_of(k, weights, pixels);
            for (auto& row : matrix) {
              const auto missing = static_cast<std::size_t>(margin - k.margin);
              row.insert(row.begin(), missing, 0.0);
              row.insert(row.end(), missing, 0.0);
            }
            return matrix;
          };
          BlurMatrix difference = wide(above, above.weights);
          const BlurMatrix lower = wide(below, below.weights);
          for (std::size_t row = 0; row < difference.size(); ++row) {
            for (std::size_t k = 0; k < difference[row].size(); ++k)
              difference[row][k] = (difference[row][k] - lower[row][k]) / (2 * step);
          }
          CAPTURE(static_cast<int>(prior));
          CAPTURE(supersampling);
          CAPTURE(scale);
          DPR_CHECK_WORST(error(wide(kernel, kernel.weights_by_scale), difference), has_jumps ? 2e-2 : 3e-3);
        }
      }
    }
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("what has no meaning is refused by name") {
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::blur_kernel(Prior::gumbel, 1, 1), "gumbel");
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::blur_kernel(Prior::gaussian, 1, 3), "supersampling");
    for (const double scale : {-1.0, 1e6, std::numeric_limits<double>::quiet_NaN()}) {
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::blur_kernel(Prior::gaussian, scale, 1), "scale");
    }
  }
}

}  // namespace blur_kernel_test
