// Attributes and auxiliary outputs of a frame that only the device knows, by buffers: to the numbers of the
// ordinary path, which the host has given everything.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "dpr/dpr.hpp"
#include "dpr/opencl_handles.hpp"
#include "pipeline/determinism.hpp"
#include "pipeline/device_buffers.hpp"
#include "pipeline/scenes.hpp"
#include "scene/gradient_table.hpp"
#include "support/caller.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace attributes_on_device_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::Caller;
using dpr::test::reduced;

namespace {

/// Two meshes of their own corners, so that nothing is closed, with texture coordinates.
Scene preset_scene(const char* preset) {
  Scene scene = scene_of(random_soup(6, 23), reduced(21, 8), reduced(17, 7));
  scene.meshes.push_back({random_soup(3, 5), placed(40.0F, 0.8F)});
  Random random(31);
  for (Instance& instance : scene.meshes) {
    Mesh& mesh = instance.mesh;
    for (unsigned corner = 0; corner < 3 * mesh.faces.size(); ++corner) {
      mesh.texcoords.emplace_back(random(0.0F, 1.0F), random(0.0F, 2.0F));
      if (corner % 3 == 0) mesh.face_texcoords.emplace_back(corner, corner + 1, corner + 2);
    }
  }
  scene.smoothing = smoothing_preset(preset, scene.width, scene.height);
  scene.gradients = {};
  scene.gradients.texcoords = true;
  return scene;
}

std::vector<View> poses_of(const Scene& scene) {
  const View first{scene.camera, {scene.meshes[0].transform, scene.meshes[1].transform}};
  View second = first;
  second.transforms[0] = placed(80.0F, 0.8F, {0.2F, 0.1F, 0.0F});
  second.camera = orbit_camera(6, 10, 200);
  return {first, second};
}

std::size_t count_vertices(const Scene& scene) {
  std::size_t count = 0;
  for (const Instance& instance : scene.meshes) count += instance.mesh.positions.size();
  return count;
}

/// The views' poses and the meshes' positions from buffers, over a scene that has others.
void set_poses_and_positions(const Caller& caller, Renderer& renderer, const Scene& scene) {
  Scene spoiled = scene;
  for (Instance& instance : spoiled.meshes) {
    for (glm::vec3& p : instance.mesh.positions) p *= 0.9F;
  }
  renderer.set_scene(spoiled);
  const std::vector<View> views = poses_of(scene);
  std::vector<View> moved = views;
  for (View& view : moved) {
    view.camera.view[3].z -= 0.2F;
    view.transforms[1][3].x += 0.1F;
  }
  renderer.set_views(moved);
  std::vector<float> transforms, matrices;
  for (const View& view : views) {
    const std::vector<float> matrix = rows_of(view.camera.view);
    matrices.insert(matrices.end(), matrix.begin(), matrix.end());
    for (const glm::mat4& transform : view.transforms) {
      const std::vector<float> rows = rows_of(transform);
      transforms.insert(transforms.end(), rows.begin(), rows.end());
    }
  }
  set_transforms(renderer, {caller.buffer(transforms)()});
  set_view_matrices(renderer, {caller.buffer(matrices)()});
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const std::vector<glm::vec3>& positions = scene.meshes[m].mesh.positions;
    set_positions(renderer, m, {caller.buffer(packed(std::span(positions)))()});
  }
}

constexpr std::size_t k_own_channels = 4;  // of numbers of the caller's: two groups

std::vector<float> some_values(const Scene& scene) {
  Random random(7);
  std::vector<float> values;
  for (std::size_t i = 0; i < k_own_channels * count_vertices(scene); ++i)
    values.push_back(random(-2.0F, 3.0F));
  return values;
}

