// A shape of its own for every view: one batch of many meshes gives what each gives alone.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "dpr/renderer.hpp"
#include "pipeline/scenes.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace dpr::test::pipeline::shapes_test {
namespace {

/// Two meshes, one with colours of its vertices and one of its faces, and as many views as shapes.
struct Batch {
  Scene scene;
  std::vector<View> views;
  std::vector<glm::vec3> positions, colors;  // [view][vertex], [view][color]
  std::vector<Image> grad_images;
};

constexpr std::size_t k_shapes = 3;

Batch make_batch(bool lit) {
  Batch batch;
  const int size = reduced(24, 10);
  batch.scene = scene_of(make_icosphere(0), size, size);
  batch.scene.meshes.push_back({make_cube(), placed(40.0F, 0.5F, {0.5F, 0.3F, 0.2F})});
  if (lit) batch.scene.lights = Lights{.point = {{.position = {2.0F, 4.0F, 5.0F}}}};
  Random random(3);
  for (std::size_t s = 0; s < k_shapes; ++s) {
    View view{orbit_camera(5.3F, 20.0F, 30.0F * static_cast<float>(s)), {}};
    view.camera.zfar = 20.0F;
    for (const Instance& instance : batch.scene.meshes) {
      view.transforms.push_back(instance.transform);
      const Mesh& mesh = instance.mesh;
      for (const glm::vec3& p : mesh.positions) batch.positions.push_back(p + random.vector(-0.2F, 0.2F));
      const std::size_t colors = std::max(mesh.vertex_colors.size(), mesh.face_colors.size());
      for (std::size_t c = 0; c < colors; ++c) batch.colors.push_back(random.vector(0.0F, 1.0F));
    }
    batch.views.push_back(view);
    batch.grad_images.push_back(random_image(size, size, -1.0F, 1.0F, static_cast<unsigned>(s)));
  }
  return batch;
}

std::vector<glm::vec3> take(const std::vector<glm::vec3>& all, std::size_t part, std::size_t& at,
                            std::size_t count) {
  const auto first = all.begin() + static_cast<std::ptrdiff_t>(part + at);
  at += count;
  return {first, first + static_cast<std::ptrdiff_t>(count)};
}

/// The scene of one of the shapes.
Scene alone(const Batch& batch, std::size_t shape) {
  Scene scene = batch.scene;
  scene.camera = batch.views[shape].camera;
  const std::size_t first_position = shape * batch.positions.size() / k_shapes;
  const std::size_t first_color = shape * batch.colors.size() / k_shapes;
  std::size_t positions = 0, colors = 0;
  for (Instance& instance : scene.meshes) {
    Mesh& mesh = instance.mesh;
    mesh.positions = take(batch.positions, first_position, positions, mesh.positions.size());
    std::vector<glm::vec3>& values = mesh.vertex_colors.empty() ? mesh.face_colors : mesh.vertex_colors;
    values = take(batch.colors, first_color, colors, values.size());
  }
  return scene;
}

std::vector<glm::vec4> joined(const std::vector<Image>& images) {
  std::vector<glm::vec4> pixels;
  for (const Image& image : images) pixels.insert(pixels.end(), image.pixels.begin(), image.pixels.end());
  return pixels;
}

/// The gradients of a scene rendered by itself, its meshes one after the other.
ShapesGradient joined(const SceneGradient& gradient) {
  ShapesGradient all;
  for (const MeshGradient& mesh : gradient.meshes) {
    all.positions.insert(all.positions.end(), mesh.positions.begin(), mesh.positions.end());
    all.colors.insert(all.colors.end(), mesh.colors.begin(), mesh.colors.end());
  }
  return all;
}

void check_against_each_alone(const Batch& batch) {
  const Device device = open_device();
  Renderer renderer(device);
  renderer.set_scene(batch.scene);
  renderer.set_views(batch.views);
  renderer.set_shapes(batch.positions, batch.colors);
  renderer.forward();
  std::vector<glm::vec4> pixels(joined(batch.grad_images).size());
  renderer.read_pixels(pixels);
  const SceneGradient gradient = renderer.backward_pixels(joined(batch.grad_images));
  CHECK(gradient.meshes[0].positions.empty());
  CHECK(gradient.meshes[0].colors.empty());

  Renderer single(device);
  std::vector<glm::vec4> expected;
  ShapesGradient expected_gradient;
  for (std::size_t s = 0; s < k_shapes; ++s) {
    single.set_scene(alone(batch, s));
    single.forward();
    const Image image = single.image();
    expected.insert(expected.end(), image.pixels.begin(), image.pixels.end());
    const SceneGradient one = single.backward(std::span(&batch.grad_images[s], 1));
    const ShapesGradient part = joined(one);
    expected_gradient.positions.insert(expected_gradient.positions.end(), part.positions.begin(),
                                       part.positions.end());
    expected_gradient.colors.insert(expected_gradient.colors.end(), part.colors.begin(), part.colors.end());
    CHECK(gradient.views[s].camera.view.rotation == one.views[0].camera.view.rotation);
  }
  CHECK(pixels == expected);
  CHECK(gradient.shapes.positions == expected_gradient.positions);
  CHECK(gradient.shapes.colors == expected_gradient.colors);
  CHECK(gradient.shapes.positions[0] != glm::vec3(0));
  CHECK(gradient.shapes.colors[0] != glm::vec3(0));
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("shapes: a batch of meshes gives what each gives alone, bit by bit") {
    check_against_each_alone(make_batch(/*lit*/ false));
    check_against_each_alone(make_batch(/*lit*/ true));
  }

  TEST_CASE("shapes: they outlive a change of the smoothing and end with the views") {
    const Batch batch = make_batch(false);
    Renderer renderer(open_device());
    renderer.set_scene(batch.scene);
    renderer.set_views(batch.views);
    renderer.forward();
    const Image shared = renderer.image(1);
    renderer.set_shapes(batch.positions, {});
    renderer.set_smoothing(batch.scene.smoothing);
    renderer.forward();
    CHECK(renderer.image(1).pixels != shared.pixels);
    const SceneGradient gradient = renderer.backward(batch.grad_images);
    CHECK(gradient.shapes.positions.size() == batch.positions.size());
    CHECK(gradient.shapes.colors.empty());
    CHECK(gradient.meshes[0].colors.size() == batch.scene.meshes[0].mesh.vertex_colors.size());
    renderer.set_views(batch.views);
    renderer.forward();
    CHECK(renderer.image(1).pixels == shared.pixels);
  }

  TEST_CASE("shapes: gradients of the views' own shapes add up to those of one they share") {
    Batch batch = make_batch(false);
    Renderer renderer(open_device());
    renderer.set_scene(batch.scene);
    renderer.set_views(batch.views);
    renderer.forward();
    const ShapesGradient shared = joined(renderer.backward(batch.grad_images));
    std::vector<glm::vec3> positions;
    for (std::size_t s = 0; s < k_shapes; ++s) {
      for (const Instance& instance : batch.scene.meshes) {
        positions.insert(positions.end(), instance.mesh.positions.begin(), instance.mesh.positions.end());
      }
    }
    renderer.set_shapes(positions, {});
    renderer.forward();
    const std::vector<glm::vec3> own = renderer.backward(batch.grad_images).shapes.positions;
    const std::size_t vertices = own.size() / k_shapes;
    for (std::size_t i = 0; i < vertices; ++i) {
      const glm::vec3 sum = own[i] + own[vertices + i] + own[2 * vertices + i];
      CHECK(glm::distance(sum, shared.positions[i]) <= 1e-5F * (1.0F + glm::length(sum)));
    }
  }

  TEST_CASE("shapes: wrong counts and numbers, one by one") {
    Batch batch = make_batch(false);
    Renderer renderer(open_device());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_shapes(batch.positions, {}), "set_scene");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_gradients({}), "set_scene");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_background({}), "set_scene");
    renderer.set_scene(batch.scene);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_background(glm::vec3(NAN)), "background");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_shapes(batch.positions, {}), "positions");
    renderer.set_views(batch.views);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_shapes({}, std::span(batch.colors).first(4)),
                          "colors");
    batch.positions[5].y = std::numeric_limits<float>::quiet_NaN();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_shapes(batch.positions, {}), "positions[5]");
    std::vector<glm::vec4> pixels(7);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.read_pixels(pixels), "forward()");
    renderer.forward();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.read_pixels(pixels), "pixels");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward_pixels(pixels), "pixels");
    std::vector<glm::vec4> grad = joined(batch.grad_images);
    grad[3].w = std::numeric_limits<float>::infinity();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward_pixels(grad), "grad_pixels");
  }
}

}  // namespace dpr::test::pipeline::shapes_test
