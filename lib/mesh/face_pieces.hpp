// Faces cut at the middles of their edges.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace dpr {

/// A part of a face.
struct FacePiece {
  std::uint32_t face;
  std::array<glm::vec3, 3> barycentrics;  ///< [corner] in the face: multiples of 2^-24
};

/// Sets those sides of a triangle that are to be halved; side k is from corner k to the next.
using SideTest =
    std::function<void(const std::array<glm::dvec3, 3>& corners, std::array<bool, 3>& is_too_long)>;

/// Halves sides until the test wants none, each at most 24 times. A side is halved for every face whose
/// corners are at its ends, whatever their indices. Pieces are in the order of the faces, and wind as they
/// do. Throws InvalidArgument for more than `most_new` pieces beyond the number of faces.
std::vector<FacePiece> cut_faces(std::span<const glm::vec3> positions, std::span<const glm::uvec3> faces,
                                 const SideTest& find_long_sides, std::size_t most_new);

}  // namespace dpr
