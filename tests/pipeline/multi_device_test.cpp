// Views on several devices: the same bits whoever renders them, the same values as one renderer with all of
// them.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstring>
#include <glm/gtc/matrix_transform.hpp>
#include <numeric>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "renderer/setter_checks.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/several_devices.hpp"

namespace multi_device_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::is_divisible;
using dpr::test::reduced;
using dpr::test::several_devices;

namespace {

Scene small_scene() {
  const int size = reduced(24, 6);
  Scene scene = cube_scene(size, size + 1);
  scene.lights = every_light(Shading::phong);
  scene.gradients.lights = true;
  return scene;
}

/// A ring of cameras around the scene; more views than chunks, and not a multiple of them.
std::vector<View> ring(const Scene& scene, std::size_t count) {
  std::vector<View> views;
  for (std::size_t v = 0; v < count; ++v) {
    Camera camera = scene.camera;
    const float turn = 6.2831853F * static_cast<float>(v) / static_cast<float>(count);
    camera.view = camera.view * glm::rotate(glm::mat4(1.0F), turn, glm::vec3(0.1F, 1.0F, 0.2F));
    views.push_back({camera, {scene.meshes[0].transform}});
  }
  return views;
}

std::vector<Image> random_images(const Scene& scene, std::size_t count) {
  std::vector<Image> images;
  for (std::size_t v = 0; v < count; ++v)
    images.push_back(random_image(scene.width, scene.height, 0.0F, 1.0F, 40 + static_cast<unsigned>(v)));
  return images;
}

struct Result {
  std::vector<double> values;  // images, losses, gradients
  std::vector<std::size_t> views_rendered;
};

void append(const SceneGradient& gradient, std::vector<double>& values) {
  for (const Block& block : blocks_of(gradient)) {
    for (const double value : block.found) values.push_back(value);
  }
}

Result render(std::vector<Device> devices, const Scene& scene, std::size_t views) {
  MultiDeviceRenderer renderer(std::move(devices));
  renderer.set_scene(scene);
  renderer.set_views(ring(scene, views));
  const std::vector<Image> targets = random_images(scene, views);
  renderer.set_loss({.mse = 1.0F, .silhouette = 0.5F}, targets);
  Result result;
  for (const Image& image : renderer.render()) {
    for (const glm::vec4& p : image.pixels) {
      for (int k = 0; k < 4; ++k) result.values.push_back(static_cast<double>(p[k]));
    }
  }
  const MultiDeviceRenderer::Evaluation evaluation = renderer.evaluate();
  result.values.push_back(evaluation.loss);
  result.values.insert(result.values.end(), evaluation.per_view.begin(), evaluation.per_view.end());
  append(evaluation.gradient, result.values);
  append(renderer.gradient(targets), result.values);
  result.views_rendered = renderer.views_rendered();
  return result;
}

bool same_bits(const Result& a, const Result& b) {
  return a.values.size() == b.values.size() &&
         std::memcmp(a.values.data(), b.values.data(), a.values.size() * sizeof(double)) == 0;
}

std::size_t total(const std::vector<std::size_t>& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::size_t{0});
}

