// What a lens does with angles, and its coefficients as lists.
#pragma once

#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "dpr/camera.hpp"

namespace dpr {

bool is_fisheye(const Camera& camera);

/// Factor by which a lens moves a point of that squared tangent from the axis, without p1 and p2 and beyond
/// largest_radius() too; as kernels/lens.h has it.
double radial_factor(const Distortion& lens, double radius2);

/// Where a lens shows what is at these tangents from the axis, x right and y up, as kernels/lens.h has it; what is
/// further from the axis than `largest`, its largest_radius(), is shown there.
glm::dvec2 distorted(glm::dvec2 tangents, const Distortion& lens, double largest);

/// The tangents at which a lens sees what is seen at these without it, roughly: of Brown's model by a few fixed-point
/// steps on the radial part, of a fisheye up to 79 degrees from the axis.
glm::dvec2 undistorted(const glm::dvec2& seen, const std::optional<Distortion>& lens);

/// Coefficients in the lens' order: k1, k2, p1, p2, k3, or k1, k2, k3, k4 of a fisheye.
std::vector<float> coefficients(const Distortion& lens);

}  // namespace dpr
