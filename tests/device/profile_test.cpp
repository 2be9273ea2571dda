// Profiles: every launch is timed while one lives, and the device is as it was when it ends.
#include "device/profile.hpp"

#include <doctest/doctest.h>

#include "dpr/dpr.hpp"

namespace profile_test {

using namespace dpr;

TEST_SUITE("unit") {
  TEST_CASE("a profile times every launch while it lives, by file and kernel") {
    Scene scene;
    scene.smoothing = smoothing_preset("gaussian");
    scene.width = scene.height = 8;
    scene.meshes.push_back({make_cube()});
    scene.camera = orbit_camera(6.7F, 30.0F, 120.0F);
    const Device device = open_device();
    const cl_command_queue before = impl_of(device).queue();
    Renderer renderer(device);
    renderer.set_scene(scene);
    {
      Profile profile(device);
      CHECK(profile.take().empty());
      renderer.forward();
      const auto launches = profile.take();
      REQUIRE_FALSE(launches.empty());
      CHECK(launches.front().file == "transform.cl");
      CHECK(launches.front().kernel == "transform_forward");
      CHECK(launches.back().file == "aggregate.cl");
      for (const Profile::Launch& launch : launches) CHECK(launch.milliseconds >= 0);
      CHECK(profile.take().empty());
    }
    CHECK(impl_of(device).queue() == before);
    renderer.forward();  // nothing is recorded any more
    CHECK(impl_of(device).profile == nullptr);
  }
}

}  // namespace profile_test
