#include "views.hpp"

#include <algorithm>
#include <cmath>

namespace dpr::experiments {

std::vector<Camera> cameras_around(std::size_t count, double turn_degrees) {
  constexpr float k_distance = 3.2F, k_fov_degrees = 45, k_znear = 1, k_zfar = 6;
  constexpr double k_golden_angle = 137.50776405003785, k_poles = 0.95;  // not quite up to them
  std::vector<Camera> cameras;
  for (std::size_t i = 0; i < count; ++i) {
    const double height = 1 - 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double azimuth = std::fmod(k_golden_angle * static_cast<double>(i) + turn_degrees, 360);
    Camera camera = orbit_camera(k_distance, static_cast<float>(glm::degrees(std::asin(k_poles * height))),
                                 static_cast<float>(azimuth));
    camera.fov_y_degrees = k_fov_degrees;
    camera.znear = k_znear;
    camera.zfar = k_zfar;
    cameras.push_back(camera);
  }
  return cameras;
}

void round_to_8_bits(Image& image) {
  for (glm::vec4& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) pixel[c] = std::round(255 * std::clamp(pixel[c], 0.0F, 1.0F)) / 255;
  }
}

double psnr(const std::vector<Image>& images, const std::vector<Image>& targets, float least_alpha) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    for (std::size_t k = 0; k < images[i].pixels.size(); ++k) {
      const glm::vec4 &found = images[i].pixels[k], &wanted = targets[i].pixels[k];
      if (wanted.a < least_alpha) continue;
      const glm::dvec3 difference(found - wanted);
      sum += glm::dot(difference, difference);
      count += 3;
    }
  }
  return -10 * std::log10(sum / count);
}

}  // namespace dpr::experiments
