// Frames with noise on the pixel whose samples exceed the memory budget: in bands of samples, to the same bits as
// whole, and within the memory that the budget promises.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "dpr/aov.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/determinism.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/reduced.hpp"

namespace sample_bands_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::is_reduced;
using dpr::test::reduced;

namespace {

/// A budget that holds the fragments of a tile, and no more samples than has to be.
constexpr std::size_t k_small = 80000;

GradientRequest all_gradients() {
  GradientRequest all;
  all.lights = all.texture = all.texcoords = all.normals = all.materials = true;
  return all;
}

/// A scene whose raster has at least 22 rows of tiles: more than the least band and what is around it.
Scene tall_scene(std::uint32_t supersampling, float sigma) {
  const int samples = 176, side = samples / static_cast<int>(supersampling);
  Scene scene =
      textured_scene(make_icosphere(static_cast<unsigned>(reduced(2, 0))),
                     random_texture(6, 7, Wrap::mirror, Filter::trilinear), reduced(side * 2 / 3, 7), side);
  scene.smoothing = smoothing_preset("pixel");
  scene.smoothing.supersampling = supersampling;
  scene.smoothing.sigma = sigma;
  scene.smoothing.gamma = 1e-2F;
  scene.gradients = all_gradients();
  return scene;
}

struct Rendered {
  std::vector<Image> images;
  SceneGradient gradient, again;
  std::size_t bands, bytes;
};

Rendered render_views(Renderer& renderer, const Scene& scene, const std::vector<View>& views) {
  renderer.set_scene(scene);
  renderer.set_views(views);
  renderer.forward();
  Rendered frame;
  frame.bands = impl_of(renderer).sample_bands.size();
  std::vector<Image> grads;
  for (std::size_t v = 0; v < views.size(); ++v) {
    frame.images.push_back(renderer.image(v));
    grads.push_back(random_image(scene.width, scene.height, -1.0F, 1.0F, 3 + static_cast<unsigned>(v)));
  }
  frame.gradient = renderer.backward(grads);
  frame.again = renderer.backward(grads);
  frame.bytes = renderer.statistics().device_bytes;
  return frame;
}

Rendered render_views(std::size_t budget, const Scene& scene, const std::vector<View>& views) {
  Device device = open_device();
  device.set_memory_budget(budget);
  Renderer renderer(device);
  return render_views(renderer, scene, views);
}

bool same_frames(const Rendered& a, const Rendered& b) {
  bool same = a.images.size() == b.images.size();
  for (std::size_t v = 0; same && v < a.images.size(); ++v) same = same_bits(a.images[v], b.images[v]);
  return same && same_bits(a.gradient, b.gradient) && same_bits(a.again, b.gradient);
}

/// The scene from some places, which see other parts of the raster.
std::vector<View> views_of(const Scene& scene, int count) {
  std::vector<View> views;
  for (int v = 0; v < count; ++v) {
    View view{scene.camera, {}};
    view.camera.view[3] += glm::vec4(0.1F * static_cast<float>(v), -0.2F * static_cast<float>(v), 0.0F, 0.0F);
    for (const Instance& instance : scene.meshes) view.transforms.push_back(instance.transform);
    views.push_back(view);
  }
  return views;
}

void check_same(const Scene& scene, const std::vector<View>& views) {
  const Rendered whole = render_views(std::size_t{1} << 30, scene, views);
  CHECK(whole.bands == 0);
  CHECK(norm(flat(whole.gradient.meshes[0].positions)) > 0);
  const Rendered banded = render_views(k_small, scene, views);
  CHECK(banded.bands > 1);
  CHECK(banded.bytes < whole.bytes);
  CHECK(same_frames(banded, whole));
}

constexpr float k_least_sigma = 1e-7F;

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("sample bands: the same bits for both compositions, supersamplings, wide and narrow noise") {
    for (const std::uint32_t supersampling : {1U, 2U, 4U}) {
      for (const float sigma : {2e-3F, k_least_sigma}) {
        for (const Composition composition : {Composition::barrier, Composition::joint}) {
          if (is_reduced() && (supersampling != 1 || sigma != k_least_sigma)) continue;
          if (is_reduced() && composition == Composition::joint) continue;
          CAPTURE(supersampling);
          CAPTURE(sigma);
          CAPTURE(to_string(composition));
          Scene scene = tall_scene(supersampling, sigma);
          scene.smoothing.composition = composition;
          if (!is_reduced()) scene.lights = two_lights(Shading::phong);
          check_same(scene, views_of(scene, 1));
        }
      }
    }
  }

  TEST_CASE("sample bands: the same bits for batches of views, whose bands are of several") {
    if (is_reduced()) return;
    for (const int height : {9, 44}) {
      CAPTURE(height);
      Scene scene = tall_scene(4, k_least_sigma);
      scene.height = height;
      scene.width = 31;
      scene.lights = every_light(Shading::gouraud);
      scene.meshes.push_back({make_cube(), placed(70.0F, 0.4F, {0.9F, 0.4F, 0.2F})});
      check_same(scene, views_of(scene, height == 9 ? 6 : 3));
    }
  }

