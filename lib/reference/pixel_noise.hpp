/// Reference for noise on the pixel's position: I = E[R(x + s Z)], x anywhere in the pixel. Double precision,
/// serial, brute force; no raster.
///
/// R is the rigid image: at a point of the image plane the triangles that cover it, each over those behind it or,
/// with gamma, mixed by the noise of the depths. Its convolution with the noise's density and the pixel's
/// area is an integral over the image plane, taken line by line. Between two neighbouring heights at which
/// anything begins, ends or crosses, the integral along a line is a smooth function of its height; between
/// two crossings of a line, R is a smooth function. So Gauss-Legendre is exact to rounding, and finite
/// differences of the image are as good as their step.
///
/// The line along which triangles pass through each other is not followed at a gamma of 0.
#pragma once

#include "renderer.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace dpr::reference {

/// Scale of the noise, NDC.
inline double pixel_noise_scale(const Smoothing& smoothing) {
  return smoothing.distance == DistanceMetric::squared ? std::sqrt(smoothing.sigma) : smoothing.sigma;
}

/// Beyond so many scales there is less than 1e-9 of the noise.
inline double pixel_noise_reach(Prior prior) {
  switch (prior) {
    case Prior::gaussian:
      return 6.0;
    case Prior::logistic:
      return 21.0;
    case Prior::uniform:
      return 0.5;
    case Prior::cauchy:
    case Prior::gumbel:
      break;
  }
  throw std::invalid_argument("pixel_noise_reach: tails without end, or a density that is not symmetric");
}

/// Density of the noise plus a uniform position in a pixel, along one axis, at distance `x` from the pixel's
/// centre.
inline double pixel_density(Prior prior, double scale, double pixel, double x) {
  const double from = (x - 0.5 * pixel) / scale, to = (x + 0.5 * pixel) / scale;
  // On the side where the numbers are small, so that nothing cancels.
  return (x > 0.0 ? survival(prior, from) - survival(prior, to) : cdf(prior, to) - cdf(prior, from)) / pixel;
}

/// A triangle's edge, or a part of one, in NDC.
struct Segment {
  Vec2d a, b;
};

/// Height at which two segments cross, if they do.
inline std::optional<double> crossing_height(const Segment& p, const Segment& q) {
  const Vec2d u = p.b - p.a, v = q.b - q.a;
  const double determinant = cross(u, v);
  if (determinant == 0.0) return std::nullopt;
  const double along_p = cross(q.a - p.a, v) / determinant, along_q = cross(q.a - p.a, u) / determinant;
  if (!(along_p > 0.0 && along_p < 1.0 && along_q > 0.0 && along_q < 1.0)) return std::nullopt;
  return p.a.y + along_p * u.y;
}

/// Nodes of Gauss-Legendre on panels between all of `breaks` and at multiples of half a pixel or less from
/// `origin`, so that panels end where pixels do.
inline std::vector<std::pair<double, double>> line_nodes(std::vector<double> breaks, double origin,
                                                         double width) {
  static const GaussLegendre k_rule = gauss_legendre(8);
  std::vector<std::pair<double, double>> nodes;
  if (breaks.empty()) return nodes;
  std::sort(breaks.begin(), breaks.end());
  const double low = breaks.front(), high = breaks.back();
  for (double i = std::ceil((low - origin) / width); origin + i * width < high; i += 1.0)
    breaks.push_back(origin + i * width);
  std::sort(breaks.begin(), breaks.end());
  for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
    const double half = 0.5 * (breaks[i + 1] - breaks[i]), center = 0.5 * (breaks[i + 1] + breaks[i]);
    if (!(half > 1e-13)) continue;
    for (std::size_t k = 0; k < k_rule.node.size(); ++k)
      nodes.emplace_back(center + half * k_rule.node[k], half * k_rule.weight[k]);
  }
  return nodes;
}

/// A scene seen line by line.
class PixelNoiseRenderer {
 public:
  explicit PixelNoiseRenderer(const Scene& scene)
      : scene_(scene),
        prepared_(prepare(rigid(scene))),
        size_{scene.width, scene.height},
        pixel_(2.0 / short_side(size_)),
        scale_(pixel_noise_scale(scene.smoothing)),
        reach_(scale_ * pixel_noise_reach(scene.smoothing.occupancy_prior) + pixel_) {
    for (std::size_t face = 0; face < prepared_.shade.faces.size(); ++face) {
      if (!visible_corners(prepared_, face).empty()) faces_.push_back(face);
    }
  }

  Image render() const {
    Image image = make_image(scene_.width, scene_.height);
    for (std::size_t i = 0; i < image.rgba.size(); ++i)
      image.rgba[i] = i % 4 < 3 ? scene_.background[i % 4] : 0.0;
    const double bottom = pixel_center(0, scene_.height - 1, size_).y, top = pixel_center(0, 0, size_).y;
    for (const auto& [y, weight] :
         line_nodes(heights(bottom - reach_, top + reach_), bottom - 0.5 * pixel_, step())) {
      const std::vector<double> line = render_line(y);
      for (int row = 0; row < scene_.height; ++row) {
        const double share = weight * density(y - pixel_center(0, row, size_).y);
        for (std::size_t i = 0; i < line.size(); ++i)
          image.rgba[static_cast<std::size_t>(row) * line.size() + i] += share * line[i];
      }
    }
    return image;
  }

