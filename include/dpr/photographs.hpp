// Photographs of what there is a template of: where they were taken from, and in what light. With what was
// found the shape solver bends the template (ShapeOptions::rigidity).
#pragma once

#include <cstddef>

#include "dpr/device.hpp"
#include "dpr/export.h"
#include "dpr/light.hpp"
#include "dpr/pose.hpp"
#include "dpr/shape.hpp"

namespace dpr {

/// Finds the camera of a view by the initial mesh, which stands still, and writes it into the view: where it
/// stands and, if asked for, its focal length and lens. A camera that is near the right one is where it
/// begins, and of rotations that explain the image as well the nearest is taken. An unknown one begins in
/// front of the mesh, on its +z side with +y up, and LeastSquares::rotations are tried. The view's mask is
/// used for LeastSquares::mask, and the translation is always looked for. Throws InvalidArgument without an
/// initial mesh, for a view that is not there, for a descent, and as PoseSolver does.
DPR_API PoseResult find_camera(const Device& device, ShapeViews& views, std::size_t view,
                               PoseOptions options = {}, const PoseSolver::Callback& callback = {});

/// Options of a shape solver that bends a template to photographs: its faces stay, it is rather rigid, and
/// its colours are left to the light.
DPR_API ShapeOptions template_shape_options();

/// The distant light, one for all views, in which the initial mesh explains them best: spherical harmonics to
/// the second order, by least squares at the pixels that show it. They hold its one colour too: where the
/// mesh has colours, what these are to be multiplied by. `robust_scale` > 0: pixels that differ by more than
/// this colour difference hardly count (Geman & McClure 1985). A prior holds what no pixel tells near 0.
/// Throws InvalidArgument without an initial mesh, where a camera is not known, and where no view shows the
/// mesh. Renders every view nine times.
DPR_API Lights find_light(const Device& device, const ShapeViews& views, float robust_scale = 0);

}  // namespace dpr
