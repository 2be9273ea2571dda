// The named members of the family against the formulas they are known by, evaluated in double precision from
// the rasterizer's own distances and depths.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "check/fragments.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "reference/aggregate.hpp"
#include "reference/occupancy.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/reduced.hpp"

namespace presets_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

/// Two triangles, one partly in front of the other, with colours of their own.
Scene two_triangles(int width, int height) {
  Mesh mesh;
  mesh.positions = {{-0.9F, -0.8F, 0.2F},  {0.7F, -0.5F, 0.1F},  {-0.1F, 0.9F, 0.3F},
                    {-0.4F, -0.3F, -0.4F}, {1.0F, -0.2F, -0.5F}, {0.4F, 1.0F, -0.3F}};
  mesh.faces = {{0, 1, 2}, {3, 4, 5}};
  mesh.face_colors = {{0.9F, 0.2F, 0.1F}, {0.1F, 0.7F, 0.8F}};
  Scene scene = scene_of(std::move(mesh), width, height);
  scene.camera = Camera{};
  scene.camera.view[3] = {0.03F, -0.02F, -2.6F, 1.0F};
  scene.camera.znear = 1;
  scene.camera.zfar = 10;
  scene.smoothing = smoothing_preset("gaussian");
  scene.meshes[0].transform = glm::mat4(1.0F);
  return scene;
}

double largest_error(const glm::vec4& found, const glm::dvec3& color, double alpha) {
  const glm::dvec4 error = glm::abs(glm::dvec4(found) - glm::dvec4(color, alpha));
  return std::max(std::max(error.x, error.y), std::max(error.z, error.w));
}

double alpha_of(const std::vector<double>& occupancies) {
  double left = 1;
  for (const double p : occupancies) left *= 1 - p;
  return 1 - left;
}

/// Renders, and compares every pixel with what `formula` makes of its fragments: colour and alpha.
template <typename Formula>
double worst_pixel(Renderer& renderer, Formula formula) {
  renderer.forward();
  const Image image = renderer.image();
  const std::vector<Pixel> pixels = pixels_of(renderer);
  double worst = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const glm::dvec4 expected = formula(pixels[i]);
    worst = std::max(worst, largest_error(image.pixels[i], glm::dvec3(expected), expected.w));
  }
  return worst;
}

/// Rigid depths: front to back, each fragment with its occupancy. Equal depths do not occur.
glm::dvec4 composite(Pixel pixel, const std::vector<double>& occupancies, const glm::dvec3& background) {
  std::vector<std::size_t> order(pixel.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) { return pixel[a].depth < pixel[b].depth; });
  glm::dvec3 color(0);
  double left = 1;
  for (const std::size_t i : order) {
    color += left * occupancies[i] * pixel[i].color;
    left *= 1 - occupancies[i];
  }
  return {color + left * background, 1 - left};
}

template <typename Occupancy>
std::vector<double> occupancies(const Pixel& pixel, Occupancy occupancy) {
  std::vector<double> list;
  for (const Fragment& f : pixel) list.push_back(occupancy(f.distance));
  return list;
}

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }
double ramp(double x) { return std::clamp(x + 0.5, 0.0, 1.0); }

