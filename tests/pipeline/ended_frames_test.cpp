// A setter ends the frame: whoever asks for what it showed gets an error in place of another scene's image.
#include <doctest/doctest.h>

#include <array>
#include <functional>
#include <vector>

#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/messages.hpp"

namespace dpr::test::pipeline::ended_frames_test {
namespace {

using Setter = std::function<void(Renderer&)>;

/// All but set_gradients(), each with what the scene has already.
std::vector<Setter> setters(const Scene& scene) {
  const Mesh& mesh = scene.meshes[0].mesh;
  return {[scene](Renderer& r) { r.set_scene(scene); },
          [](Renderer& r) {
            const std::vector<View> views(r.views().begin(), r.views().end());
            r.set_views(views);
          },
          [scene](Renderer& r) { r.set_smoothing(scene.smoothing); },
          [mesh](Renderer& r) { r.set_positions(0, mesh.positions); },
          [mesh](Renderer& r) { r.set_colors(0, mesh.face_colors); },
          [mesh](Renderer& r) { r.set_shapes(mesh.positions, {}); },
          [scene](Renderer& r) { r.set_lights(scene.lights); },
          [scene](Renderer& r) { r.set_cull(scene.cull); },
          [scene](Renderer& r) { r.set_background(scene.background); }};
}

void check_ended(Renderer& renderer, ImageLoss& loss) {
  const Scene& scene = renderer.scene();
  const Image grad(scene.width, scene.height, glm::vec4(1));
  std::vector<glm::vec4> pixels(grad.pixels);
  DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.image(), "forward() first");
  DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.read_pixels(pixels), "forward() first");
  DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward(std::span(&grad, 1)), "forward() first");
  DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward_pixels(pixels), "forward() first");
  DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.statistics(), "forward() first");
  DPR_CHECK_MESSAGE_HAS(InvalidArgument, auxiliary_outputs(renderer), "forward() first");
  DPR_CHECK_MESSAGE_HAS(InvalidArgument, loss.evaluate(renderer), "forward() first");
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("ended frames: after a setter nothing reads the last one, and forward() renders the next") {
    const Device device = open_device();
    const Scene scene = cube_scene(9, 8);
    const Image target(9, 8, glm::vec4(1));
    Renderer renderer(device);
    ImageLoss loss(device, {.mse = 1.0F}, {&target, 1});
    renderer.set_scene(scene);
    check_ended(renderer, loss);
    renderer.forward();
    const Image expected = renderer.image();
    for (const Setter& set : setters(scene)) {
      set(renderer);
      check_ended(renderer, loss);
      renderer.forward();
      CHECK(renderer.image().pixels == expected.pixels);
    }
  }

  TEST_CASE("ended frames: what is to be differentiated may be set between the passes") {
    Renderer renderer(open_device());
    renderer.set_scene(cube_scene(9, 8));
    renderer.forward();
    const Image image = renderer.image();
    GradientRequest colors;
    colors.positions = false;
    colors.colors = true;
    renderer.set_gradients(colors);
    CHECK(renderer.image().pixels == image.pixels);
    const MeshGradient gradient = renderer.backward(std::span(&image, 1)).meshes[0];
    CHECK(gradient.positions.empty());
    CHECK_FALSE(gradient.colors.empty());
  }
}

}  // namespace dpr::test::pipeline::ended_frames_test
