// The image of a scene without noise.
#pragma once

#include "dpr/renderer.hpp"

namespace dpr::test {

inline Image rigid_image(const Device& device, Scene scene) {
  scene.smoothing = rigid_smoothing();
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  return renderer.image();
}

}  // namespace dpr::test
