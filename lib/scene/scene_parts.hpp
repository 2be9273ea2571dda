// Parts of a scene that files, commands and the C interface read alike.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "dpr/renderer.hpp"

namespace dpr {

/// Throws InvalidArgument unless entry `i` of the meshes, which may be the next to come, can be an instance of
/// `source`; says what is wrong with it.
void require_source(std::span<const Instance> meshes, std::size_t i, std::size_t source,
                    const std::string& argument);

/// The view of a scene's own camera and transforms.
View own_view(const Scene& scene);

/// Names in files, in the order of Cull.
inline constexpr std::array<std::string_view, 3> k_culls{"none", "back", "front"};

/// Throws InvalidArgument that says `where` for another word than none, back or front.
Cull parse_cull(std::string_view word, std::string_view where);

}  // namespace dpr