Scene sampled(Scene scene) {
  scene.smoothing.occupancy_estimator = scene.smoothing.aggregation_estimator = Estimator::monte_carlo;
  return scene;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("losses of attributes in chunks are those of one renderer with all views") {
    const Scene scene = small_scene();
    const std::vector<View> views = ring(scene, 3);
    const std::vector<Image> targets = random_images(scene, 3);
    const std::vector<AttributeTarget> attributes{{Attribute::depth, {.l1 = 0.5F}, targets},
                                                  {Attribute::normal, {.mse = 0.2F}, targets}};
    const LossOptions options{.weights = {.mse = 1}, .attributes = attributes};
    MultiDeviceRenderer several(several_devices(2));
    several.set_scene(scene);
    several.set_views(views);
    several.set_chunk(1);
    several.set_loss(options, targets);
    const MultiDeviceRenderer::Evaluation found = several.evaluate();
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.set_views(views);
    renderer.forward();
    ImageLoss loss(renderer.device(), options, targets);
    CHECK(found.loss == doctest::Approx(loss.evaluate(renderer)).epsilon(1e-5));
    const std::vector<Block> expected = blocks_of(renderer.backward(loss));
    std::vector<Block> blocks = blocks_of(found.gradient);
    REQUIRE(blocks.size() == expected.size());
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      CAPTURE(blocks[i].name);
      blocks[i].expected = expected[i].found;
      CHECK(block_error(blocks[i], 1e-4) < 1e-4);
    }
  }

  TEST_CASE("several devices: the same bits as one") {
    const std::size_t views = reduced(29, 3);
    for (const Scene& scene : {small_scene(), sampled(small_scene())}) {
      const Result one = render({open_device()}, scene, views);
      REQUIRE(one.values.size() > views);
      CHECK(same_bits(one, render({open_device()}, scene, views)));
      const Result three = render(several_devices(3), scene, views);
      CHECK(same_bits(one, three));
      CHECK(total(three.views_rendered) == 3 * views);
      Scene other = scene;
      other.background.x += 1e-3F;
      CHECK_FALSE(same_bits(one, render({open_device()}, other, views)));
    }
  }

  TEST_CASE("several devices: parts of one device give the bits of the whole") {
    const Device whole = open_device();
    if (!is_divisible(whole)) return;
    const unsigned half = whole.info().compute_units / 2;
    const std::vector<Device> parts = split_device(whole, half);
    REQUIRE(parts.size() >= 2);
    CHECK(parts[0].info().compute_units == half);
    const std::size_t views = reduced(29, 3);
    const Scene scene = small_scene();
    const Result one = render({parts[0]}, scene, views);
    const Result all = render(parts, scene, views);
    CHECK(same_bits(one, all));
    CHECK(same_bits(one, render({whole}, scene, views)));
    CHECK(total(all.views_rendered) == 3 * views);
  }

  TEST_CASE("several devices: images of one renderer, its loss and its gradients but for rounding") {
    const std::size_t views = reduced(17, 3);
    for (const Scene& scene : {small_scene(), sampled(small_scene())}) {
      const Device device = open_device();
      const std::vector<Image> targets = random_images(scene, views);
      const LossWeights weights{.mse = 1.0F, .l1 = 0.3F, .silhouette = 0.5F};
      MultiDeviceRenderer several(several_devices(2));
      several.set_scene(scene);
      several.set_views(ring(scene, views));
      several.set_loss(weights, targets);
      const std::vector<Image> images = several.render();
      const MultiDeviceRenderer::Evaluation evaluation = several.evaluate();

      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.set_views(ring(scene, views));
      renderer.forward();
      ImageLoss loss(device, weights, targets);
      CHECK(evaluation.loss == doctest::Approx(loss.evaluate(renderer)).epsilon(1e-6));
      for (std::size_t v = 0; v < views; ++v) {
        CHECK(evaluation.per_view[v] == loss.per_view()[v]);
        CHECK(images[v].pixels == renderer.image(v).pixels);
      }
      const std::vector<Block> found = blocks_of(evaluation.gradient);
      const SceneGradient expected_gradient = renderer.backward(loss);
      const std::vector<Block> expected = blocks_of(expected_gradient);
      REQUIRE(found.size() == expected.size());
      for (std::size_t b = 0; b < found.size(); ++b) {
        REQUIRE(found[b].found.size() == expected[b].found.size());
        std::vector<double> difference = found[b].found;
        for (std::size_t i = 0; i < difference.size(); ++i) difference[i] -= expected[b].found[i];
        CAPTURE(expected[b].name);
        CHECK(norm(difference) <= 1e-5 * norm(expected[b].found));
      }
    }
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("several devices: a batch of the views with masks, a pyramid and a mesh loss is a renderer's") {
    const std::size_t views = reduced(7, 4), first = 1, count = views - 2;
    Scene scene = small_scene();
    const std::vector<Image> targets = random_images(scene, views);
    std::vector<Image> masks;
    std::vector<unsigned char> has_alpha;
    for (std::size_t v = 0; v < views; ++v) {
      masks.push_back(random_image(scene.width, scene.height, 0.1F, 1.0F, 90 + static_cast<unsigned>(v)));
      has_alpha.push_back(v % 2 == 0 ? 1 : 0);
    }
    const MeshLossWeights shape{.laplacian = 0.1F, .flatness = 0.2F};
    const LossOptions options{.weights = {.mse = 1.0F, .silhouette = 0.5F, .robust = 0.3F},
                              .has_alpha = has_alpha,
                              .masks = masks,
                              .levels = 2};
    MultiDeviceRenderer several(several_devices(2));
    several.set_scene(scene);
    several.set_views(ring(scene, views));
    several.set_loss(options, targets);
    several.set_mesh_loss(shape);
    const auto part = [&](const auto& all) { return std::span(all).subspan(first, count); };

    const Device device = open_device();
    Renderer renderer(device);
    renderer.set_scene(scene);
    const std::vector<View> batch = ring(scene, views);
    renderer.set_views(part(batch));
    renderer.forward();
    ImageLoss loss(
        device,
        LossOptions{
            .weights = options.weights, .has_alpha = part(has_alpha), .masks = part(masks), .levels = 2},
        part(targets));
    MeshLoss mesh_loss(device, shape, scene.meshes[0].mesh);
    const double image_value = loss.evaluate(renderer), mesh_value = mesh_loss.evaluate(renderer);
    Result expected;
    append(renderer.backward(loss, mesh_loss), expected.values);

    for (const std::size_t chunk : {count, std::size_t{0}, std::size_t{2}}) {
      CAPTURE(chunk);
      several.set_chunk(chunk);
      const MultiDeviceRenderer::Evaluation found = several.evaluate(first, count);
      CHECK(found.mesh_loss == mesh_value);
      CHECK(found.loss == image_value);
      CHECK(std::ranges::equal(found.per_view, loss.per_view()));
      Result result;
      append(found.gradient, result.values);
      if (chunk == count) CHECK(same_bits(result, expected));
      REQUIRE(result.values.size() == expected.values.size());
      for (std::size_t i = 0; i < result.values.size(); ++i) result.values[i] -= expected.values[i];
      CHECK(norm(result.values) <= 1e-5 * norm(expected.values));
    }
    // Batches that overlap, as a window on the views moves on and back.
    several.set_chunk(0);
    const std::vector<double> per_view = several.evaluate().per_view;
    for (const std::size_t from : {std::size_t{0}, std::size_t{1}, views - 2, std::size_t{0}}) {
      CHECK(std::ranges::equal(several.evaluate(from, 2).per_view, std::span(per_view).subspan(from, 2)));
    }
    CHECK(several.evaluate().per_view == per_view);
    several.set_scene(scene);  // forgets the mesh loss
    several.set_views(ring(scene, views));
    CHECK(several.evaluate(first, count).mesh_loss == 0);
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("several devices: smoothing and lights need suit the views they are rendered with alone") {
    Scene scene = small_scene();
    scene.camera.zfar = scene.camera.znear + 0.1F;
    std::vector<View> far = ring(scene, 3);
    for (View& view : far) view.camera.zfar = view.camera.znear + 100;
    Smoothing smoothing = scene.smoothing;
    smoothing.gamma = 2e-36F;  // 1 / (gamma (zfar - znear)) is too large for the scene's own camera
    Renderer alone(open_device());
    alone.set_scene(scene);
    alone.set_views(far);
    alone.set_smoothing(smoothing);
    alone.forward();
    for (const bool has_rendered : {false, true}) {
      CAPTURE(has_rendered);
      MultiDeviceRenderer renderer(several_devices(2));
      renderer.set_scene(scene);
      renderer.set_chunk(2);
      if (has_rendered) CHECK(renderer.render().size() == 1);
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_smoothing(smoothing), "gamma (smoothing)");
      renderer.set_views(far);
      renderer.set_smoothing(smoothing);
      renderer.set_lights(scene.lights);
      const std::vector<Image> images = renderer.render();
      REQUIRE(images.size() == far.size());
      for (std::size_t v = 0; v < far.size(); ++v) CHECK(images[v].pixels == alone.image(v).pixels);
    }
    scene.smoothing = smoothing;
    MultiDeviceRenderer renderer(several_devices(1));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(scene), "gamma (smoothing)");
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("several devices: chunks are no larger than the samples of the pixel's noise let frames be") {
    Scene scene = small_scene();
    scene.width = scene.height = 2048;
    scene.smoothing = smoothing_preset("pixel");
    scene.smoothing.supersampling = 4;
    const Raster raster = raster_of(scene);
    CHECK(raster.supersampling == 4);
    const std::size_t most = most_views(scene, raster);
    REQUIRE(most > 1);
    CHECK(most < most_views(scene));
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    CHECK_NOTHROW(renderer.set_views(ring(scene, most)));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_views(ring(scene, most + 1)),
                          "sigma and supersampling (smoothing)");
    scene.smoothing.noise = Noise::triangle;
    CHECK(most_views(scene, raster_of(scene)) == most_views(scene));
  }

  TEST_CASE("several devices: a batch that is too large for a frame but not for a chunk") {
    Scene scene = small_scene();
    scene.width = scene.height = 4096;
    constexpr std::size_t k_views = 60;
    MultiDeviceRenderer renderer({open_device()});
    renderer.set_scene(scene);
    Renderer single(open_device());
    single.set_scene(scene);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, single.set_views(ring(scene, k_views)), "views (frame)");
    CHECK_NOTHROW(renderer.set_views(ring(scene, k_views)));
  }

  TEST_CASE("several devices: wrong input is one clear error, and the renderer works on") {
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, MultiDeviceRenderer({}), "devices");
    const Device twice = open_device();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, MultiDeviceRenderer({twice, open_device(), twice}), "devices[2]");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, split_device(open_device(), 0), "compute_units");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, split_device(open_device(), 100000), "compute_units");

    const Scene scene = small_scene();
    MultiDeviceRenderer renderer(several_devices(2));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.render(), "set_scene");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_views(ring(scene, 2)), "set_scene");
    renderer.set_scene(scene);
    renderer.set_views(ring(scene, 3));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.evaluate(), "targets");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.gradient(random_images(scene, 2)), "grad_images");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_views({}), "views");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_mesh_loss({}, 1), "mesh (mesh loss)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_mesh_loss({.laplacian = -1}), "weight (mesh loss)");
    Scene fixed = scene;
    fixed.gradients.positions = false;
    MultiDeviceRenderer other(several_devices(1));
    other.set_scene(fixed);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, other.set_mesh_loss({}), "gradients of positions");
    renderer.set_loss(LossWeights::only(LossKind::l1), random_images(scene, 3));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.evaluate(2, 2), "2 from 2 on");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.evaluate(0, 0), "at least one of the 3");
    renderer.set_loss(LossWeights::only(LossKind::l1), random_images(scene, 2));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.evaluate(), "2 images");
    // A mask that leaves no window on the second level.
    Scene wide = scene;
    wide.width = wide.height = 24;
    Image mask(24, 24, glm::vec4(0));
    mask.at(6, 12) = glm::vec4(1);
    const std::vector<Image> targets(2, Image(24, 24)), masks{Image(24, 24, glm::vec4(1)), mask};
    const LossOptions one_level{.weights = {.ssim = 1}, .masks = masks};
    LossOptions two_levels = one_level;
    two_levels.levels = 2;
    other.set_scene(wide);
    CHECK_NOTHROW(other.set_loss(one_level, targets));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, other.set_loss(two_levels, targets), "mask (ssim)");
    // An error of one chunk, here a target of another size, is the error of the call.
    renderer.set_loss(LossWeights::only(LossKind::l1), std::vector<Image>(3, Image(5, 4)));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.evaluate(), "target size");
    CHECK(renderer.render().size() == 3);
  }
}

}  // namespace multi_device_test
