// Numbers of vertices at the samples of an image, for shading of the caller's own.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "dpr/export.h"
#include "dpr/renderer.hpp"

namespace dpr {

/// Any number of channels for the corners of the scene's faces.
struct Attributes {
  std::span<const uvec3> faces;   ///< of the scene, the meshes' one after the other: indices of rows
  std::span<const float> values;  ///< [row][channel]
  std::size_t channels = 3;
  bool are_of_views = false;        ///< values [view][row][channel]
  bool faces_are_of_views = false;  ///< faces [view][face]
};

/// [layer][view][height][width][channel] at the samples, with perspective; 0 where no face is. Works on the host;
/// O(samples channels). Throws InvalidArgument for indices beyond the rows, and faces that are not the samples'.
DPR_API std::vector<float> interpolate(const Samples& samples, const Attributes& attributes);
/// [layer][view][height][width][channel][2]: how fast they change from sample to sample to the right and down. Of
/// samples that have steps.
DPR_API std::vector<float> interpolate_steps(const Samples& samples, const Attributes& attributes);

/// Gradients of <grad, interpolate()>.
struct InterpolateGradient {
  std::vector<float> values;       ///< as Attributes::values
  std::vector<vec2> barycentrics;  ///< for Renderer::samples_backward()
  std::vector<vec4> steps;         ///< as Samples::steps, where there are grad_steps
};
/// grad_steps: [...][channel][2], of interpolate_steps(), or none. Gradients at samples without a face have no part.
DPR_API InterpolateGradient interpolate_backward(const Samples& samples, const Attributes& attributes,
                                                 std::span<const float> grad_values,
                                                 std::span<const float> grad_steps = {});
/// Forward mode: derivatives of interpolate() along a direction in which the attributes change by `value_tangents`, as
/// Attributes::values, and barycentrics by `barycentric_tangents`, as a direction of SamplesTangent has them. Either
/// may be left out. The transpose of interpolate_backward().
DPR_API std::vector<float> interpolate_tangent(const Samples& samples, const Attributes& attributes,
                                               std::span<const float> value_tangents,
                                               std::span<const vec2> barycentric_tangents);

}  // namespace dpr
