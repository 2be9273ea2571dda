// Rows of the gradient table along which forward mode has tangents.
#pragma once

#include "scene/gradient_table.hpp"

namespace dpr {

/// True if the images have tangents along the numbers of a row.
bool has_tangent(const GradientRow& row);

}  // namespace dpr