 private:
  /// No triangle counts where it does not cover.
  static Scene rigid(Scene scene) {
    scene.smoothing.blur_radius = 0.0;
    return scene;
  }

  double density(double x) const {
    return pixel_density(scene_.smoothing.occupancy_prior, scale_, pixel_, x);
  }

  /// Width of panels: half a pixel, less where the noise is narrower.
  double step() const { return 0.5 * pixel_ / std::ceil(std::max(1.0, 0.5 * pixel_ / scale_)); }

  /// The ends of [low, high], clipped to the scene, and between them every corner and every crossing of two
  /// edges.
  std::vector<double> heights(double low, double high) const {
    std::vector<double> corners, result;
    std::vector<Segment> edges;
    for (const std::size_t face : faces_) {
      const std::vector<Vec3d> t = visible_corners(prepared_, face);
      for (std::size_t i = 0; i < t.size(); ++i) {
        corners.push_back(t[i].y);
        edges.push_back({screen(t[i]), screen(t[(i + 1) % t.size()])});
      }
    }
    if (corners.empty()) return result;
    const auto [lowest, highest] = std::minmax_element(corners.begin(), corners.end());
    low = std::max(low, *lowest);
    high = std::min(high, *highest);
    if (!(low < high)) return result;
    for (std::size_t i = 0; i < edges.size(); ++i) {
      for (std::size_t k = 0; k < i; ++k) {
        if (const auto height = crossing_height(edges[i], edges[k])) corners.push_back(*height);
      }
    }
    result = {low, high};
    std::copy_if(corners.begin(), corners.end(), std::back_inserter(result),
                 [&](double y) { return y > low && y < high; });
    return result;
  }

  /// Contribution of the line at height y to the pixels of each column: colour less the background, and
  /// alpha.
  std::vector<double> render_line(double y) const {
    std::vector<double> sums(4 * static_cast<std::size_t>(scene_.width));
    const double left = pixel_center(0, 0, size_).x, right = pixel_center(scene_.width - 1, 0, size_).x;
    std::vector<double> ends;
    std::vector<std::size_t> crossed;
    for (const std::size_t face : faces_) {
      const std::size_t before = ends.size();
      const std::vector<Vec3d> t = visible_corners(prepared_, face);
      for (std::size_t i = 0; i < t.size(); ++i) {
        const Vec2d a = screen(t[i]), b = screen(t[(i + 1) % t.size()]);
        if ((a.y > y) == (b.y > y)) continue;
        ends.push_back(
            std::clamp(a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x), left - reach_, right + reach_));
      }
      if (ends.size() > before) crossed.push_back(face);
    }
    for (const auto& [x, weight] : line_nodes(ends, left - 0.5 * pixel_, step())) {
      const std::vector<double> color = rigid_color({x, y}, crossed);
      for (int column = 0; column < scene_.width; ++column) {
        const double share = weight * density(x - pixel_center(column, 0, size_).x);
        for (std::size_t i = 0; i < 4; ++i)
          sums[4 * static_cast<std::size_t>(column) + i] += share * color[i];
      }
    }
    return sums;
  }

  /// R at a point, less the background; alpha.
  std::vector<double> rigid_color(const Vec2d& point, const std::vector<std::size_t>& faces) const {
    std::vector<FragmentInput> inputs;
    for (const std::size_t face : faces) {
      const auto fragment = face_fragment(prepared_, face, point);
      if (!fragment) continue;
      const Occupancy occupancy =
          opacity_forward({1.0, 0.0}, opacity_of_face(scene_, prepared_, face), fragment->barycentric);
      inputs.push_back({fragment->depth, occupancy.p, occupancy.log_p,
                        shade_forward(prepared_.shade, face, fragment->barycentric,
                                      base_of_face(scene_, prepared_, face))});
    }
    if (inputs.empty()) return {0.0, 0.0, 0.0, 0.0};
    Vec3d color;
    double alpha = 0.0;
    if (scene_.smoothing.gamma > 0.0) {
      const AggregateResult mixed = aggregate_forward(inputs, prepared_.aggregate);
      color = mixed.color;
      alpha = mixed.silhouette;
    } else {
      std::sort(inputs.begin(), inputs.end(), [](const auto& a, const auto& b) { return a.depth < b.depth; });
      for (const FragmentInput& input : inputs) {
        const double share = (1.0 - alpha) * input.occupancy;
        color += share * input.color;
        alpha += share;
      }
      color += (1.0 - alpha) * scene_.background;
    }
    color += -scene_.background;
    return {color.x, color.y, color.z, alpha};
  }

  const Scene& scene_;
  PreparedScene prepared_;
  ImageSize size_;
  double pixel_, scale_, reach_;  ///< NDC
  std::vector<std::size_t> faces_;
};

/// RGBA. The noise is that of the scene's sigma and occupancy prior; gamma 0 stands for rigid depths.
inline Image render_pixel_noise(const Scene& scene) { return PixelNoiseRenderer(scene).render(); }

/// sum grad_image . image, to be differentiated by finite differences.
inline double pixel_noise_objective(const Scene& scene, const Image& grad_image) {
  const Image image = render_pixel_noise(scene);
  double sum = 0.0;
  for (std::size_t i = 0; i < image.rgba.size(); ++i) sum += image.rgba[i] * grad_image.rgba[i];
  return sum;
}

}  // namespace dpr::reference
