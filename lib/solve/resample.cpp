// Area resampling, one direction after the other.
#include "solve/resample.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace dpr {
namespace {

struct Tap {
  int pixel;
  float weight;
};

/// The pixels under a new pixel, and how much of it each covers.
std::vector<Tap> taps(int index, int size, int new_size) {
  const double scale = static_cast<double>(size) / new_size;
  const double begin = index * scale, end = (index + 1) * scale;
  std::vector<Tap> result;
  for (int i = static_cast<int>(begin); i < size && i < end; ++i) {
    const double covered = std::min(end, i + 1.0) - std::max(begin, static_cast<double>(i));
    if (covered > 0) result.push_back({i, static_cast<float>(covered / scale)});
  }
  return result;
}

Image resample_columns(const Image& image, int width) {
  Image result(width, image.height);
  for (int column = 0; column < width; ++column) {
    for (const auto& [source, weight] : taps(column, image.width, width)) {
      for (int row = 0; row < image.height; ++row) result.at(column, row) += weight * image.at(source, row);
    }
  }
  return result;
}

Image resample_rows(const Image& image, int height) {
  Image result(image.width, height);
  for (int row = 0; row < height; ++row) {
    for (const auto& [source, weight] : taps(row, image.height, height)) {
      for (int column = 0; column < image.width; ++column) {
        result.at(column, row) += weight * image.at(column, source);
      }
    }
  }
  return result;
}

}  // namespace

Image resample(const Image& image, int width, int height) {
  if (width == image.width && height == image.height) return image;
  return resample_rows(resample_columns(image, width), height);
}

Image resample_weighted(Image image, int width, int height) {
  for (glm::vec4& p : image.pixels) p = glm::vec4(p.w * glm::vec3(p), p.w);
  Image result = resample(image, width, height);
  for (glm::vec4& p : result.pixels) p = p.w > 0 ? glm::vec4(glm::vec3(p) / p.w, p.w) : glm::vec4(0);
  return result;
}

bool has_depth(const glm::vec4& pixel) {
  return pixel.w > 0 && pixel.x != 0 && std::isfinite(pixel.x) && std::isfinite(pixel.w);
}

std::vector<bool> holes_of(const Image& depth) {
  const auto width = static_cast<std::size_t>(depth.width);
  const std::size_t count = depth.pixels.size();
  // To the pixels around, along rows and then along columns.
  const auto spread = [&](const std::vector<char>& marks) {
    std::vector<char> wide = marks;
    for (std::size_t i = 1; i < count; ++i) {
      if (i % width == 0) continue;
      wide[i - 1] |= marks[i];
      wide[i] |= marks[i - 1];
    }
    std::vector<char> result = wide;
    for (std::size_t i = width; i < count; ++i) {
      result[i - width] |= wide[i];
      result[i] |= wide[i - width];
    }
    return result;
  };
  std::vector<char> known(count);
  for (std::size_t i = 0; i < count; ++i) known[i] = has_depth(depth.pixels[i]) ? 1 : 0;
  // What is left when the pixels with a depth grow by one, and what then has none does.
  std::vector<char> beyond = spread(known);
  for (char& mark : beyond) mark ^= 1;
  beyond = spread(beyond);
  std::vector<bool> holes(count);
  for (std::size_t i = 0; i < count; ++i) holes[i] = beyond[i] == 0 && known[i] == 0;
  return holes;
}

Image resample_medians(const Image& image, int width, int height) {
  Image result(width, height);
  std::vector<float> numbers;
  for (int row = 0; row < height; ++row) {
    const std::vector<Tap> rows = taps(row, image.height, height);
    for (int column = 0; column < width; ++column) {
      numbers.clear();
      float part = 0;
      for (const Tap& x : taps(column, image.width, width)) {
        for (const Tap& y : rows) {
          const glm::vec4& p = image.at(x.pixel, y.pixel);
          if (!(p.w > 0)) continue;
          numbers.push_back(p.x);
          part += x.weight * y.weight;
        }
      }
      if (numbers.empty()) continue;
      const auto middle = numbers.begin() + std::ssize(numbers) / 2;
      std::ranges::nth_element(numbers, middle);
      result.at(column, row) = glm::vec4(glm::vec3(*middle), part);
    }
  }
  return result;
}

double view_depth(const Camera& camera, const glm::dvec3& point) {
  return -(glm::dmat4(camera.view) * glm::dvec4(point, 1.0)).z;
}

Camera in_pixels(Camera camera, int width, int height) {
  if (camera.intrinsics) return camera;
  const double focal = 0.5 * height / std::tan(0.5 * glm::radians(static_cast<double>(camera.fov_y_degrees)));
  camera.intrinsics = Intrinsics{static_cast<float>(focal), static_cast<float>(focal),
                                 0.5F * static_cast<float>(width), 0.5F * static_cast<float>(height)};
  return camera;
}

Camera resample(const Camera& camera, int width, int height, int new_width, int new_height) {
  if ((width == new_width && height == new_height) || camera.orthographic_height) return camera;
  // In pixels, whatever the camera was given by: the ratio of the sides may change by rounding.
  Camera result = in_pixels(camera, width, height);
  const Intrinsics k = *result.intrinsics;
  const float x = static_cast<float>(new_width) / static_cast<float>(width);
  const float y = static_cast<float>(new_height) / static_cast<float>(height);
  result.intrinsics = Intrinsics{k.fx * x, k.fy * y, k.cx * x, k.cy * y};
  return result;
}

Camera zoomed(Camera camera, double scale) {
  if (camera.orthographic_height) {
    *camera.orthographic_height /= static_cast<float>(scale);
  } else if (auto& k = camera.intrinsics) {
    k->fx *= static_cast<float>(scale);
    k->fy *= static_cast<float>(scale);
  } else {
    const double half_angle = 0.5 * glm::radians(static_cast<double>(camera.fov_y_degrees));
    camera.fov_y_degrees = static_cast<float>(glm::degrees(2 * std::atan(std::tan(half_angle) / scale)));
  }
  return camera;
}

CameraGradient zoom_tangent(const Camera& camera) {
  CameraGradient tangent;
  if (camera.orthographic_height) {
    tangent.orthographic_height = -static_cast<double>(*camera.orthographic_height);
  } else if (const auto& k = camera.intrinsics) {
    tangent.intrinsics = {static_cast<double>(k->fx), static_cast<double>(k->fy), 0, 0};
  } else {
    // 1 / tan(angle / 2) grows by itself.
    tangent.fov_y_degrees = -glm::degrees(std::sin(glm::radians(static_cast<double>(camera.fov_y_degrees))));
  }
  return tangent;
}

}  // namespace dpr
