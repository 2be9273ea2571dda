// Check of the meshes that stand in a second place.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "dpr/scene.hpp"

namespace dpr {

/// Throws InvalidArgument unless entry `i` of the meshes, which may be the next to come, can be an instance of
/// `source`; says what is wrong with it.
void require_source(std::span<const Instance> meshes, std::size_t i, std::size_t source,
                    const std::string& argument);

}  // namespace dpr
