// Renderers on threads of their own, with one Device for all or one each: every thread gets the bits that one
// alone gets, and what the Device counts is counted right.
#include <doctest/doctest.h>

#include <exception>
#include <thread>
#include <vector>

#include "device/context.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/determinism.hpp"
#include "support/reduced.hpp"

using namespace dpr;
using namespace dpr::test::pipeline;
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

/// work() of every thread, all at the same time.
std::vector<Result> work_together(const std::vector<Device>& devices) {
  std::vector<Result> results(devices.size());
  std::vector<std::exception_ptr> errors(devices.size());
  {
    std::vector<std::jthread> threads;
    for (std::size_t t = 0; t < devices.size(); ++t) {
      threads.emplace_back([&, t] {
        try {
          results[t] = work(devices[t], t, reduced(4, 1));
        } catch (...) {
          errors[t] = std::current_exception();
        }
      });
    }
  }
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
  return results;
}

void check_threads(const std::vector<Device>& devices) {
  const std::vector<Result> together = work_together(devices);
  for (std::size_t t = 0; t < devices.size(); ++t) {
    CAPTURE(t);
    const Result alone = work(devices[t], t, 1);
    CHECK(same_bits(together[t].image, alone.image));
    CHECK(same_bits(together[t].gradient, alone.gradient));
    CHECK(together[t].loss == alone.loss);
  }
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
    CHECK(device.impl().host_waits > k_threads);
  }

  TEST_CASE("threads: renderers on Devices of their own") {
    if (open_device().info().platform == "Oclgrind") return;
    std::vector<Device> devices;
    for (std::size_t t = 0; t < k_threads; ++t) devices.push_back(open_device());
    check_threads(devices);
  }
}