/// The attributes, and numbers of the caller's, of which the second has them from a buffer.
std::vector<std::pair<AttributeImages, AttributeImages>> twins(const Caller& caller, const Device& device,
                                                               const Scene& scene) {
  std::vector<std::pair<AttributeImages, AttributeImages>> all;
  for (const Attribute attribute :
       {Attribute::depth, Attribute::position, Attribute::normal, Attribute::texcoords})
    all.emplace_back(AttributeImages(device, attribute), AttributeImages(device, attribute));
  const std::vector<float> values = some_values(scene);
  std::vector<float> spread(1 + 5 * count_vertices(scene));
  for (std::size_t i = 0; i < values.size(); ++i) spread[1 + i / 4 * 5 + i % 4] = values[i];
  all.emplace_back(AttributeImages(device, k_own_channels, values),
                   AttributeImages(device, k_own_channels, {}));
  set_values(all.back().second, {caller.buffer(spread)(), sizeof(float), 5 * sizeof(float)},
             count_vertices(scene));
  return all;
}

std::vector<float> rgba_of(const std::vector<Image>& images) {
  std::vector<float> floats;
  for (const Image& image : images) {
    const std::vector<float> own = packed(std::span<const glm::vec4>(image.pixels));
    floats.insert(floats.end(), own.begin(), own.end());
  }
  return floats;
}

std::vector<Image> images_of_groups(const AttributeImages& images, std::size_t views) {
  std::vector<Image> all;
  for (std::size_t group = 0; group < images.groups(); ++group) {
    for (std::size_t view = 0; view < views; ++view) all.push_back(images.image(view, group));
  }
  return all;
}

/// Frames on the device are prepared for faces that cross the near plane, which rounds otherwise.
void check_close(const std::vector<float>& found, const std::vector<float>& expected, double tolerance) {
  REQUIRE(found.size() == expected.size());
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    difference += std::pow(static_cast<double>(found[i] - expected[i]), 2);
    size += std::pow(static_cast<double>(expected[i]), 2);
  }
  CHECK(std::sqrt(difference) <= tolerance * std::sqrt(size));
}

