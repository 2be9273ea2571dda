// The exact joint aggregation against the reference: weights, image and every gradient of synthetic pixels,
// from none to 300 fragments, from coincident to far apart, for each prior it serves; and the sorting it
// begins with.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>

#include "support/aggregate_errors.hpp"

namespace {

using dpr::Prior;
using dpr::Smoothing;
using dpr::test::AggregateErrors;
using dpr::test::compare_with_reference;
using dpr::test::reduced;
using dpr::test::SyntheticFragment;
using dpr::test::SyntheticFrame;
using dpr::test::SyntheticPixel;

/// Tolerances, about twice the errors measured; what is measured says dpr::test::AggregateErrors.
struct PriorCase {
  Prior prior;
  std::string_view name;
  double weight, color, depth, log_occupancy, gamma;
};

/// Measured over gamma 1e-7, 1e-2 and 1, up to 40 fragments:
///   prior     weight  colour  depth   ln p    gamma   wanted for the weights
///   gaussian  1.2e-6  4.2e-7  1.8e-5  1.7e-5  1.5e-5  5e-6
///   logistic  1.8e-6  2.5e-7  2.2e-5  4.7e-5  1.4e-5  2e-5
///   gumbel    9.4e-7  1.7e-7  4.4e-6  2.1e-5  2.3e-5  2e-5
/// With 300 fragments the error of ln p is 1.1e-4: each that shares a cluster leaves out 8e-7 of its mass.
constexpr std::array<PriorCase, 3> k_cases{
    {{Prior::gaussian, "gaussian", 2.4e-6, 8.4e-7, 3.6e-5, 3.4e-5, 3e-5},
     {Prior::logistic, "logistic", 3.6e-6, 5e-7, 4.4e-5, 9.4e-5, 3e-5},
     {Prior::gumbel, "gumbel", 1.9e-6, 3.4e-7, 9e-6, 4.2e-5, 4.6e-5}}};
constexpr double k_crowd_color = 5e-7, k_crowd_log_occupancy = 2.2e-4;
constexpr double k_alpha = 2e-7;  // of the image; measured 9.5e-8

Smoothing joint(Prior prior, float gamma) {
  Smoothing smoothing;
  smoothing.depth_prior = prior;
  smoothing.gamma = gamma;
  smoothing.composition = dpr::Composition::joint;
  return smoothing;
}

AggregateErrors all_errors(Prior prior) {
  AggregateErrors errors;
  unsigned seed = 21;
  for (const float gamma : {1e-7F, 1e-2F, 1.0F}) {
    compare_with_reference(dpr::test::make_pixels(gamma, seed++), joint(prior, gamma), errors);
  }
  return errors;
}

/// Pixels of 300 fragments, whose errors are larger: each fragment leaves out a little of its mass.
AggregateErrors crowd_errors(Prior prior) {
  AggregateErrors errors;
  compare_with_reference(dpr::test::make_crowds(1e-2F, 98), joint(prior, 1e-2F), errors);
  return errors;
}

std::vector<SyntheticPixel> sort_cases() {
  dpr::test::RandomFloat random(3);
  std::vector<SyntheticPixel> pixels;
  for (const int count :
       {0, 1, 2, 3, reduced(23, 4), reduced(24, 5), reduced(25, 26), reduced(26, 6), reduced(300, 27)}) {
    SyntheticPixel pixel = dpr::test::make_pixel(count, 50, 1e-2F, dpr::test::Occupancies::any, random);
    for (std::size_t k = 3; k < pixel.size(); k += 4) pixel[k].depth = pixel[k - 1].depth;  // equal depths
    pixels.push_back(pixel);
    std::ranges::sort(pixel, {}, &SyntheticFragment::depth);
    pixels.push_back(pixel);
    std::ranges::reverse(pixel);
    pixels.push_back(pixel);
  }
  return pixels;
}

/// By depth within every pixel, equal depths by number.
bool is_sorted_by_depth(const std::vector<SyntheticPixel>& pixels, const std::vector<cl_uint>& list,
                        const std::vector<float>& depths) {
  std::size_t at = 0;
  for (const SyntheticPixel& pixel : pixels) {
    for (std::size_t k = 1; k < pixel.size(); ++k) {
      const cl_uint before = list[at + k - 1], after = list[at + k];
      if (depths[before] > depths[after] || (depths[before] == depths[after] && before >= after))
        return false;
    }
    at += pixel.size();
  }
  return at == list.size();
}

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("joint aggregation: weights, image and gradients are the reference's") {
    for (const PriorCase& c : k_cases) {
      CAPTURE(std::string(c.name));
      const AggregateErrors errors = all_errors(c.prior);
      DPR_CHECK_WORST(errors.weight, c.weight);
      DPR_CHECK_WORST(errors.color, c.color);
      DPR_CHECK_WORST(errors.alpha, k_alpha);
      DPR_CHECK_WORST(errors.grad_depth, c.depth);
      DPR_CHECK_WORST(errors.grad_log_occupancy, c.log_occupancy);
      DPR_CHECK_WORST(errors.grad_gamma, c.gamma);
      CHECK(errors.grad_alpha.error == 0.0);
    }
  }

