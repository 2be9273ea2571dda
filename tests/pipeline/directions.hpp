// Gradients of whole renders against finite differences of the reference, along random directions.
#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "check/comparison.hpp"
#include "pipeline/scenes.hpp"

namespace dpr::test::pipeline {

/// The sum of an image's numbers, each times its weight.
inline double weighted(const reference::Image& image, const Image& weights) {
  double sum = 0;
  for (std::size_t i = 0; i < image.rgba.size(); ++i)
    sum += image.rgba[i] * static_cast<double>(weights.pixels[i / 4][static_cast<int>(i % 4)]);
  return sum;
}

/// A block of parameters of the reference's scene: moving them, and the derivative of weighted() that was
/// found.
struct Direction {
  std::string name;
  std::vector<double> found;
  std::function<void(reference::Scene&, const std::vector<double>&)> move;
};

/// The error along a random direction, relative to the gradient's norm times the part of the direction
/// along it.
inline double error_along(const Scene& scene, const Direction& block, const Image& weights, unsigned seed) {
  constexpr double k_step = 1e-6;
  Random random(seed);
  std::vector<double> way, back;
  double found = 0, squares = 0;
  for (const double g : block.found) {
    way.push_back(k_step * static_cast<double>(random(-1, 1)));
    back.push_back(-way.back());
    found += g * way.back() / k_step;
    squares += way.back() * way.back() / (k_step * k_step);
  }
  reference::Scene above = to_reference(scene), below = above;
  block.move(above, way);
  block.move(below, back);
  const double expected =
      (weighted(reference::render(above), weights) - weighted(reference::render(below), weights)) /
      (2 * k_step);
  return std::abs(found - expected) /
         (norm(block.found) * std::sqrt(squares / static_cast<double>(way.size())));
}

}  // namespace dpr::test::pipeline