/// Every gradient that the host's has, by name. Returns how many.
std::size_t check_attribute_gradients(const Caller& caller, AttributeImages& images,
                                      SceneGradient& expected) {
  std::size_t checked = 0;
  for_each_array(expected, [&](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    std::vector<float> values;
    double size = 0;
    transform_numbers(array, [&](double value) {
      values.push_back(static_cast<float>(value));
      size += std::fabs(value);
      return value;
    });
    if (size == 0) return;
    const std::string name = name_of(row, index);
    CAPTURE(name);
    check_close(read_view(caller, gradient_view(images, name)), values, 1e-4);
    ++checked;
  });
  return checked;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("attributes on device: images and gradients are those of the ordinary path") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    for (const char* const preset : {"gaussian", "joint_gaussian", "pixel"}) {
      if (dpr::test::is_reduced() && std::string(preset) != "gaussian") continue;
      CAPTURE(std::string(preset));
      const Scene scene = preset_scene(preset);
      Renderer ordinary(device), renderer(device);
      ordinary.set_scene(scene);
      ordinary.set_views(poses_of(scene));
      ordinary.forward();
      set_poses_and_positions(caller, renderer, scene);
      forward_on_device(renderer);
      for (auto& [host, on_device] : twins(caller, device, scene)) {
        host.forward(ordinary);
        const std::vector<Image> images = images_of_groups(host, 2);
        std::vector<Image> grads;
        for (unsigned i = 0; i < images.size(); ++i)
          grads.push_back(random_image(scene.width, scene.height, -1.0F, 1.0F, 5 + i));
        SceneGradient expected = host.backward(grads);
        const cl::Buffer grad = caller.buffer(rgba_of(grads));
        for (int frame = 0; frame < 2; ++frame) {  // measured, then within what was measured
          forward_on_device(on_device, renderer);
          backward_on_device(on_device, {grad()});
          check_close(read_view(caller, image_view(on_device)), rgba_of(images), 1e-6);
          CHECK(check_attribute_gradients(caller, on_device, expected) >= 10);
        }
        if (!host.grad_values().empty()) {
          check_close(read_view(caller, gradient_view(on_device, "values")),
                      {host.grad_values().begin(), host.grad_values().end()}, 1e-5);
        }
        CHECK(frame_history(on_device).emptied == 0);
        // By way of the host too.
        on_device.forward(renderer);
        check_close(rgba_of(images_of_groups(on_device, 2)), rgba_of(images), 1e-6);
      }
    }
  }

  TEST_CASE("attributes on device: shapes of views, and the way back to the host's") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    const Scene scene = preset_scene("gaussian");
    std::vector<glm::vec3> shapes;
    for (const float scale : {1.0F, 0.8F}) {
      for (const Instance& instance : scene.meshes) {
        for (const glm::vec3& p : instance.mesh.positions) shapes.push_back(scale * p);
      }
    }
    Renderer ordinary(device), renderer(device);
    for (Renderer* const r : {&ordinary, &renderer}) {
      r->set_scene(scene);
      r->set_views(poses_of(scene));
      r->forward();
    }
    const std::vector<Image> grads(2, random_image(scene.width, scene.height, -1.0F, 1.0F));
    const cl::Buffer grad = caller.buffer(rgba_of(grads));
    AttributeImages host(device, Attribute::normal), on_device(device, Attribute::normal);
    host.forward(ordinary);
    const std::vector<Image> of_scene = images_of_groups(host, 2);
    ordinary.set_shapes(shapes, {});
    set_shapes(renderer, {caller.buffer(packed(std::span<const glm::vec3>(shapes)))()}, {});
    ordinary.forward();
    forward_on_device(renderer);
    host.forward(ordinary);
    SceneGradient expected = host.backward(grads);
    forward_on_device(on_device, renderer);
    backward_on_device(on_device, {grad()});
    check_close(read_view(caller, image_view(on_device)), rgba_of(images_of_groups(host, 2)), 1e-6);
    CHECK(check_attribute_gradients(caller, on_device, expected) >= 10);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(on_device, "meshes[0].positions"), "name");
    set_shapes(renderer, {}, {});
    forward_on_device(renderer);
    forward_on_device(on_device, renderer);
    check_close(read_view(caller, image_view(on_device)), rgba_of(of_scene), 1e-6);
    // Poses from a buffer, then the host's again.
    std::vector<float> same;
    for (int i = 0; i < 4; ++i) {
      const std::vector<float> rows = rows_of(placed(10.0F));
      same.insert(same.end(), rows.begin(), rows.end());
    }
    set_transforms(renderer, {caller.buffer(same)()});
    forward_on_device(renderer);
    forward_on_device(on_device, renderer);
    CHECK(read_view(caller, image_view(on_device)) != rgba_of(of_scene));
    renderer.set_views(poses_of(scene));
    forward_on_device(renderer);
    forward_on_device(on_device, renderer);
    check_close(read_view(caller, image_view(on_device)), rgba_of(of_scene), 1e-6);
  }

  TEST_CASE("attributes on device: losses of attributes know positions from a buffer") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    Scene scene = preset_scene("joint_gaussian");
    Renderer ordinary(device), renderer(device);
    ordinary.set_scene(scene);
    ordinary.set_views(poses_of(scene));
    set_poses_and_positions(caller, renderer, scene);
    const std::vector<Image> none(2, Image(scene.width, scene.height)),
        deep(2, random_image(scene.width, scene.height, 0.0F, 3.0F));
    const AttributeTarget target{Attribute::depth, {.mse = 1}, deep};
    std::vector<double> values;
    std::vector<std::vector<float>> gradients;
    for (Renderer* const r : {&ordinary, &renderer}) {
      ImageLoss loss(device, LossOptions{.attributes = std::span(&target, 1)}, none);
      r->forward();
      values.push_back(loss.evaluate(*r));
      gradients.push_back(packed(std::span<const glm::vec3>(r->backward(loss).meshes[0].positions)));
    }
    CHECK(values[1] == doctest::Approx(values[0]).epsilon(1e-6));
    check_close(gradients[1], gradients[0], 1e-4);
  }

  TEST_CASE("auxiliary outputs on device: views and copies are what the host gets") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    for (const char* const preset : {"gaussian", "pixel", "paper_gaussian"}) {
      const Scene scene = preset_scene(preset);
      Renderer renderer(device);
      set_poses_and_positions(caller, renderer, scene);
      forward_on_device(renderer);
      std::vector<std::vector<float>> found;
      const auto pixels = static_cast<std::size_t>(scene.width * scene.height);
      const cl::Buffer faces(caller.context, CL_MEM_READ_WRITE, (1 + 4 * pixels) * sizeof(cl_int)),
          normals(caller.context, CL_MEM_READ_WRITE, (2 + 2 * 5 * pixels) * sizeof(float));
      copy_aov(renderer, Aov::face_id, {faces(), sizeof(cl_int), 2 * sizeof(cl_int)});
      copy_aov(renderer, Aov::normal, {normals(), 2 * sizeof(float), 5 * sizeof(float)});
      for (const Aov aov : {Aov::depth, Aov::normal, Aov::barycentrics, Aov::uv, Aov::effective_faces})
        found.push_back(read_view(caller, aov_view(renderer, aov)));
      const std::vector<cl_int> of_faces = caller.read<cl_int>(faces);
      const std::vector<float> of_normals = caller.read(normals);
      std::size_t seen = 0;
      for (std::size_t view = 0; view < 2; ++view) {
        const AuxiliaryOutputs expected = auxiliary_outputs(renderer, view);
        for (std::size_t i = 0; i < pixels; ++i) {
          const std::size_t at = view * pixels + i;
          CHECK(found[0][at] == expected.depth[i]);
          CHECK(glm::vec3(found[1][3 * at], found[1][3 * at + 1], found[1][3 * at + 2]) ==
                expected.normal[i]);
          CHECK(of_normals[2 + 5 * at + 1] == expected.normal[i].y);
          CHECK(found[2][3 * at + 1] == expected.barycentrics[i].y);
          CHECK(glm::vec2(found[3][2 * at], found[3][2 * at + 1]) == glm::vec2(expected.uv[i]));
          CHECK(found[4][at] == expected.effective_faces[i]);
          CHECK(of_faces[1 + 2 * at] == expected.face_id[i]);
          seen += expected.face_id[i] >= 0 ? 1 : 0;
        }
      }
      CHECK(seen > 0);
    }
  }

  TEST_CASE("auxiliary outputs on device: a frame that was emptied has none, and the whole one has") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    Renderer renderer(device);
    renderer.set_scene(preset_scene("gaussian"));
    reserve(renderer, {.pairs = 1, .fragments = 1});
    forward_on_device(renderer);
    for (const float depth : read_view(caller, aov_view(renderer, Aov::depth))) CHECK(depth == 0);
    const AuxiliaryOutputs whole = auxiliary_outputs(renderer);
    CHECK(read_view(caller, aov_view(renderer, Aov::depth)) == whole.depth);
    CHECK(*std::ranges::max_element(whole.depth) > 1);
  }

  TEST_CASE("attributes on device: events order queues that are not in order") {
    const Caller caller(CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE);
    const Device device = adopt_device(caller.context(), caller.queue());
    const Scene scene = preset_scene("gaussian");
    Renderer renderer(device);
    renderer.set_scene(scene);
    AttributeImages depth(device, Attribute::depth);
    reserve(renderer, {.pairs = 500, .fragments = 10000});
    reserve(depth, {.pairs = 1000, .fragments = 20000});
    const auto pixels = static_cast<std::size_t>(scene.width * scene.height);
    const cl::Buffer images(caller.context, CL_MEM_READ_WRITE, 4 * pixels * sizeof(float)),
        outputs(caller.context, CL_MEM_READ_WRITE, pixels * sizeof(float)),
        grad(caller.context, CL_MEM_READ_WRITE, 3 * scene.meshes[0].mesh.positions.size() * sizeof(float));
    for (int frame = 0; frame < 3; ++frame) {
      cl::Event positions, shown, copied, gradient, output;
      cl::Event written;
      std::vector<glm::vec3> moved = scene.meshes[0].mesh.positions;
      for (glm::vec3& p : moved) p *= 1.0F - 0.1F * static_cast<float>(frame);
      const cl::Buffer places(caller.context, CL_MEM_READ_WRITE, moved.size() * sizeof(glm::vec3));
      caller.queue.enqueueWriteBuffer(places, CL_FALSE, 0, moved.size() * sizeof(glm::vec3), moved.data(),
                                      nullptr, &written);
      caller.queue.flush();
      set_positions(renderer, 0, {places()}, {.wait = {&written(), 1}, .done = &positions()});
      forward_on_device(renderer);
      forward_on_device(depth, renderer, {.done = &shown()});
      copy_images(depth, {images()}, {.wait = {&shown(), 1}, .done = &copied()});
      copy_aov(renderer, Aov::depth, {outputs()}, {.done = &output()});
      backward_on_device(depth, {images()}, {.wait = {&copied(), 1}});
      copy_gradient(depth, "meshes[0].positions", {grad()}, {.done = &gradient()});
      const std::vector<float> found = caller.read(images, {copied}), means = caller.read(outputs, {output}),
                               slopes = caller.read(grad, {gradient});
      CHECK(frame_history(renderer).emptied == 0);
      CHECK(frame_history(depth).emptied == 0);
      renderer.set_positions(0, moved);
      renderer.forward();
      AttributeImages fresh(device, Attribute::depth);
      fresh.forward(renderer);
      const Image expected = fresh.image();
      check_close(found, rgba_of({expected}), 1e-6);
      check_close(means, auxiliary_outputs(renderer).depth, 1e-6);
      const SceneGradient of_host = fresh.backward(std::span(&expected, 1));
      check_close(slopes, packed(std::span<const glm::vec3>(of_host.meshes[0].positions)), 1e-4);
    }
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("attributes on device: what cannot be is refused") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    const Scene scene = cube_scene(12, 10);
    Renderer renderer(device);
    AttributeImages depth(device, Attribute::depth), texcoords(device, Attribute::texcoords),
        values(device, 2, {});
    const cl::Buffer buffer(caller.context, CL_MEM_READ_WRITE, 12);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, aov_view(renderer, Aov::depth), "forward() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, forward_on_device(depth, renderer), "forward() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, image_view(depth), "forward() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, backward_on_device(depth, {buffer()}), "forward() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(depth, "sigma"), "forward() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, frame_history(depth), "forward() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, reserve(depth, {.pairs = std::size_t{1} << 40U}), "pairs");
    renderer.set_scene(scene);
    forward_on_device(renderer);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, aov_view(renderer, Aov::uv), "texture coordinates");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, copy_aov(renderer, Aov::depth, {buffer()}), "outputs");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, forward_on_device(texcoords, renderer), "no texture coordinates");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, forward_on_device(values, renderer), "got 0, expected 48");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set_values(depth, {buffer()}, 1), "depth");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set_values(values, {buffer()}, 24), "room for");
    Renderer other(open_device());
    other.set_scene(scene);
    other.forward();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, forward_on_device(depth, other), "device");
    forward_on_device(depth, renderer);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(depth, "sigma"), "backward_on_device() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, backward_on_device(depth, {buffer()}), "grad_images");
    backward_on_device(depth, image_view(depth).span());
    CHECK(gradient_view(depth, "sigma").count == 1);
    for (const char* const name : {"values", "meshes[0].texcoords", "background", "meshes[1].positions"})
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(depth, name), "name (gradient_view)");
  }
}

}  // namespace attributes_on_device_test
