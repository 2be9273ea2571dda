// Shape of the space that silhouettes leave to an object.
#pragma once

#include <optional>

#include "dpr/shape.hpp"

namespace dpr {

/// The surface of all points that no view shows beside the object (the visual hull, Laurentini 1994), nor, where views
/// have depths, before what these show. Holes that a view looks through are open. Cells of the grid on which it is
/// found are a pixel wide, or larger where 160 would not span the common view. Nothing where the views leave it open on
/// a side, or leave fewer than 64 cells. O(cells * views), on the host.
std::optional<Mesh> visual_hull(const ShapeViews& views);

}  // namespace dpr
