#include "solve/pose_window.hpp"

#include <algorithm>
#include <cmath>
#include <variant>

#include "base/checks.hpp"
#include "solve/resample.hpp"

namespace dpr {
namespace {

/// Columns and rows from `low` to below `high`.
struct Window {
  glm::ivec2 low, high;

  glm::ivec2 size() const { return high - low; }
};

Window window_about(const PoseBox& box, int width, int height) {
  constexpr float k_margin = 0.25F;  // of the larger side
  constexpr float k_least = 2;       // pixels
  const float margin = k_margin * std::max(box.width, box.height) + k_least;
  const auto low = [&](float begin, int side) {
    return static_cast<int>(std::clamp(std::floor(begin - margin), 0.0F, static_cast<float>(side - 1)));
  };
  const auto high = [&](float end, int from, int side) {
    return static_cast<int>(
        std::clamp(std::ceil(end + margin), static_cast<float>(from + 1), static_cast<float>(side)));
  };
  Window window{{low(box.x, width), low(box.y, height)}, {}};
  window.high = {high(box.x + box.width, window.low.x, width),
                 high(box.y + box.height, window.low.y, height)};
  return window;
}

Image cut(const Image& image, const Window& window) {
  if (image.pixels.empty()) return image;
  Image result(window.size().x, window.size().y);
  for (int row = 0; row < result.height; ++row) {
    for (int column = 0; column < result.width; ++column)
      result.at(column, row) = image.at(window.low.x + column, window.low.y + row);
  }
  return result;
}

}  // namespace

void validate_box(const PoseBox& box, const Scene& scene) {
  const bool is_seen = box.width > 0 && box.height > 0 && std::isfinite(box.width) &&
                       std::isfinite(box.height) && box.x < static_cast<float>(scene.width) &&
                       box.x + box.width > 0 && box.y < static_cast<float>(scene.height) &&
                       box.y + box.height > 0;
  if (!is_seen) {
    throw InvalidArgument(
        "box (pose)",
        checks::text(box.x) + "," + checks::text(box.y) + "," + checks::text(box.width) + "," +
            checks::text(box.height),
        "x, y, width, height in pixels, of a part of the image, " + checks::size(scene.width, scene.height));
  }
  if (scene.camera.orthographic_height)
    throw InvalidArgument("box (pose)", "an orthographic camera", "a perspective one, or a mask");
}

PoseProblem cut_to_box(const Scene& scene, const Image& target, const PoseOptions& options,
                       const PoseBox& box) {
  const Window window = window_about(box, scene.width, scene.height);
  PoseProblem part{scene, cut(target, window), options};
  part.scene.width = window.size().x;
  part.scene.height = window.size().y;
  part.scene.camera = in_pixels(scene.camera, scene.width, scene.height);
  part.scene.camera.intrinsics->cx -= static_cast<float>(window.low.x);
  part.scene.camera.intrinsics->cy -= static_cast<float>(window.low.y);
  auto& method = std::get<LeastSquares>(part.options.method);
  for (Image* image : {&method.mask, &method.silhouette.image, &method.depth.image})
    *image = cut(*image, window);
  if (method.box) {
    method.box->x -= static_cast<float>(window.low.x);
    method.box->y -= static_cast<float>(window.low.y);
  }
  return part;
}

}  // namespace dpr
