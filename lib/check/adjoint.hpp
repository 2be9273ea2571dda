// Forward mode against backward: <u, J v> = <J^T u, v>.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "check/scenes.hpp"
#include "dpr/renderer.hpp"
#include "renderer/tangents.hpp"

namespace dpr::check {

/// Derivatives of images, one a view of the renderer.
inline std::vector<Image> random_images(const Renderer& renderer, Random& random) {
  const Image black(renderer.scene().width, renderer.scene().height);
  std::vector<Image> images(renderer.views().size(), black);
  for (Image& image : images) {
    for (glm::vec4& p : image.pixels) p = glm::vec4(random.vector(-1, 1), random(-1, 1));
  }
  return images;
}

/// A direction along the numbers of one row of the table, and the derivative of <u, images> along it, by the
/// gradient.
struct Way {
  std::string name;
  SceneTangent direction;
  double derivative = 0;
};

/// One for every row with tangents that the gradient has numbers of.
inline std::vector<Way> random_ways(SceneGradient& gradient, bool by_sigma, Random& random) {
  std::vector<Way> ways;
  for (const GradientRow& wanted : gradient_rows()) {
    if (!has_tangent(wanted) || (wanted.path == "sigma" && !by_sigma)) continue;
    Way way{wanted.path, gradient};
    std::size_t numbers = 0;
    for_each_array(way.direction, [&](const GradientRow& row, GradientIndex, const GradientArray& array) {
      transform_numbers(array, [&](double number) {
        if (&row != &wanted) return 0.0;
        const double by = static_cast<double>(random(-1, 1));
        way.derivative += by * number;
        ++numbers;
        return static_cast<double>(static_cast<float>(by));
      });
    });
    if (numbers > 0) ways.push_back(std::move(way));
  }
  return ways;
}

/// Errors of <u, J v>, relative to the sum of the sizes of its terms.
inline std::vector<double> errors_of(Renderer& renderer, const std::vector<Image>& weights,
                                     const std::vector<Way>& ways) {
  std::vector<SceneTangent> directions;
  for (const Way& way : ways) directions.push_back(way.direction);
  const std::vector<Image> tangents = renderer.tangent(directions);
  std::vector<double> errors;
  for (std::size_t d = 0; d < ways.size(); ++d) {
    double sum = 0, size = 0;
    for (std::size_t v = 0; v < weights.size(); ++v) {
      for (std::size_t i = 0; i < weights[v].pixels.size(); ++i) {
        for (int c = 0; c < 4; ++c) {
          const double term = static_cast<double>(weights[v].pixels[i][c]) *
                              static_cast<double>(tangents[d * weights.size() + v].pixels[i][c]);
          sum += term;
          size += std::abs(term);
        }
      }
    }
    errors.push_back(size > 0 || ways[d].derivative != 0
                         ? std::abs(sum - ways[d].derivative) / std::max(size, std::abs(ways[d].derivative))
                         : 0);
  }
  return errors;
}

}  // namespace dpr::check
