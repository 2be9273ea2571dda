#include "solve/visual_hull.hpp"

#include <algorithm>
#include <cmath>

#include "mesh/isosurface.hpp"
#include "mesh/remesh.hpp"
#include "scene/lens.hpp"
#include "solve/resample.hpp"
#include "solve/shape_space.hpp"

namespace dpr {
namespace {

constexpr float k_inside = 0.5F;  // alpha of an object's edge, and the largest margin

/// A view's silhouette, as a room for the object.
class Silhouette {
 public:
  Silhouette(const ShapeView& view, int width, int height, double cell)
      : view_(view),
        to_camera_(view.camera.view),
        projection_(projection(view.camera, width, height)),
        size_(width, height),
        cell_(cell) {
    if (view.camera.distortion) largest_radius_ = largest_radius(*view.camera.distortion);
  }

  /// From 0.5, inside the silhouette or where the view says nothing, to -0.5, outside of it or before the depth.
  float margin(const glm::dvec3& point) const {
    const glm::dvec3 p(to_camera_ * glm::dvec4(point, 1.0));
    const double depth = -p.z;
    if (!(depth > view_.camera.znear)) return k_inside;
    glm::dvec2 seen = glm::dvec2(p) / (view_.camera.orthographic_height ? 1.0 : depth);
    if (view_.camera.distortion) seen = distorted(seen, *view_.camera.distortion, largest_radius_);
    const glm::dvec2 ndc = glm::dvec2(projection_.scale) * seen + glm::dvec2(projection_.offset);
    const double pixels_per_ndc = 0.5 * std::min(size_.x, size_.y);
    const glm::dvec2 pixel = 0.5 * glm::dvec2(size_) + pixels_per_ndc * glm::dvec2(ndc.x, -ndc.y);
    return std::min(in_image(pixel - 0.5), behind_surface(pixel, depth));
  }

 private:
  /// Beyond the image's border as at it: there the object may go on.
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(std::clamp(y, 0, size_.y - 1)) * static_cast<std::size_t>(size_.x) +
           static_cast<std::size_t>(std::clamp(x, 0, size_.x - 1));
  }
  float alpha(int x, int y) const {
    const std::size_t i = index(x, y);
    return is_masked(i) ? 1.0F : view_.image.pixels[i].a;
  }
  bool is_masked(std::size_t i) const { return !view_.mask.pixels.empty() && !(view_.mask.pixels[i].x > 0); }

  /// At a place from the middle of the first pixel.
  float in_image(const glm::dvec2& place) const {
    const glm::dvec2 inside = glm::clamp(place, glm::dvec2(-1), glm::dvec2(size_));
    const glm::ivec2 low(glm::floor(inside));
    const glm::vec2 part(inside - glm::dvec2(low));
    const float upper = glm::mix(alpha(low.x, low.y), alpha(low.x + 1, low.y), part.x);
    const float lower = glm::mix(alpha(low.x, low.y + 1), alpha(low.x + 1, low.y + 1), part.x);
    return glm::mix(upper, lower, part.y) - k_inside;
  }

  float behind_surface(const glm::dvec2& pixel, double depth) const {
    if (view_.depth.pixels.empty()) return k_inside;
    const glm::dvec2 inside = glm::clamp(pixel, glm::dvec2(0), glm::dvec2(size_));
    const std::size_t i = index(static_cast<int>(inside.x), static_cast<int>(inside.y));
    if (is_masked(i) || !has_depth(view_.depth.pixels[i])) return k_inside;
    const double cells = (depth - double{view_.depth.pixels[i].x}) / cell_;
    return static_cast<float>(std::clamp(cells, -double{k_inside}, double{k_inside}));
  }

  const ShapeView& view_;
  glm::dmat4 to_camera_;
  Projection projection_;
  glm::ivec2 size_;
  double cell_;
  double largest_radius_ = 0;  // of the lens
};

bool touches_border(const ScalarGrid& grid) {
  const glm::ivec3 last = grid.size - 1;
  for (int z = 0; z <= last.z; ++z) {
    for (int y = 0; y <= last.y; ++y) {
      for (int x = 0; x <= last.x; ++x) {
        const bool at_border = x == 0 || y == 0 || z == 0 || x == last.x || y == last.y || z == last.z;
        if (at_border && grid.values[grid.index({x, y, z})] > 0) return true;
      }
    }
  }
  return false;
}

/// Over the cube around the common view, which holds what the narrowest image shows.
ScalarGrid margins(const ShapeViews& views) {
  constexpr int k_most_cells = 160;
  constexpr double k_half_side = 2;  // of the common view's radius
  const CommonView common = common_view(views);
  const double side = 2 * k_half_side * common.radius;
  const int cells = std::clamp(static_cast<int>(std::ceil(side / common.pixel)), 2, k_most_cells);
  ScalarGrid grid{glm::ivec3(cells + 1), common.centre - 0.5 * side, side / cells, {}};
  std::vector<Silhouette> silhouettes;
  for (const ShapeView& view : views.views) {
    if (view.has_alpha) silhouettes.emplace_back(view, views.width, views.height, grid.cell);
  }
  for (int z = 0; z < grid.size.z; ++z) {
    for (int y = 0; y < grid.size.y; ++y) {
      for (int x = 0; x < grid.size.x; ++x) {
        float least = k_inside;
        for (auto s = silhouettes.begin(); s != silhouettes.end() && least > -k_inside; ++s)
          least = std::min(least, s->margin(grid.position({x, y, z})));
        grid.values.push_back(least);
      }
    }
  }
  return grid;
}

}  // namespace

std::optional<Mesh> visual_hull(const ShapeViews& views) {
  constexpr float k_edge_cells = 2;
  constexpr int k_least_points = 64;  // inside: edges are too long for less
  const ScalarGrid grid = margins(views);
  const auto inside = std::ranges::count_if(grid.values, [](float value) { return value > 0; });
  if (inside < k_least_points || touches_border(grid)) return {};
  const Mesh surface = isosurface(grid);
  return remesh(surface, k_edge_cells * static_cast<float>(grid.cell));
}

}  // namespace dpr
