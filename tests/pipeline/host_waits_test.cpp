// A frame like the last one is enqueued without a wait of the host, and one that turns out larger than the
// buffers are is rendered again by whoever asks for it: to the same bits as by a renderer that measured
// first.
#include <doctest/doctest.h>

#include <map>
#include <string>
#include <vector>

#include "device/profile.hpp"
#include "dpr/dpr.hpp"
#include "dpr/opencl_handles.hpp"
#include "pipeline/determinism.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/variable.hpp"

namespace host_waits_test {

using namespace dpr;
using namespace dpr::test::pipeline;

namespace {

/// How often forward() makes the host wait.
std::size_t waits_of_forward(Renderer& renderer) {
  const std::atomic<std::size_t>& waits = impl_of(renderer.device()).host_waits;
  const std::size_t before = waits;
  renderer.forward();
  return waits - before;
}

std::vector<glm::vec3> scaled(const Scene& scene, float factor) {
  std::vector<glm::vec3> positions = scene.meshes[0].mesh.positions;
  for (glm::vec3& p : positions) p *= factor;
  return positions;
}

/// The frame that forward() has enqueued, against that of a renderer which knows nothing of frames before.
bool equals_fresh_render(Renderer& renderer) {
  const Image grad = random_image(renderer.scene().width, renderer.scene().height, -1.0F, 1.0F);
  const Image image = renderer.image();
  const SceneGradient gradient = renderer.backward(std::span(&grad, 1));
  Renderer fresh(renderer.device());
  fresh.set_scene(renderer.scene());
  fresh.set_views(renderer.views());
  fresh.forward();
  return same_bits(image, fresh.image()) && same_bits(gradient, fresh.backward(std::span(&grad, 1))) &&
         renderer.statistics().pairs == fresh.statistics().pairs &&
         renderer.statistics().fragments == fresh.statistics().fragments;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("host waits: none in the frames after the first") {
    for (const Scene& scene : {test_scene(), sampled_scene(), joint_scene()}) {
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      CHECK(waits_of_forward(renderer) == 2);  // for the pairs, for the fragments
      CHECK(equals_fresh_render(renderer));
      for (const float factor : {1.0F, 0.9F, 0.8F, 0.8F}) {
        CAPTURE(factor);
        renderer.set_positions(0, scaled(scene, factor));
        CHECK(waits_of_forward(renderer) == 0);
        CHECK(equals_fresh_render(renderer));
      }
      // Nor where nobody looks at the frames between.
      CHECK(waits_of_forward(renderer) == 0);
      CHECK(waits_of_forward(renderer) == 0);
      CHECK(equals_fresh_render(renderer));
    }
  }

  TEST_CASE("host waits: a frame that grows suddenly is whole") {
    for (const Scene& scene : {test_scene(), sampled_scene(), joint_scene()}) {
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.set_positions(0, scaled(scene, 0.2F));
      renderer.forward();
      for (const float factor : {1.0F, 0.2F, 1.5F}) {
        CAPTURE(factor);
        renderer.set_positions(0, scaled(scene, factor));
        CHECK(waits_of_forward(renderer) == 0);
        CHECK(equals_fresh_render(renderer));
      }
      // A wider blur, with more fragments; and out of nothing.
      Smoothing wide = scene.smoothing;
      wide.sigma *= 4;
      renderer.set_smoothing(wide);
      renderer.forward();
      CHECK(equals_fresh_render(renderer));
      std::vector<glm::vec3> nowhere = scaled(scene, 1.0F);
      for (glm::vec3& p : nowhere) p += glm::vec3(0.0F, 1e4F, 0.0F);
      renderer.set_positions(0, nowhere);
      renderer.forward();
      CHECK(renderer.statistics().fragments == 0);
      renderer.set_positions(0, scaled(scene, 1.0F));
      renderer.forward();
      CHECK(equals_fresh_render(renderer));
    }
  }

  TEST_CASE("host waits: every reader gets the whole frame") {
    const Device device = open_device();
    const Scene scene = test_scene();
    const Image target(scene.width, scene.height, glm::vec4(0.3F));
    Renderer fresh(device);
    fresh.set_scene(scene);
    fresh.forward();
    const auto grown = [&] {
      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.set_positions(0, scaled(scene, 0.2F));
      renderer.forward();
      renderer.image();
      renderer.set_positions(0, scene.meshes[0].mesh.positions);
      renderer.forward();
      return renderer;
    };
    ImageLoss loss(device, LossWeights::only(LossKind::mse), std::span(&target, 1));
    const double wanted = loss.evaluate(fresh);
    Renderer evaluated = grown();
    CHECK(loss.evaluate(evaluated) == wanted);
    Renderer differentiated = grown();
    CHECK(same_bits(differentiated.backward(std::span(&target, 1)), fresh.backward(std::span(&target, 1))));
    Renderer counted = grown();
    CHECK(counted.statistics().fragments == fresh.statistics().fragments);
    Renderer seen = grown();
    CHECK(auxiliary_outputs(seen).depth == auxiliary_outputs(fresh).depth);
    Renderer embedded = grown();
    Image image(scene.width, scene.height);
    const std::size_t bytes = image.pixels.size() * sizeof(glm::vec4);
    const cl::Buffer buffer(image_handle(embedded), true);
    REQUIRE(impl_of(device).queue.enqueueReadBuffer(buffer, CL_TRUE, 0, bytes, image.pixels.data()) ==
            CL_SUCCESS);
    CHECK(same_bits(image, fresh.image()));
  }

  TEST_CASE("host waits: a backward pass waits for all its gradients at once") {
    for (const Scene& scene : {test_scene(), sampled_scene(), joint_scene()}) {
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
      renderer.forward();
      renderer.image();
      const std::atomic<std::size_t>& waits = impl_of(renderer.device()).host_waits;
      const std::size_t before = waits;
      const SceneGradient gradient = renderer.backward(std::span(&grad, 1));
      CHECK(waits - before == 1);
      CHECK(!gradient.meshes[0].positions.empty());
      CHECK(!gradient.meshes[0].colors.empty());
    }
  }

  TEST_CASE("host waits: launches of a step on a device of one lane") {
    if (dpr::test::is_reduced()) return;
    const dpr::test::Variable one_lane("DPR_LANES", "1");
    Scene scene;
    scene.smoothing = smoothing_preset("pixel", 128, 128);
    scene.camera = orbit_camera(6.7F, 30.0F, 120.0F);
    scene.meshes.push_back({make_cube(), glm::mat4(1.0F)});
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
    const auto step = [&] {
      renderer.set_positions(0, scene.meshes[0].mesh.positions);
      renderer.forward();
      renderer.backward(std::span(&grad, 1));
    };
    step();
    Profile profile(renderer.device());
    step();
    std::map<std::string, int> launches;
    for (const Profile::Launch& launch : profile.take()) ++launches[launch.file];
    std::size_t all = 0;
    for (const auto& [file, count] : launches) {
      MESSAGE(file << ": " << count);
      all += static_cast<std::size_t>(count);
    }
    CHECK(launches["sort.cl"] + launches["scan.cl"] <= 8);
    CHECK(all <= 61);
  }

  TEST_CASE("host waits: a frame that no budget allows is refused by whoever asks for it") {
    Device device = open_device();
    Scene scene = test_scene();
    scene.smoothing.sigma = 1e-6F;  // few fragments in a small mesh, many times more in a large one
    Renderer renderer(device);
    renderer.set_scene(scene);
    renderer.set_positions(0, scaled(scene, 0.05F));
    renderer.forward();
    renderer.image();
    constexpr std::size_t k_ample = 200;  // bytes of a fragment, all buffers and their headroom
    device.set_memory_budget((impl_of(renderer).rasterize.fragments + 1) * k_ample);
    renderer.set_positions(0, scene.meshes[0].mesh.positions);
    renderer.forward();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.image(), "memory budget (frame)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.image(), "forward() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.forward(), "memory budget (frame)");
    device.set_memory_budget(std::size_t{1} << 30);
    renderer.forward();
    CHECK(equals_fresh_render(renderer));
  }
}

}  // namespace host_waits_test