Image constant_gradient(const Scene& scene) { return {scene.width, scene.height, {0.7F, -0.4F, 0.5F, 0.3F}}; }

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("softras: sigmoid of the squared distance, softmax of the depths") {
    Scene scene = two_triangles(reduced(40, 12), reduced(32, 10));
    scene.smoothing = smoothing_preset("softras");
    scene.smoothing.background_depth = 0.5F;  // epsilon of the softmax: at 1e-10 the background has no weight
    scene.smoothing.gamma = 0.05F;
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const Smoothing& s = scene.smoothing;
    const double sigma = static_cast<double>(s.sigma), gamma = static_cast<double>(s.gamma);
    const auto formula = [&](double scale) {
      return [&, scale](const Pixel& pixel) {
        const double epsilon = static_cast<double>(s.background_depth);
        double sum = std::exp(epsilon / gamma);
        glm::dvec3 color = sum * glm::dvec3(scene.background);
        const std::vector<double> d =
            occupancies(pixel, [&](double x) { return sigmoid(scale * x / sigma); });
        for (std::size_t j = 0; j < pixel.size(); ++j) {
          const double weight = d[j] * std::exp(zeta(scene, pixel[j].depth) / gamma);
          sum += weight;
          color += weight * pixel[j].color;
        }
        return glm::dvec4(color / sum, alpha_of(d));
      };
    };
    CHECK(worst_pixel(renderer, formula(1)) < 2e-5);
    CHECK(worst_pixel(renderer, formula(1.01)) > 2e-4);
  }

  TEST_CASE("opendr: a linear ramp one pixel wide, for images of any size") {
    Renderer renderer(open_device());
    for (const glm::ivec2 size : {glm::ivec2(40, 32), glm::ivec2(17, 31)}) {
      Scene scene = two_triangles(size.x, size.y);
      scene.smoothing = smoothing_preset("opendr", size.x, size.y);
      renderer.set_scene(scene);
      const double pixel_width = 2.0 / std::min(size.x, size.y);
      const auto formula = [&](double scale) {
        return [&, scale](const Pixel& pixel) {
          const auto p = occupancies(pixel, [&](double d) { return ramp(scale * d / pixel_width); });
          return composite(pixel, p, glm::dvec3(scene.background));
        };
      };
      // Fragments below an occupancy of 1e-4 are left out.
      CHECK(worst_pixel(renderer, formula(1)) < 1.1e-4);
      CHECK(worst_pixel(renderer, formula(1.01)) > 1e-3);
    }
  }

  TEST_CASE("opendr: dp/dd is 1 / pixel within half a pixel of an edge, 0 elsewhere") {
    Scene scene = two_triangles(40, 32);
    scene.meshes[0].mesh.faces.pop_back();
    scene.meshes[0].mesh.face_colors.pop_back();
    scene.smoothing = smoothing_preset("opendr", 40, 32);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const Image grad = constant_gradient(scene);
    renderer.backward(std::span(&grad, 1));
    const std::vector<float> found =
        impl_of(renderer).rasterize.grad_plane(impl_of(renderer).frame, DPR_PLANE_DISTANCE);
    int edge = 0;
    for (const Pixel& pixel : pixels_of(renderer)) {
      for (const Fragment& f : pixel) {
        const double by_p = glm::dot(glm::dvec3(grad.pixels[0]), f.color - glm::dvec3(scene.background)) +
                            static_cast<double>(grad.pixels[0].a);
        const double expected = std::abs(f.distance) < 1.0 / 32 ? by_p * 16 : 0;
        CHECK(static_cast<double>(found[f.index]) == doctest::Approx(expected).epsilon(1e-4));
        if (expected != 0) ++edge;
      }
    }
    CHECK(edge > 40);
  }

  TEST_CASE("nmr: the rigid image, and the change of a pixel's colour over the distance to the edge") {
    const Device device = open_device();
    Scene scene = two_triangles(reduced(40, 12), reduced(32, 10));
    scene.smoothing = smoothing_preset("nmr");
    Renderer renderer(device);
    renderer.set_scene(scene);
    const glm::dvec3 background(scene.background);
    const auto covers = [](double d) { return d > 0 ? 1.0 : 0.0; };
    CHECK(worst_pixel(renderer, [&](const Pixel& pixel) {
            return composite(pixel, occupancies(pixel, covers), background);
          }) < 1e-5);

    const Image grad = constant_gradient(scene);
    const SceneGradient gradient = renderer.backward(std::span(&grad, 1));
    CHECK(gradient.sigma == 0);  // which the image does not depend on
    const std::vector<float> found =
        impl_of(renderer).rasterize.grad_plane(impl_of(renderer).frame, DPR_PLANE_DISTANCE);
    const glm::dvec4 g(grad.pixels[0]);
    double worst = 0, worst_of_half = 0;
    int outside = 0, hidden = 0;
    for (const Pixel& pixel : pixels_of(renderer)) {
      for (std::size_t k = 0; k < pixel.size(); ++k) {
        // The pixel with the fragment, and without it.
        std::vector<double> p = occupancies(pixel, covers);
        p[k] = 1;
        const glm::dvec4 with = composite(pixel, p, background);
        p[k] = 0;
        const glm::dvec4 change = with - composite(pixel, p, background);
        const double slope = 1 / (std::abs(pixel[k].distance) + 1e-3);
        const double expected = glm::dot(g, change) * slope, got = static_cast<double>(found[pixel[k].index]);
        worst = std::max(worst, std::abs(got - expected) / slope);
        worst_of_half = std::max(worst_of_half, std::abs(got - 0.5 * expected) / slope);
        if (pixel[k].distance < 0 && expected != 0) ++outside;
        if (change == glm::dvec4(0)) ++hidden;
      }
    }
    CHECK(worst < 1e-4);
    CHECK(worst_of_half > 0.1);
    CHECK(outside > 10);
    CHECK(hidden > 10);
  }

  TEST_CASE("nmr: triangles that are out of sight are pulled by pixels half an image away") {
    const Device device = open_device();
    Scene scene = two_triangles(24, 24);
    scene.meshes[0].mesh.faces.pop_back();
    scene.meshes[0].mesh.face_colors.pop_back();
    scene.gradients.smoothing = false;
    scene.smoothing = smoothing_preset("nmr");
    Renderer renderer(device);
    renderer.set_scene(scene);
    renderer.forward();
    Image grad(24, 24);
    grad.at(16, 6).a = -1;  // more coverage up on the right
    REQUIRE(renderer.image().at(16, 6).a < 1e-5F);
    const SceneGradient gradient = renderer.backward(std::span(&grad, 1));
    const glm::dvec3 pull = -gradient.views[0].transforms[0].translation;
    CHECK(pull.x > 0.1);
    CHECK(pull.y > 0.1);
  }

  TEST_CASE("gaussian: occupancies in the logarithm; joint_gaussian: the expectation of the rigid image") {
    for (const bool is_joint : {false, true}) {
      CAPTURE(is_joint);
      Scene scene = two_triangles(reduced(24, 8), reduced(20, 8));
      scene.smoothing = smoothing_preset(is_joint ? "joint_gaussian" : "gaussian");
      scene.smoothing.gamma = 0.04F;            // the depths of the two mix
      scene.smoothing.background_depth = 0.5F;  // and in the barrier with the background
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      const auto formula = [&](double scale) {
        return [&, scale](const Pixel& pixel) {
          reference::AggregateParameters p;
          p.composition = is_joint ? reference::Composition::joint : reference::Composition::barrier;
          p.gamma = scale * static_cast<double>(scene.smoothing.gamma);
          p.znear = 1;
          p.zfar = 10;
          p.background_depth = static_cast<double>(scene.smoothing.background_depth);
          p.background = {static_cast<double>(scene.background.x), static_cast<double>(scene.background.y),
                          static_cast<double>(scene.background.z)};
          std::vector<reference::FragmentInput> fragments;
          for (const Fragment& f : pixel) {
            const reference::Occupancy o = reference::occupancy_forward(
                reference::Prior::gaussian, f.distance, static_cast<double>(scene.smoothing.sigma));
            fragments.push_back({f.depth, o.p, o.log_p, {f.color.x, f.color.y, f.color.z}});
          }
          const reference::AggregateResult r = reference::aggregate_forward(fragments, p);
          return glm::dvec4(r.color.x, r.color.y, r.color.z, r.silhouette);
        };
      };
      CHECK(worst_pixel(renderer, formula(1)) < 1e-5);
      CHECK(worst_pixel(renderer, formula(1.05)) > 1e-4);
    }
  }
}

