/// Reference for the losses: mean squared error (19), mean absolute error (76), silhouette (75), and the
/// robust one of Geman & McClure, on RGBA images.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace dpr::reference {

/// RGBA, row 0 on top, rgba[4 * (row * width + column) + channel]; A is the silhouette.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<double> rgba;
};

inline Image make_image(int width, int height) {
  return {width, height,
          std::vector<double>(4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height))};
}

enum class Loss { mse, l1, silhouette, robust };

struct NamedLoss {
  Loss loss;
  std::string_view name;
};

/// Every loss, by its name on the command line.
inline constexpr std::array k_losses{NamedLoss{Loss::mse, "mse"}, NamedLoss{Loss::l1, "l1"},
                                     NamedLoss{Loss::silhouette, "silhouette"},
                                     NamedLoss{Loss::robust, "robust"}};

/// Scale of the robust loss.
inline constexpr double k_robust_scale = 0.1;

struct LossResult {
  double value = 0.0;
  Image grad_image;
};

/// Means over the pixels and the three colour channels. At equality the absolute error takes the subgradient
/// zero.
inline LossResult color_loss(Loss kind, const Image& image, const Image& target) {
  LossResult result{0.0, make_image(image.width, image.height)};
  const double scale = 1.0 / (3.0 * image.width * image.height);
  for (std::size_t i = 0; i < image.rgba.size(); ++i) {
    if (i % 4 == 3) continue;
    const double difference = image.rgba[i] - target.rgba[i];
    if (kind == Loss::mse) {
      result.value += scale * difference * difference;
      result.grad_image.rgba[i] = 2.0 * scale * difference;
    } else {
      result.value += scale * std::fabs(difference);
      result.grad_image.rgba[i] = difference == 0.0 ? 0.0 : std::copysign(scale, difference);
    }
  }
  return result;
}

/// (75): 1 - sum(a t) / sum(a + t - a t). Two empty silhouettes agree.
inline LossResult silhouette_loss(const Image& image, const Image& target) {
  LossResult result{0.0, make_image(image.width, image.height)};
  double intersection = 0.0;
  double join = 0.0;
  for (std::size_t i = 3; i < image.rgba.size(); i += 4) {
    const double product = image.rgba[i] * target.rgba[i];
    intersection += product;
    join += image.rgba[i] + target.rgba[i] - product;
  }
  if (join == 0.0) return result;
  result.value = 1.0 - intersection / join;
  for (std::size_t i = 3; i < image.rgba.size(); i += 4) {
    const double t = target.rgba[i];
    result.grad_image.rgba[i] = (intersection * (1.0 - t) / join - t) / join;
  }
  return result;
}

/// Mean over pixels and channels of s / (1 + s / c^2), s = |a - t|^2.
inline LossResult robust_loss(const Image& image, const Image& target) {
  LossResult result{0.0, make_image(image.width, image.height)};
  const double mean = 1.0 / (3.0 * image.width * image.height);
  for (std::size_t pixel = 0; pixel < image.rgba.size(); pixel += 4) {
    double squared = 0.0;
    for (std::size_t i = pixel; i < pixel + 3; ++i) squared += std::pow(image.rgba[i] - target.rgba[i], 2);
    const double c2 = k_robust_scale * k_robust_scale;
    result.value += mean * squared * c2 / (c2 + squared);
    for (std::size_t i = pixel; i < pixel + 3; ++i)
      result.grad_image.rgba[i] =
          mean * 2.0 * (image.rgba[i] - target.rgba[i]) * std::pow(c2 / (c2 + squared), 2);
  }
  return result;
}

/// Value and gradient to the image. Throws std::invalid_argument if the sizes differ.
inline LossResult evaluate_loss(Loss kind, const Image& image, const Image& target) {
  if (image.width != target.width || image.height != target.height ||
      image.rgba.size() != target.rgba.size()) {
    throw std::invalid_argument("evaluate_loss: image and target differ in size");
  }
  if (kind == Loss::silhouette) return silhouette_loss(image, target);
  return kind == Loss::robust ? robust_loss(image, target) : color_loss(kind, image, target);
}

/// The same by name. Throws std::invalid_argument if there is none.
inline LossResult evaluate_loss(std::string_view name, const Image& image, const Image& target) {
  for (const NamedLoss& row : k_losses) {
    if (row.name == name) return evaluate_loss(row.loss, image, target);
  }
  throw std::invalid_argument("evaluate_loss: the reference has no loss " + std::string(name));
}

}  // namespace dpr::reference
