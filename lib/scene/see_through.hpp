// Scenes with surfaces that are seen through, and the smoothings that show them.
#pragma once

#include "dpr/scene.hpp"
#include "mesh/opacity.hpp"

namespace dpr {

/// True if a mesh has some opacity below 1.
bool is_see_through(const Scene& scene);

/// Throws InvalidArgument for such a scene; `where` says what needs an opaque one.
void require_opaque(const Scene& scene, const std::string& where);

/// Throws InvalidArgument for the sampled joint composition.
void require_sees_through(const Smoothing& smoothing);

}  // namespace dpr
