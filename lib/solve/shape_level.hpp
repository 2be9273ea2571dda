// A level of the shape solver: its views and targets at the level's size.
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "dpr/image_loss.hpp"
#include "dpr/shape.hpp"
#include "solve/shape_state.hpp"

namespace dpr {

/// Pixels of a level, of one of the finest.
double pixel_scale(const ShapeOptions& options, unsigned level);

/// The views of a level in batches, one after the other: batch b has the views b, b + batches, ...
struct ShapeLevel {
  ShapeLevel(const ShapeViews& all, const ShapeOptions& options, unsigned level);

  /// Moves the views; none: they stay.
  void set_cameras(std::span<const ShapeState::MovedCamera> cameras);

  /// Views that an iteration looks at: the first and their number.
  std::pair<std::size_t, std::size_t> batch(unsigned iteration) const;

  int width, height;
  std::vector<std::size_t> order;   // which of all views
  std::vector<std::size_t> starts;  // [batch + 1]
  std::vector<View> views;
};

/// A shape as a level's views show it, without gradients.
Scene scene_of_level(const ShapeViews& all, const ShapeLevel& level, Mesh mesh, const Smoothing& smoothing);

/// Targets of a level's views.
struct ShapeTargets {
  ShapeTargets(const ShapeViews& all, const ShapeOptions& options, const ShapeLevel& level);

  /// Valid as long as this.
  LossOptions loss() const {
    return {.weights = weights, .has_alpha = has_alpha, .masks = masks, .attributes = attributes};
  }

  LossWeights weights;
  std::vector<Image> images, masks, depths, normals;
  std::vector<AttributeTarget> attributes;  // of the last two
  std::vector<unsigned char> has_alpha;
};

}  // namespace dpr
