// The light in which a scene's mesh explains images of it.
#pragma once

#include <optional>
#include <span>

#include "dpr/device.hpp"
#include "dpr/light.hpp"
#include "dpr/scene.hpp"
#include "dpr/shape.hpp"

namespace dpr {

/// find_light() for the meshes of a scene, where they stand and with the colours and textures that they have,
/// over the scene's background, in views of which the cameras are known. None where no image shows them.
std::optional<Lights> find_light(const Device& device, const Scene& scene, std::span<const ShapeView> views,
                                 float robust_scale);

/// By channel: an image shows colours times `gain`, plus `offset`.
struct ColorGain {
  dvec3 gain{1.0}, offset{0.0};
};

/// The gain in which the same meshes explain one image, without the scene's lights. None where they are not seen.
std::optional<ColorGain> find_gain(const Device& device, Scene scene, const ShapeView& view,
                                   float robust_scale);

}  // namespace dpr
