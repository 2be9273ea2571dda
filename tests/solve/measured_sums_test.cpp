// Normal equations of silhouettes and depths, beside colours or alone: against sums in double precision, and their
// gradient against differences of the loss, at every width of the lanes.
#include "solve/measured_sums.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "solve/normal_equations.hpp"
#include "support/difference.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace measured_sums_test {

using namespace dpr;

namespace {

using Pixels = std::vector<cl_float4>;

constexpr std::size_t k_views = 3, k_directions = 6;

float number(std::mt19937& engine, float low, float high) {
  return low + (high - low) * static_cast<float>(engine()) / 4294967296.0F;
}

/// Random images: a third of the pixels do not show the object, some have no depth or do not count.
struct Case {
  std::size_t pixels;
  LossScales scales{.color = 0.8F, .measured = {{{2.5F, 0.4F}, {0.3F, 0.7F}}}};
  WeighedTarget target;
  Pixels colors, depths, tangents, depth_tangents;

  Case(std::size_t pixels_, bool counts_colors) : pixels(pixels_) {
    std::mt19937 engine(5);
    const auto random = [&](float low, float high) { return number(engine, low, high); };
    for (std::size_t i = 0; i < pixels; ++i) {
      target.colors.push_back({{random(0, 1), random(0, 1), random(0, 1), 1}});
      const float weight = random(0.2F, 1);
      target.weights.push_back(counts_colors && i % 7 != 0 ? weight : 0);
      const float has_coverage = i % 5 == 0 ? 0 : random(0.2F, 1),
                  has_depth = i % 4 == 0 ? 0 : random(0.2F, 1);
      target.measured.push_back({{random(0, 1), has_coverage, random(2, 3), has_depth}});
    }
    for (std::size_t i = 0; i < k_views * pixels; ++i) {
      const float alpha = i % 3 == 0 ? 0 : random(0.1F, 1), depth = alpha * random(2, 3);
      colors.push_back({{random(0, 1), random(0, 1), random(0, 1), alpha}});
      depths.push_back({{depth, depth, depth, alpha}});
    }
    for (std::size_t i = 0; i < k_directions * k_views * pixels; ++i) {
      const float size = i % pixels % 3 == 1 || i % k_views * pixels % 3 == 0 ? 0 : 1;
      const float alpha = size * random(-1, 1), depth = size * random(-1, 1);
      tangents.push_back({{random(-size, size), random(-size, size), random(-size, size), alpha}});
      depth_tangents.push_back({{depth, depth, depth, alpha}});
    }
  }
};

double at(const cl_float4& pixel, int channel) { return static_cast<double>(pixel.s[channel]); }

/// Weighed sums of a view in double precision.
class Reference {
 public:
  Reference(const Case& c, std::size_t view) : case_(c), view_(view) {}

  /// Of the images moved by a step in a direction.
  double loss(std::size_t direction, double step) const {
    double sum = 0;
    for (std::size_t i = 0; i < case_.pixels; ++i) {
      for (const Group& g : groups(i, direction, step)) sum += g.weight * g.squared() * slope(g);
    }
    return sum / total();
  }

  NormalEquations equations() const {
    constexpr std::size_t n = k_directions;
    NormalEquations result;
    result.loss = loss(0, 0);
    for (std::size_t i = 0; i < case_.pixels; ++i) {
      std::array<double, n> scores{};
      const std::vector<Group> still = groups(i, 0, 0);
      std::array<std::vector<Group>, n> moved;
      for (std::size_t k = 0; k < n; ++k) moved[k] = groups(i, k, 1);
      for (std::size_t g = 0; g < still.size(); ++g) {
        const double w = still[g].weight * slope(still[g]) * slope(still[g]);
        const auto by = [&](std::size_t k, std::size_t c) {
          return moved[k][g].residuals[c] - still[g].residuals[c];
        };
        for (std::size_t c = 0; c < still[g].residuals.size(); ++c) {
          for (std::size_t k = 0; k < n; ++k) {
            scores[k] += w * still[g].residuals[c] * by(k, c);
            for (std::size_t l = 0; l < n; ++l)
              result.hessian[k * n + l] += w * by(k, c) * by(l, c) / total();
          }
        }
      }
      for (std::size_t k = 0; k < n; ++k) {
        result.gradient[k] += scores[k] / total();
        for (std::size_t l = 0; l < n; ++l)
          result.scatter[k * n + l] += scores[k] * scores[l] / (total() * total());
      }
    }
    return result;
  }

