// Renderers on threads of their own, with one Device for all or one each: every thread gets the bits that one
// alone gets, and what the Device counts is counted right.
#include <doctest/doctest.h>

#include <algorithm>
#include <exception>
#include <thread>
#include <vector>

#include "device/context.hpp"
#include "dpr/dpr.hpp"
#include "dpr/opencl_handles.hpp"
#include "pipeline/determinism.hpp"
#include "support/caller.hpp"
#include "support/reduced.hpp"

namespace threads_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::Caller;
using dpr::test::reduced;

namespace {

struct Result {
  Image image;
  SceneGradient gradient;
  double loss = 0;
};

Scene scene_of_thread(std::size_t thread) {
  Scene scene = cube_scene(16, 14);
  scene.smoothing.sigma *= 1 + static_cast<float>(thread);
  scene.smoothing.depth_prior = thread % 2 == 0 ? Prior::gaussian : Prior::logistic;
  return scene;
}

/// Everything that a thread may do with a renderer, several times.
Result work(const Device& device, std::size_t thread, int repetitions) {
  const Scene scene = scene_of_thread(thread);
  Renderer renderer(device);
  const Image target(scene.width, scene.height, glm::vec4(0.4F));
  ImageLoss loss(device, LossWeights::only(LossKind::mse), std::span(&target, 1));
  Result result;
  for (int i = 0; i < repetitions; ++i) {
    renderer.set_scene(scene);
    renderer.set_positions(0, scene.meshes[0].mesh.positions);
    renderer.set_smoothing(scene.smoothing);
    renderer.forward();
    result.loss = loss.evaluate(renderer);
    result.image = renderer.image();
    result.gradient = renderer.backward(loss);
  }
  return result;
}

/// work(thread) of every thread, all at the same time.
template <class Work>
void work_together(std::size_t count, const Work& work) {
  std::vector<std::exception_ptr> errors(count);
  {
    std::vector<std::jthread> threads;
    for (std::size_t t = 0; t < count; ++t) {
      threads.emplace_back([&, t] {
        try {
          work(t);
        } catch (...) {
          errors[t] = std::current_exception();
        }
      });
    }
  }
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

void check_threads(const std::vector<Device>& devices) {
  std::vector<Result> together(devices.size());
  work_together(devices.size(), [&](std::size_t t) { together[t] = work(devices[t], t, reduced(4, 1)); });
  for (std::size_t t = 0; t < devices.size(); ++t) {
    CAPTURE(t);
    const Result alone = work(devices[t], t, 1);
    CHECK(same_bits(together[t].image, alone.image));
    CHECK(same_bits(together[t].gradient, alone.gradient));
    CHECK(together[t].loss == alone.loss);
  }
}

/// Steps that stay on the device: of positions that all threads share, to the thread's part of their
/// gradients.
void work_on_device(const Device& device, std::size_t thread, const cl::Buffer& positions,
                    const cl::Buffer& gradients) {
  const Scene scene = scene_of_thread(thread);
  Renderer renderer(device);
  renderer.set_scene(scene);
  const std::size_t bytes = scene.meshes[0].mesh.positions.size() * sizeof(glm::vec3);
  std::vector<cl_event> done(reduced(4, 1));
  for (cl_event& event : done) {
    set_positions(renderer, 0, {positions()});
    forward_on_device(renderer);
    backward_on_device(renderer, image_view(renderer).span());
    copy_gradient(renderer, "meshes[0].positions", {gradients(), thread * bytes}, {.done = &event});
  }
  check_cl(clWaitForEvents(static_cast<cl_uint>(done.size()), done.data()), "clWaitForEvents");
  for (const cl_event event : done) clReleaseEvent(event);
}

constexpr std::size_t k_threads = 8;

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("threads: renderers on one Device") {
    const Device device = open_device();
    if (device.info().platform == "Oclgrind") return;  // serves one thread
    check_threads(std::vector<Device>(k_threads, device));
    CHECK(device.allocated_bytes() == 0);
    CHECK(device.peak_allocated_bytes() > 0);
    CHECK(impl_of(device).host_waits > k_threads);
  }

  TEST_CASE("threads: renderers that stay on the device share a buffer and a queue") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    if (device.info().platform == "Oclgrind") return;
    const std::vector<glm::vec3> shape = scene_of_thread(0).meshes[0].mesh.positions;
    const cl::Buffer positions = caller.buffer(shape),
                     gradients = caller.buffer(std::vector<glm::vec3>(k_threads * shape.size()));
    work_together(k_threads, [&](std::size_t t) { work_on_device(device, t, positions, gradients); });
    const std::vector<glm::vec3> found = caller.read<glm::vec3>(gradients);
    for (std::size_t t = 0; t < k_threads; ++t) {
      CAPTURE(t);
      Renderer alone(device);
      alone.set_scene(scene_of_thread(t));
      alone.forward();
      const Image image = alone.image();
      const std::vector<glm::vec3> expected = alone.backward(std::span(&image, 1)).meshes[0].positions;
      CHECK(std::equal(expected.begin(), expected.end(),
                       found.begin() + static_cast<std::ptrdiff_t>(t * shape.size())));
    }
  }

  TEST_CASE("threads: renderers on Devices of their own") {
    if (open_device().info().platform == "Oclgrind") return;
    std::vector<Device> devices;
    for (std::size_t t = 0; t < k_threads; ++t) devices.push_back(open_device());
    check_threads(devices);
  }
}

}  // namespace threads_test
