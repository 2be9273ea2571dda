// Samples so far behind an opaque triangle that nothing is seen of them have no fragments: the frame equals
// the one with all fragments.
#include <doctest/doctest.h>

#include <limits>

#include "dpr/aov.hpp"
#include "pipeline/determinism.hpp"
#include "renderer/renderer_impl.hpp"

namespace hidden_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

/// Beside the probability of 1e-9 that is left out, aggregation is as exact as bench/results/notes.md says, on one
/// side and on the other: twice that, for sums over pixels whose errors have either sign.
constexpr float k_image_error = 5e-6F;
constexpr double k_gradient_error = 1e-4;

struct HiddenFrame {
  std::size_t fragments;
  Result result;
  AuxiliaryOutputs outputs;
};

HiddenFrame frame_of(const Device& device, const Scene& scene, bool hides) {
  Renderer renderer(device);
  renderer.set_scene(scene);
  if (!hides) impl_of(renderer).hidden_reach = std::numeric_limits<float>::infinity();
  HiddenFrame frame{0, render(renderer), auxiliary_outputs(renderer)};
  frame.fragments = impl_of(renderer).rasterize.fragments;
  return frame;
}

Scene with_gamma(Scene scene, Prior prior, float gamma) {
  scene.smoothing = smoothing_preset("pixel");
  scene.smoothing.depth_prior = prior;
  scene.smoothing.gamma = gamma;
  return scene;
}

float largest_apart(const std::vector<glm::vec4>& a, const std::vector<glm::vec4>& b) {
  float largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (int k = 0; k < 4; ++k) largest = std::max(largest, std::abs(a[i][k] - b[i][k]));
  }
  return largest;
}

void check_same(const HiddenFrame& found, const HiddenFrame& all) {
  CHECK(largest_apart(found.result.image.pixels, all.result.image.pixels) <= k_image_error);
  std::vector<Block> blocks = blocks_of(found.result.gradient);
  const std::vector<Block> expected = blocks_of(all.result.gradient);
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    blocks[i].expected = expected[i].found;
    CAPTURE(blocks[i].name);
    CHECK(block_error(blocks[i], k_gradient_error) <= k_gradient_error);
  }
  CHECK(found.outputs.face_id == all.outputs.face_id);
  float depth = 0;
  for (std::size_t i = 0; i < all.outputs.depth.size(); ++i)
    depth = std::max(depth, std::abs(found.outputs.depth[i] - all.outputs.depth[i]));
  CHECK(depth <= 20 * k_image_error);  // of scenes 20 deep
}

/// Small triangles in front of large ones.
Mesh before_soup(Mesh mesh, unsigned faces) {
  const Mesh soup = random_soup(faces, 5);
  const auto first = static_cast<unsigned>(mesh.positions.size());
  mesh.vertex_colors.resize(first, glm::vec3(0.6F));
  mesh.positions.insert(mesh.positions.end(), soup.positions.begin(), soup.positions.end());
  mesh.vertex_colors.insert(mesh.vertex_colors.end(), soup.vertex_colors.begin(), soup.vertex_colors.end());
  for (const glm::uvec3& face : soup.faces) mesh.faces.push_back(face + first);
  return mesh;
}

/// Two layers of a sample; the same cut by the near plane; more, in light.
std::vector<Scene> layered_scenes() {
  const int width = reduced(41, 19), height = reduced(35, 17);
  Mesh sphere = make_icosphere(static_cast<unsigned>(reduced(3, 2)));
  sphere.faces.pop_back();  // not closed, so that its far side is not left out from the first
  std::vector<Scene> list{scene_of(sphere, width, height), scene_cut_open(sphere, width, height),
                          scene_of(before_soup(sphere, 6), width, height)};
  list[2].lights = every_light(Shading::phong);
  list[2].gradients.lights = true;
  return list;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("hidden: images, gradients and auxiliary outputs are those of all fragments") {
    const Device device = open_device();
    const std::vector<Scene> scenes = layered_scenes();
    for (std::size_t number = 0; number < scenes.size(); ++number) {
      CAPTURE(number);
      for (const auto& [prior, gamma] : {std::pair{Prior::gaussian, 2e-3F}, std::pair{Prior::logistic, 1e-3F},
                                         std::pair{Prior::gumbel, 1e-3F}, std::pair{Prior::uniform, 1e-2F}}) {
        CAPTURE(to_string(prior));
        for (const Composition composition : choices<Composition>()) {
          CAPTURE(to_string(composition));
          Scene scene = with_gamma(scenes[number], prior, gamma);
          scene.smoothing.composition = composition;
          const HiddenFrame found = frame_of(device, scene, true), all = frame_of(device, scene, false);
          CHECK(found.fragments < all.fragments);
          check_same(found, all);
        }
      }
    }
  }

  TEST_CASE("hidden: nothing where depths may change places, or triangles have noise of their own") {
    const Device device = open_device();
    const Scene plain = scene_of(random_soup(12, 5), 15, 13);
    Scene blurred = plain;
    blurred.smoothing.gamma = 1e-6F;
    for (const Scene& scene :
         {with_gamma(plain, Prior::cauchy, 1e-6F), with_gamma(plain, Prior::gaussian, 1.0F), blurred}) {
      const HiddenFrame found = frame_of(device, scene, true), all = frame_of(device, scene, false);
      CHECK(found.fragments == all.fragments);
      CHECK(same_bits(found.result, all.result));
    }
  }

  TEST_CASE("hidden: the rigid renderer has a fragment a sample, but for those near each other") {
    const Device device = open_device();
    Scene scene = layered_scenes().back();
    scene.smoothing = rigid_smoothing();
    const HiddenFrame found = frame_of(device, scene, true), all = frame_of(device, scene, false);
    CHECK(found.fragments < all.fragments);
    CHECK(same_bits(found.result.image, all.result.image));
  }

  TEST_CASE("hidden: the same bits in bands") {
    const Scene scene = with_gamma(layered_scenes().back(), Prior::gaussian, 2e-3F);
    Device small = open_device();
    small.set_memory_budget(static_cast<std::size_t>(reduced(24576, 9000)));
    Renderer banded(small);
    banded.set_scene(scene);
    CHECK(same_bits(frame_of(open_device(), scene, true).result, render(banded)));
    CHECK(banded.statistics().bands > 1);
  }
}

}  // namespace hidden_test
