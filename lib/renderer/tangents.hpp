// What forward mode knows of.
#pragma once

#include "scene/gradient_table.hpp"

namespace dpr {

/// True if the images have tangents along the numbers of a row.
bool has_tangent(const GradientRow& row);

}  // namespace dpr
