// Noise of a photograph, known from the pixels that show the background.
#pragma once

#include <cstddef>
#include <glm/glm.hpp>
#include <span>

#include "device/opencl_bindings.hpp"

namespace dpr {

/// What noise leaves of a pixel's colour: its square, summed over the channels.
struct TargetNoise {
  double uncovered = 0;  ///< where a picture shows the background
  double covered = 0;    ///< elsewhere; more, as black and white backgrounds cut half of the noise off
};

/// That of a target beside a picture, [y][x], whose alpha is 0 where it shows the background: as much as differences of
/// neighbours account for. 0 of targets without noise, and where little shows the background.
TargetNoise noise_of(std::span<const cl_float4> target, std::span<const cl_float4> picture, std::size_t width,
                     const glm::vec3& background);

}  // namespace dpr
