// Thousands of iterations with every setter: memory, of the device and of the host, stays what it was.
#include <doctest/doctest.h>
#include <malloc.h>

#include <cmath>

#include <vector>

#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/reduced.hpp"

namespace soak_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

/// Bytes that the program holds, of those that it allocated; what an allocator keeps for later is not there.
std::size_t host_bytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

/// Forward, loss, backward; and what changes between two of them, in turn.
class Soak {
 public:
  explicit Soak(const Device& device)
      : scene_(cube_scene(8, 8)),
        target_(8, 8, glm::vec4(0.3F)),
        renderer_(device),
        loss_(device, LossWeights::only(LossKind::mse), std::span(&target_, 1)) {
    scene_.lights = two_lights(Shading::phong);
    renderer_.set_scene(scene_);
  }

  void iterate(int i) {
    change(i);
    renderer_.forward();
    loss_.evaluate(renderer_);
    renderer_.backward(loss_);
  }

 private:
  void change(int i) {
    const float wave = 1.0F + 0.2F * std::sin(0.1F * static_cast<float>(i));
    std::vector<glm::vec3> positions = scene_.meshes[0].mesh.positions;
    for (glm::vec3& p : positions) p *= wave;
    renderer_.set_positions(0, positions);
    if (i % 3 == 0) renderer_.set_views(renderer_.views());
    if (i % 5 == 0) renderer_.set_colors(0, scene_.meshes[0].mesh.face_colors);
    Smoothing smoothing = scene_.smoothing;
    smoothing.sigma *= wave;
    if (i % 7 == 0) renderer_.set_smoothing(smoothing);
    if (i % 11 == 0) renderer_.set_shapes(positions, {});
    if (i % 101 == 0) renderer_.set_scene(scene_);
  }

  Scene scene_;
  Image target_;
  Renderer renderer_;
  ImageLoss loss_;
};

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("soak: 10,000 iterations in constant memory") {
    const int iterations = reduced(10000, 20), warm = iterations / 10;
    const Device device = open_device();
    {
      Soak soak(device);
      for (int i = 0; i < warm; ++i) soak.iterate(i);
      const std::size_t device_before = device.allocated_bytes(), host_before = host_bytes();
      for (int i = warm; i < iterations; ++i) soak.iterate(i);
      CHECK(device.allocated_bytes() <= device_before + device_before / 4);  // headroom, once
      // A leak of 64 bytes an iteration would be twice as much.
      constexpr std::size_t k_drift = 256U << 10U;
      MESSAGE("host: " << host_before << " bytes before, " << host_bytes()
                       << " after; device: " << device_before << ", " << device.allocated_bytes());
      // A simulator keeps records of its own.
      if (!dpr::test::is_reduced()) CHECK(host_bytes() <= host_before + k_drift);
    }
    CHECK(device.allocated_bytes() == 0);
  }
}

}  // namespace soak_test
