// Standard errors of sampled images and gradients against the spread of many seeds, and the samples suggested
// for a wanted one against the error that they have.
#include "dpr/sampling_error.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace sampling_error_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

Scene sampled_scene(int size) {
  Scene scene = cube_scene(size, size);
  scene.smoothing.aggregation_estimator = Estimator::monte_carlo;
  scene.smoothing.samples = 8;
  return scene;
}

double rms(const std::vector<double>& values) {
  return norm(values) / std::sqrt(static_cast<double>(values.size()));
}

std::vector<double> numbers(const Image& image) {
  std::vector<double> values;
  for (const glm::vec4& p : image.pixels) append(values, glm::vec3(p));
  return values;
}

std::vector<double> numbers(const std::vector<glm::vec3>& list) {
  std::vector<double> values;
  for (const glm::vec3& v : list) append(values, v);
  return values;
}

/// Gradients of a pixel's fragments: dL/dz and dL/ds in scales of their noise, one after the other.
std::vector<double> scaled_fragment_gradients(const Renderer& renderer) {
  const Renderer::Impl& m = impl_of(renderer);
  const std::vector<float> depth = m.rasterize.grad_plane(m.frame, DPR_PLANE_DEPTH),
                           distance = m.rasterize.grad_plane(m.frame, DPR_PLANE_DISTANCE);
  const Smoothing& s = m.scene.smoothing;
  const float range = m.scene.camera.zfar - m.scene.camera.znear;
  std::vector<double> values;
  for (const cl_uint k : m.rasterize.list.download()) {
    values.push_back(static_cast<double>(depth[k]) * static_cast<double>(s.gamma * range));
    values.push_back(static_cast<double>(distance[k]) * static_cast<double>(s.sigma));
  }
  return values;
}

/// Standard deviations over many seeds by plain sums.
class Deviations {
 public:
  void add(const std::vector<double>& values) {
    sum_.resize(values.size());
    squares_.resize(values.size());
    for (std::size_t i = 0; i < values.size(); ++i) {
      sum_[i] += values[i];
      squares_[i] += values[i] * values[i];
    }
    ++count_;
  }
  std::vector<double> all() const {
    std::vector<double> result;
    for (std::size_t i = 0; i < sum_.size(); ++i) {
      const double variance = (squares_[i] - sum_[i] * sum_[i] / count_) / (count_ - 1);
      result.push_back(std::sqrt(std::max(variance, 0.0)));
    }
    return result;
  }

 private:
  std::vector<double> sum_, squares_;
  double count_ = 0;
};

}  // namespace