TEST_SUITE("statistical") {
  TEST_CASE("paper_gaussian, paper_cauchy: M samples of coverage, then M samples of depth") {
    // A single triangle: k of M samples cover with a binomial probability of p = F(s / sigma), (35), (36).
    // Then b = zeta + (gamma / alpha) ln(k / M) wins against the background with F2((b - b0) / gamma), F2
    // being the distribution of a difference of two noises: of Gaussians sqrt(2) wide, of Cauchys 2 wide.
    for (const bool is_cauchy : {false, true}) {
      Scene scene = two_triangles(reduced(20, 6), reduced(16, 6));
      scene.meshes[0].mesh.faces.pop_back();
      scene.meshes[0].mesh.face_colors.pop_back();
      scene.smoothing = smoothing_preset(is_cauchy ? "paper_cauchy" : "paper_gaussian");
      scene.smoothing.sigma = 2e-2F;
      scene.smoothing.blur_radius = 0.1F;
      scene.smoothing.background_depth = 0.8F;  // so that both win sometimes
      scene.smoothing.gamma = 3e-2F;
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      const Smoothing& s = scene.smoothing;
      const auto cdf = [&](double x, double width) {
        return is_cauchy ? 0.5 + std::atan(x / (width * width)) / std::numbers::pi
                         : 0.5 * std::erfc(-x / width / std::numbers::sqrt2);
      };
      const int runs = reduced(1000, 20);
      std::vector<double> mean(static_cast<std::size_t>(scene.width * scene.height));
      for (int run = 0; run < runs; ++run) {
        Smoothing seeded = s;
        seeded.seed = static_cast<std::uint64_t>(run);
        renderer.set_smoothing(seeded);
        renderer.forward();
        const Image image = renderer.image();
        for (std::size_t i = 0; i < mean.size(); ++i)
          mean[i] += static_cast<double>(image.pixels[i].r) / runs;
      }
      const std::vector<Pixel> pixels = pixels_of(renderer);
      double worst = 0, most_covered = 0, worst_of_exact = 0;
      const int samples = static_cast<int>(s.samples);
      for (std::size_t i = 0; i < pixels.size(); ++i) {
        if (pixels[i].empty()) continue;
        const Fragment& f = pixels[i][0];
        const double p = cdf(f.distance / static_cast<double>(s.sigma), 1),
                     gamma = static_cast<double>(s.gamma);
        const auto wins = [&](double occupancy) {
          const double b = zeta(scene, f.depth) + gamma * std::log(occupancy);
          return cdf((b - static_cast<double>(s.background_depth)) / gamma, std::numbers::sqrt2);
        };
        // Mean and variance of the triangle's share of the samples.
        double weight = 0, variance = 0, choose = 1;
        for (int k = 0; k <= samples; ++k) {
          const double probability = choose * std::pow(p, k) * std::pow(1 - p, samples - k);
          const double w = k > 0 ? wins(1.0 * k / samples) : 0;
          weight += probability * w;
          variance += probability * (w * w + w * (1 - w) / samples);
          choose = choose * (samples - k) / (k + 1);
        }
        if (weight * runs * samples < 40) continue;  // too rare for a normal distribution of the mean
        variance -= weight * weight;
        const double background = static_cast<double>(scene.background.r);
        const double error = std::sqrt(variance / runs) * std::abs(f.color.r - background);
        const auto distance = [&](double w) {
          return std::abs(mean[i] - (background + w * (f.color.r - background))) / error;
        };
        worst = std::max(worst, distance(weight));
        worst_of_exact = std::max(worst_of_exact, distance(wins(p)));
        most_covered = std::max(most_covered, weight);
      }
      CAPTURE(is_cauchy);
      MESSAGE("worst: " << worst << " standard errors");
      CHECK(worst < 4.5);  // of 300 pixels the worst is beyond 4 in 2% of all runs
      if (!dpr::test::is_reduced()) CHECK(worst_of_exact > 8);
      if (!dpr::test::is_reduced()) CHECK(most_covered > 0.5);
    }
  }
}

}  // namespace presets_test