  TEST_CASE("joint aggregation: 300 fragments in a pixel") {
    for (const PriorCase& c : k_cases) {
      CAPTURE(std::string(c.name));
      const AggregateErrors errors = crowd_errors(c.prior);
      DPR_CHECK_WORST(errors.weight, c.weight);
      DPR_CHECK_WORST(errors.color, k_crowd_color);
      DPR_CHECK_WORST(errors.alpha, k_alpha);
      DPR_CHECK_WORST(errors.grad_depth, c.depth);
      DPR_CHECK_WORST(errors.grad_log_occupancy, k_crowd_log_occupancy);
      DPR_CHECK_WORST(errors.grad_gamma, c.gamma);
    }
  }

  TEST_CASE("joint aggregation: results that are off by a few per cent are found out") {
    for (const PriorCase& c : k_cases) {
      CAPTURE(std::string(c.name));
      AggregateErrors bad;
      const std::vector<SyntheticPixel> pixels = dpr::test::make_pixels(1e-2F, 4);
      const std::vector<SyntheticPixel> few(pixels.begin(),
                                            pixels.begin() + (dpr::test::is_reduced() ? 8 : 24));
      compare_with_reference(few, joint(c.prior, 1e-2F), bad, 1.03F);
      CHECK(bad.weight.error > c.weight);
      CHECK(bad.color.error > c.color);
      CHECK(bad.alpha.error > k_alpha);
      CHECK(bad.grad_depth.error > c.depth);
      CHECK(bad.grad_log_occupancy.error > c.log_occupancy);
      CHECK(bad.grad_gamma.error > c.gamma);
    }
  }
}

TEST_SUITE("unit") {
  TEST_CASE("joint aggregation: every pixel's fragments are sorted by depth, equal depths by number") {
    const std::vector<SyntheticPixel> pixels = sort_cases();
    SyntheticFrame frame(pixels);
    const std::vector<float> depths = frame.depths();
    std::vector<cl_uint> before = frame.list();
    CHECK_FALSE(is_sorted_by_depth(pixels, before, depths));
    frame.forward(joint(Prior::gaussian, 1e-2F), dpr::test::k_background);
    std::vector<cl_uint> after = frame.list();
    CHECK(is_sorted_by_depth(pixels, after, depths));
    std::size_t at = 0;  // the same fragments as before
    for (const SyntheticPixel& pixel : pixels) {
      const auto end = static_cast<std::ptrdiff_t>(at + pixel.size());
      std::sort(before.begin() + static_cast<std::ptrdiff_t>(at), before.begin() + end);
      std::sort(after.begin() + static_cast<std::ptrdiff_t>(at), after.begin() + end);
      at += pixel.size();
    }
    CHECK(before == after);
  }

  TEST_CASE("joint aggregation: far apart it is front-to-back compositing, colour and alpha agree") {
    const SyntheticFragment front{2.0F, 0.25F, glm::vec3(1, 0, 0)}, back{50.0F, 0.5F, glm::vec3(0, 1, 0)};
    SyntheticFrame frame({{back, front}, {front}, {}});
    const auto image = frame.forward(joint(Prior::gaussian, 1e-4F), glm::vec3(0, 0, 1));
    const float tolerance = 1e-6F;
    CHECK(std::abs(image[0].s[0] - 0.25F) < tolerance);
    CHECK(std::abs(image[0].s[1] - 0.375F) < tolerance);
    CHECK(std::abs(image[0].s[2] - 0.375F) < tolerance);
    CHECK(std::abs(image[0].s[3] - 0.625F) < tolerance);
    CHECK(std::abs(image[1].s[0] - 0.25F) < tolerance);
    CHECK(image[2].s[2] == 1.0F);
    CHECK(image[2].s[3] == 0.0F);
  }

  TEST_CASE("joint aggregation: what an opaque fragment hides has no weight and no gradient") {
    const SyntheticFragment front{2.0F, 1.0F, glm::vec3(1, 0, 0)}, back{50.0F, 0.5F, glm::vec3(0, 1, 0)};
    SyntheticFrame frame({{back, front}});
    frame.forward(joint(Prior::gaussian, 1e-3F), dpr::test::k_background);
    const SyntheticFrame::Gradients g = frame.backward(dpr::test::k_background, {{{1, 1, 1, 1}}});
    CHECK(g.green[0][0] == 0.0F);
    CHECK(g.depth[0][0] == 0.0F);
    CHECK(g.log_occupancy[0][0] == 0.0F);
    CHECK(std::abs(g.red[0][1] - 1.0F) < 1e-6F);
  }

  TEST_CASE("joint aggregation: priors without a kernel are refused before anything is built") {
    CHECK_THROWS_AS(dpr::validate(joint(Prior::cauchy, 1e-2F)), dpr::InvalidArgument);
    CHECK_THROWS_AS(dpr::validate(joint(Prior::uniform, 1e-2F)), dpr::InvalidArgument);
    for (const PriorCase& c : k_cases) CHECK_NOTHROW(dpr::validate(joint(c.prior, 1e-2F)));
  }
}