TEST_SUITE("statistical") {
  TEST_CASE("sampling error: as large as the spread of many seeds") {
    const int size = reduced(16, 6), seeds = reduced(200, 30);
    Renderer renderer(open_device());
    Scene scene = sampled_scene(size);
    renderer.set_scene(scene);
    const Image grad = random_image(size, size, -1.0F, 1.0F);
    const SamplingError error =
        estimate_sampling_error(renderer, std::span(&grad, 1), static_cast<unsigned>(reduced(64, 20)));
    Deviations image, fragments, positions, gamma;
    for (int seed = 1000; seed < 1000 + seeds; ++seed) {
      scene.smoothing.seed = static_cast<std::uint64_t>(seed);
      renderer.set_smoothing(scene.smoothing);
      renderer.forward();
      const SceneGradient gradient = renderer.backward(std::span(&grad, 1));
      image.add(numbers(renderer.image()));
      fragments.add(scaled_fragment_gradients(renderer));
      positions.add(numbers(gradient.meshes[0].positions));
      gamma.add({gradient.gamma});
    }
    // Deviations of 64 and 200 replicates are known to 9% and 5%; their root mean squares far better.
    const double loose = reduced(30, 100) / 100.0, tight = reduced(10, 40) / 100.0;
    CHECK(error.image_rms() == doctest::Approx(rms(image.all())).epsilon(tight));
    CHECK(rms(numbers(error.images[0])) == doctest::Approx(error.image_rms()).epsilon(1e-6));
    double pixel_squares = 0;
    for (const float e : error.pixel_gradients[0]) pixel_squares += std::pow(static_cast<double>(e), 2);
    CHECK(std::sqrt(pixel_squares) == doctest::Approx(norm(fragments.all())).epsilon(tight));
    CHECK(rms(numbers(error.gradient.meshes[0].positions)) ==
          doctest::Approx(rms(positions.all())).epsilon(tight));
    CHECK(error.gradient.gamma == doctest::Approx(gamma.all()[0]).epsilon(loose));
    CHECK(error.image_rms() > 1e-3);
    CHECK(error.gradient.sigma > 0);
  }

  TEST_CASE("sampling error: the suggested samples have the wanted error") {
    const int size = reduced(24, 8);
    Renderer renderer(open_device());
    Scene scene = sampled_scene(size);
    renderer.set_scene(scene);
    const Image grad = random_image(size, size, -1.0F, 1.0F);
    const unsigned replicates = static_cast<unsigned>(reduced(24, 12));
    const SamplingError few = estimate_sampling_error(renderer, std::span(&grad, 1), replicates);
    const double wanted = few.image_rms() / 4;
    scene.smoothing.samples = suggest_samples(few.image_rms(), few.samples, wanted);
    CHECK(scene.smoothing.samples == 128);
    renderer.set_smoothing(scene.smoothing);
    const SamplingError many = estimate_sampling_error(renderer, std::span(&grad, 1), replicates);
    const double tolerance = reduced(10, 30) / 100.0;
    CHECK(many.image_rms() == doctest::Approx(wanted).epsilon(tolerance));
    // Gradients follow the same law.
    CHECK(rms(numbers(many.gradient.meshes[0].positions)) ==
          doctest::Approx(rms(numbers(few.gradient.meshes[0].positions)) / 4).epsilon(2 * tolerance));
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("sampling error: exact estimators have none") {
    Scene scene = cube_scene(8, 8);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const Image target(8, 8, glm::vec4(0.5F));
    ImageLoss loss(renderer.device(), LossWeights::only(LossKind::mse), std::span(&target, 1));
    const SamplingError error = estimate_sampling_error(renderer, loss);
    CHECK(error.image_rms() == 0);
    CHECK(norm(numbers(error.gradient.meshes[0].positions)) == 0);
    CHECK(error.gradient.meshes[0].positions.size() == scene.meshes[0].mesh.positions.size());
    for (const float e : error.pixel_gradients[0]) CHECK(e == 0);
    CHECK(suggest_samples(error.image_rms(), error.samples, 1e-3) == 1);
  }

  TEST_CASE("sampling error: leaves the renderer with the frame of its own seed") {
    Scene scene = sampled_scene(8);
    scene.smoothing.seed = 77;
    scene.gradients.smoothing = false;
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const Image before = renderer.image();
    const Image target(8, 8, glm::vec4(0.5F));
    ImageLoss loss(renderer.device(), LossWeights::only(LossKind::mse), std::span(&target, 1));
    const SamplingError error = estimate_sampling_error(renderer, loss, 3);
    CHECK(renderer.image().pixels == before.pixels);
    CHECK(renderer.scene().smoothing.seed == 77);
    CHECK_FALSE(renderer.scene().gradients.smoothing);
    CHECK(error.replicates == 3);
    CHECK(error.samples == 8);
    CHECK(error.gradient.sigma == 0);  // not asked for
    CHECK(norm(numbers(error.gradient.meshes[0].positions)) > 0);
  }

  TEST_CASE("sampling error: several views have an image each") {
    Scene scene = sampled_scene(8);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const std::vector<View> views(2, renderer.views().front());
    renderer.set_views(views);
    const std::vector<Image> grads(2, random_image(8, 8, -1.0F, 1.0F));
    const SamplingError error = estimate_sampling_error(renderer, grads, 4);
    REQUIRE(error.images.size() == 2);
    REQUIRE(error.pixel_gradients.size() == 2);
    CHECK(error.images[0].pixels != error.images[1].pixels);  // the noise knows the view
    CHECK(error.gradient.views.size() == 2);
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("sampling error: the same after a larger frame") {
    const int size = reduced(64, 8);
    Scene scene = sampled_scene(size);
    scene.smoothing.samples = 2;
    const Device device = open_device();
    const Image grad = random_image(size, size, -1.0F, 1.0F);
    Renderer fresh(device), used(device);
    fresh.set_scene(scene);
    Smoothing wide = scene.smoothing;
    wide.sigma *= 3;
    used.set_scene(scene);
    used.set_smoothing(wide);
    used.forward();
    used.image();
    used.set_smoothing(scene.smoothing);
    const SamplingError expected = estimate_sampling_error(fresh, std::span(&grad, 1), 4);
    const SamplingError found = estimate_sampling_error(used, std::span(&grad, 1), 4);
    CHECK(found.pixel_gradients == expected.pixel_gradients);
    CHECK(numbers(found.gradient.meshes[0].positions) == numbers(expected.gradient.meshes[0].positions));
  }

  TEST_CASE("sampling error: of shapes of the views' own, as of the scene's") {
    Scene scene = sampled_scene(8);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const Image grad = random_image(8, 8, -1.0F, 1.0F);
    const SamplingError shared = estimate_sampling_error(renderer, std::span(&grad, 1), 4);
    const Mesh& mesh = scene.meshes[0].mesh;
    renderer.set_shapes(mesh.positions, mesh.face_colors);
    const SamplingError own = estimate_sampling_error(renderer, std::span(&grad, 1), 4);
    CHECK(numbers(own.gradient.shapes.positions) == numbers(shared.gradient.meshes[0].positions));
    CHECK(numbers(own.gradient.shapes.colors) == numbers(shared.gradient.meshes[0].colors));
    CHECK(norm(numbers(own.gradient.shapes.positions)) > 0);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("sampling error: what cannot be measured is refused") {
    Renderer renderer(open_device());
    const Image grad(8, 8), wrong(7, 8);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, estimate_sampling_error(renderer, std::span(&grad, 1)),
                          "set_scene");
    Scene scene = sampled_scene(8);
    scene.smoothing.seed = 5;
    renderer.set_scene(scene);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, estimate_sampling_error(renderer, std::span(&grad, 1), 1),
                          "at least 2");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, estimate_sampling_error(renderer, std::span(&wrong, 1)), "7x8");
    CHECK(renderer.scene().smoothing.seed == 5);
    renderer.forward();
    const Image own = renderer.image();
    renderer.set_smoothing(scene.smoothing);
    renderer.forward();
    CHECK(renderer.image().pixels == own.pixels);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, suggest_samples(-1, 8, 0.1), "error (suggest_samples)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, suggest_samples(1, 8, 0), "wanted (suggest_samples)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, suggest_samples(1, 0, 1), "samples (suggest_samples)");
    CHECK(suggest_samples(0, 8, 0.1) == 1);
    CHECK(suggest_samples(1, 8, 1e-9) == 1U << 20U);
  }
}

}  // namespace sampling_error_test