 private:
  /// Residuals that a robust loss takes together.
  struct Group {
    double weight, scale;
    std::vector<double> residuals;

    double squared() const {
      double sum = 0;
      for (const double r : residuals) sum += r * r;
      return sum;
    }
  };

  static double slope(const Group& g) {
    return 1 / (1 + (g.scale > 0 ? g.squared() / (g.scale * g.scale) : 0));
  }

  /// What divides the sums: three channels, or the pixels of the coverage.
  double total() const {
    double colors = 0, coverages = 0;
    for (const float w : case_.target.weights) colors += static_cast<double>(w);
    for (const cl_float4& m : case_.target.measured) coverages += at(m, 1);
    return colors > 0 ? 3 * colors : coverages;
  }

  std::vector<Group> groups(std::size_t i, std::size_t direction, double step) const {
    const std::size_t still = view_ * case_.pixels + i, moved = direction * k_views * case_.pixels + still;
    const auto value = [&](const Pixels& images, const Pixels& tangents, int c) {
      return at(images[still], c) + step * at(tangents[moved], c);
    };
    const cl_float4& m = case_.target.measured[i];
    const auto& [coverage, depth] = case_.scales.measured;
    Group of_colors{
        static_cast<double>(case_.target.weights[i]), static_cast<double>(case_.scales.color), {}};
    for (int c = 0; c < 3; ++c)
      of_colors.residuals.push_back(value(case_.colors, case_.tangents, c) - at(case_.target.colors[i], c));
    const bool shows = at(case_.depths[still], 3) > 0;
    return {of_colors,
            {at(m, 1) * static_cast<double>(coverage.weight),
             static_cast<double>(coverage.scale),
             {value(case_.colors, case_.tangents, 3) - at(m, 0)}},
            {shows ? at(m, 3) * static_cast<double>(depth.weight) : 0,
             static_cast<double>(depth.scale),
             {value(case_.depths, case_.depth_tangents, 0) -
              value(case_.depths, case_.depth_tangents, 3) * at(m, 2)}}};
  }

  const Case& case_;
  std::size_t view_;
};

struct Run {
  Run(const Case& c, const Device& device, PoseLight light = PoseLight::fixed)
      : sums(device, c.target, light, k_directions),
        colors(impl_of(device), c.colors),
        depths(impl_of(device), c.depths),
        tangents(impl_of(device), c.tangents),
        depth_tangents(impl_of(device), c.depth_tangents) {}

  HypothesisImages images() const { return {k_views, colors, colors, depths}; }
  std::vector<NormalEquations> linearize(const LossScales& scales) {
    return sums.linearize(images(), {tangents, tangents, depth_tangents}, scales);
  }

  NormalSums sums;
  Buffer<cl_float4> colors, depths, tangents, depth_tangents;
};

using test::difference;

std::size_t pixels_tried() { return test::is_reduced() ? 77 : 1337; }

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE(
      "normal equations of silhouettes and depths: sums in double precision, at every width of the lanes") {
    for (const unsigned lanes : {1U, 8U, 16U}) {
      const Device device = open_device(test::test_device().info().name);
      if (test::is_reduced() && lanes != device.info().lanes) continue;
      impl_of(device).info.lanes = lanes;
      for (const bool counts_colors : {true, false}) {
        CAPTURE(lanes);
        CAPTURE(counts_colors);
        const Case c(pixels_tried(), counts_colors);
        Run run(c, device);
        const std::vector<NormalEquations> found = run.linearize(c.scales);
        for (std::size_t view = 0; view < k_views; ++view) {
          const NormalEquations expected = Reference(c, view).equations();
          CHECK(found[view].loss == doctest::Approx(expected.loss).epsilon(1e-6));
          CHECK(difference(found[view].gradient, expected.gradient, k_directions) < 1e-5);
          CHECK(difference(found[view].hessian, expected.hessian, k_directions * k_directions) < 1e-5);
          CHECK(difference(found[view].scatter, expected.scatter, k_directions * k_directions) < 1e-5);
        }
      }
    }
  }

