// Cameras that move along with a shape.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "dpr/renderer.hpp"
#include "dpr/shape.hpp"
#include "solve/shape_space.hpp"
#include "solve/shape_state.hpp"

namespace dpr {

/// The views' own cameras, which have not moved yet.
std::vector<ShapeState::MovedCamera> unmoved_cameras(const ShapeViews& views);

/// The views' cameras where they are now; none have moved: as given.
std::vector<Camera> moved_cameras(const ShapeViews& views, std::span<const ShapeState::MovedCamera> cameras);

/// One step of Adam for each of the views `which`, in the order of their gradients: a rotation about the common
/// centre, in radians, and a translation, in radii. The learning rate is the size of either.
void move_cameras(std::span<const ViewGradient> gradients, std::span<const std::size_t> which,
                  const CommonView& common, double learning_rate,
                  std::vector<ShapeState::MovedCamera>& cameras);

/// Images leave open where cameras and shape stand together: moves all of them so that the cameras are, on average, where
/// the views have them. `positions`: [vertex][3].
void anchor(const ShapeViews& views, const CommonView& common, std::vector<ShapeState::MovedCamera>& cameras,
            std::span<double> positions);

}  // namespace dpr
