#include "cli/commands.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <vector>

#include "check/scenes.hpp"
#include "device/context.hpp"
#include "device/trial.hpp"
#include "dpr/dpr.hpp"

namespace dpr::cli {
namespace {

double frame_milliseconds(Renderer& renderer, const Image& gradient) {
  const auto start = std::chrono::steady_clock::now();
  renderer.forward();
  renderer.backward({&gradient, 1});
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

Device open_for_trial(const std::string& name) {
  for (const DeviceInfo& info : list_devices()) {
    if (trial_name(info) == name) return dpr::open_device(std::to_string(info.index));
  }
  throw InvalidArgument("--trial", "'" + name + "'", "the name of a device's trial");
}

}  // namespace

void run_trial(const std::string& name) {
  constexpr int k_size = 128, k_frames = 3;
  const unsigned seconds = trial_seconds();
  alarm(seconds);  // ends this process
  const Device device = open_for_trial(name);
  Device::Impl& impl = impl_of(device);
  impl.before_work = [&impl, seconds](std::string_view work) {
    impl.queue.finish();
    alarm(seconds);
    std::printf("begins %.*s\n", static_cast<int>(work.size()), work.data());
    std::fflush(stdout);
  };
  Scene scene = check::scene_of(make_icosphere(3), k_size, k_size);
  scene.smoothing = Smoothing{};
  const Image gradient(k_size, k_size, glm::vec4(1.0F));
  Renderer renderer(device);
  renderer.set_scene(scene);
  frame_milliseconds(renderer, gradient);
  impl.before_work = nullptr;
  alarm(seconds);
  double least = std::numeric_limits<double>::infinity();
  for (int frame = 0; frame < k_frames; ++frame)
    least = std::min(least, frame_milliseconds(renderer, gradient));
  std::printf("milliseconds %.3f\n", least);
}

}  // namespace dpr::cli