  TEST_CASE("sample bands: the same bits where faces cross the near plane, and every triangle is a contour") {
    if (is_reduced()) return;
    Scene scene = scene_cut_open(welded_cube(), 30, 44);
    scene.smoothing = smoothing_preset("pixel");
    scene.smoothing.supersampling = 4;
    scene.smoothing.sigma = 1e-4F;
    check_same(scene, views_of(scene, 2));
  }

  TEST_CASE("sample bands: every budget between gives the same bits, and memory follows it") {
    if (is_reduced()) return;
    Scene scene = tall_scene(4, 1e-3F);
    scene.height = 120;
    const std::vector<View> views = views_of(scene, 1);
    const Rendered whole = render_views(std::size_t{1} << 30, scene, views);
    std::size_t bytes = whole.bytes, bands = 0;
    for (std::size_t budget = whole.bytes / 2; budget > k_small; budget /= 2) {
      CAPTURE(budget);
      const Rendered banded = render_views(budget, scene, views);
      CHECK(same_frames(banded, whole));
      CHECK(banded.bytes <= bytes);
      CHECK(banded.bands >= bands);
      bytes = banded.bytes;
      bands = banded.bands;
    }
    CHECK(bands > 4);
  }

  TEST_CASE("sample bands: other gradients asked for, other scenes and budgets in the same renderer") {
    if (is_reduced()) return;
    Device device = open_device();
    Renderer renderer(device);
    Scene scene = tall_scene(2, k_least_sigma);
    const std::vector<View> views = views_of(scene, 1);
    const Rendered whole = render_views(renderer, scene, views);
    device.set_memory_budget(k_small);
    scene.gradients.smoothing = scene.gradients.background = false;
    CHECK(render_views(renderer, scene, views).bands > 1);
    scene.gradients = all_gradients();
    CHECK(same_frames(render_views(renderer, scene, views), whole));
    device.set_memory_budget(std::size_t{1} << 30);
    CHECK(same_frames(render_views(renderer, scene, views), whole));
    scene.smoothing = smoothing_preset("gaussian");
    CHECK_FALSE(same_bits(render_views(renderer, scene, views).images[0], whole.images[0]));
  }

  TEST_CASE("sample bands: what needs all samples renders them, and then the gradient is the same") {
    if (is_reduced()) return;
    const Scene scene = tall_scene(4, 1e-4F);
    Device device = open_device(), small = open_device();
    small.set_memory_budget(k_small);
    Renderer whole(device), banded(small);
    for (Renderer* renderer : {&whole, &banded}) {
      renderer->set_scene(scene);
      renderer->forward();
    }
    REQUIRE(impl_of(banded).sample_bands.size() > 1);
    const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
    const SceneGradient gradient = whole.backward(std::span(&grad, 1));
    CHECK(same_bits(banded.backward(std::span(&grad, 1)), gradient));

    const AuxiliaryOutputs outputs = auxiliary_outputs(whole), found = auxiliary_outputs(banded);
    CHECK(found.depth == outputs.depth);
    CHECK(found.normal == outputs.normal);
    CHECK(found.face_id == outputs.face_id);
    CHECK(same_bits(banded.backward(std::span(&grad, 1)), gradient));

    banded.forward();
    REQUIRE(impl_of(banded).sample_bands.size() > 1);
    SceneTangent direction;
    direction.views.resize(1);
    direction.views[0].transforms.resize(1);
    direction.views[0].transforms[0].translation.x = 1;
    CHECK(same_bits(banded.tangent(std::span(&direction, 1))[0], whole.tangent(std::span(&direction, 1))[0]));
    CHECK(same_bits(banded.backward(std::span(&grad, 1)), gradient));

    banded.forward();
    REQUIRE(impl_of(banded).sample_bands.size() > 1);
    CHECK(banded.samples().faces == whole.samples().faces);
    CHECK(same_bits(banded.image(), whole.image()));
  }

  TEST_CASE("sample bands: a frame of 512x512 pixels of 4x4 samples with a budget of 8 MiB") {
    if (is_reduced()) return;
    Scene scene = scene_of(make_icosphere(3, 1.3F), 512, 512);
    scene.smoothing = smoothing_preset("pixel");
    scene.smoothing.supersampling = 4;
    scene.smoothing.sigma = 1e-2F;
    Device device = open_device();
    device.set_memory_budget(std::size_t{8} << 20);
    Renderer renderer(device);
    renderer.set_scene(scene);
    const Result result = render(renderer);
    CHECK(norm(flat(result.gradient.meshes[0].positions)) > 0);
    CHECK(renderer.statistics().device_bytes < 100'000'000);
    CHECK(device.peak_allocated_bytes() < 100'000'000);
  }
}

}  // namespace sample_bands_test