  TEST_CASE("normal equations of silhouettes and depths: the gradient is half of the loss's derivative") {
    const Case c(pixels_tried(), true);
    Run run(c, test::test_device());
    const std::vector<NormalEquations> found = run.linearize(c.scales);
    constexpr double k_step = 1e-4;
    for (std::size_t view = 0; view < k_views; ++view) {
      const Reference reference(c, view);
      PoseSpace::Step expected{};
      for (std::size_t k = 0; k < k_directions; ++k)
        expected[k] = (reference.loss(k, k_step) - reference.loss(k, -k_step)) / (4 * k_step);
      CHECK(difference(found[view].gradient, expected, k_directions) < 1e-4);
    }
  }

  TEST_CASE(
      "normal equations of silhouettes and depths: they add to those of colours in a light that is found") {
    const Case both(pixels_tried(), true), others(pixels_tried(), false);
    Case colors = both;
    colors.target.measured.clear();
    for (const PoseLight light : {PoseLight::gain, PoseLight::harmonics}) {
      Run run_both(both, test::test_device(), light), run_colors(colors, test::test_device(), light),
          run_others(others, test::test_device());
      const LossScales squares{.color = 0, .measured = both.scales.measured};
      const std::vector<NormalEquations> of_both = run_both.linearize(squares),
                                         of_colors = run_colors.linearize(squares),
                                         of_others = run_others.linearize(squares);
      const double part = run_others.sums.total() / run_both.sums.total();
      for (std::size_t view = 0; view < k_views; ++view) {
        NormalEquations sum = of_colors[view];
        sum.loss += part * of_others[view].loss;
        for (std::size_t k = 0; k < k_directions; ++k) sum.gradient[k] += part * of_others[view].gradient[k];
        for (std::size_t k = 0; k < k_directions * k_directions; ++k)
          sum.hessian[k] += part * of_others[view].hessian[k];
        CHECK(of_both[view].loss == doctest::Approx(sum.loss).epsilon(1e-6));
        CHECK(difference(of_both[view].gradient, sum.gradient, k_directions) < 1e-5);
        CHECK(difference(of_both[view].hessian, sum.hessian, k_directions * k_directions) < 1e-5);
      }
    }
  }

  TEST_CASE("normal equations of silhouettes and depths: deviations from medians of what tells something") {
    Case c(pixels_tried(), false);
    for (std::size_t i = 0; i < c.pixels; ++i) {
      c.colors[c.pixels + i] = c.depths[c.pixels + i] = cl_float4{};  // no object: no depths
      c.colors[2 * c.pixels + i].s[3] = c.target.measured[i].s[0] + (i % 2 == 0 ? 0.001F : 0.25F);
    }
    Run run(c, test::test_device());
    const std::vector<Deviations> found = run.sums.deviations(run.images());
    std::vector<double> sizes;
    for (std::size_t i = 0; i < c.pixels; ++i) {
      const cl_float4 &d = c.depths[i], &m = c.target.measured[i];
      if (at(d, 3) > 0 && at(m, 3) > 0) sizes.push_back(std::abs(at(d, 0) - at(d, 3) * at(m, 2)));
    }
    std::ranges::nth_element(sizes, sizes.begin() + std::ssize(sizes) / 2);
    REQUIRE(found[0][2].has_value());
    CHECK(static_cast<double>(*found[0][2]) ==
          doctest::Approx(1.4826 * sizes[sizes.size() / 2]).epsilon(1e-3));
    CHECK_FALSE(found[1][2].has_value());
    REQUIRE(found[2][1].has_value());
    CHECK(*found[2][1] == doctest::Approx(1.4826F * 0.25F).epsilon(1e-3));
  }
}

}  // namespace measured_sums_test
