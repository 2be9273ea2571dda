#include "solve/shape_explained.hpp"

#include <algorithm>
#include <utility>

#include "solve/median.hpp"
#include "solve/pose_beam.hpp"
#include "solve/shape_checks.hpp"

namespace dpr {
namespace {

// Of colours: right shapes leave up to 5 times what the median view does, a camera that is 5 degrees off 16 times, the
// hollow of a mug that is not found 19 times (bench/experiments/foreign_shapes.py).
constexpr double k_outlier = 8, k_least_outlier = 0.2;
constexpr float k_half_covered = 0.5F;
constexpr double k_dark = 1.0 / 255;  // colour differences of a picture that shows next to nothing

/// Loss of a pixel's colour difference; scale > 0: robust.
double color_loss(const glm::vec4& a, const glm::vec4& b, double scale) {
  const glm::dvec3 difference(a - b);
  const double squared = glm::dot(difference, difference);
  return scale > 0 ? squared / (1 + squared / (scale * scale)) : squared;
}

ViewExplanation explain(const ShapeView& view, const glm::vec4& background, const Image& shown,
                        double robust_scale) {
  double shared = 0, united = 0, left = 0, blank = 0;
  for (std::size_t i = 0; i < shown.pixels.size(); ++i) {
    const glm::vec4 &target = view.image.pixels[i], &found = shown.pixels[i];
    const double counts = view.mask.pixels.empty() ? 1 : static_cast<double>(view.mask.pixels[i].x);
    shared += std::min(target.a, found.a) < k_half_covered ? 0 : counts;  // outlines are blurred, or not
    united += std::max(target.a, found.a) < k_half_covered ? 0 : counts;
    left += counts * color_loss(found, target, robust_scale);
    blank += counts * std::max(color_loss(background, target, robust_scale), k_dark * k_dark);
  }
  ViewExplanation result;
  if (view.has_alpha) result.iou = united > 0 ? shared / united : 1;
  result.unexplained_part = left / blank;
  return result;
}

/// Part of the colours from which on they are unexplained.
double color_bound(std::span<const ViewExplanation> views, double most) {
  std::vector<double> parts;
  for (const ViewExplanation& view : views) parts.push_back(view.unexplained_part);
  return std::clamp(k_outlier * median(std::move(parts)), k_least_outlier * most, most);
}

}  // namespace

std::vector<ViewExplanation> explain_views(const ShapeViews& views, const ShapeOptions& options,
                                           std::span<const Image> shown) {
  const bool is_robust = options.loss.robust > 0;
  const double scale = is_robust ? static_cast<double>(options.loss.robust_scale) : 0;
  std::vector<ViewExplanation> list;
  for (std::size_t i = 0; i < shown.size(); ++i)
    list.push_back(explain(views.views[i], glm::vec4(views.background, 0), shown[i], scale));
  const double bound = color_bound(list, explained_part(options.explained, is_robust));
  const bool finds_colors = compares_colors(options.loss) && options.color_learning_rate > 0;
  for (ViewExplanation& view : list) {
    view.explained = 1 - view.iou.value_or(1) < static_cast<double>(options.explained) &&
                     ((view.iou && !finds_colors) || view.unexplained_part < bound);
  }
  return list;
}

}  // namespace dpr
