// From the sums of channels that backward passes leave to the numbers of a gradient: which sums there are,
// and the linear map that the host's way with them amounts to, for the device.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <span>

#include "scene/gradient_table.hpp"
#include "stages/exchange.hpp"

namespace dpr {

/// Sums of one kind in the buffer of all: [channel][segment] from `first` on.
struct SumList {
  std::size_t first = 0, channels = 0, segments = 1;

  std::size_t count() const { return channels * segments; }
};

/// Those of pixels; of sigma; of poses, by view and mesh; of the eye, by view; of lights; of the rotations
/// of normals that meshes give, by view and mesh; of materials; and of the scale of the pixel's noise.
struct GradientSums {
  SumList pixels, sigma, poses, eye, lights, normals, materials, scale;

  std::array<SumList*, 8> all() {
    return {&pixels, &sigma, &poses, &eye, &lights, &normals, &materials, &scale};
  }
  std::array<const SumList*, 8> all() const {
    return {&pixels, &sigma, &poses, &eye, &lights, &normals, &materials, &scale};
  }
  std::size_t count() const {
    std::size_t count = 0;
    for (const SumList* list : all()) count += list->count();
    return count;
  }
};

/// True if an array is made of such sums, and not one of vertices, colours or texels.
inline bool is_summed(const GradientRow& row) {
  return row.of != GradientOf::mesh && row.of != GradientOf::all_views;
}

using GradientMap = SparseMap;

/// The map of all summed arrays, in the order of the table, to single precision.
/// @param finish  what makes a gradient of sums: linear, the same for every mesh of a view in what belongs to
/// the view, and views and meshes have no part in each other's
GradientMap make_map(Device::Impl& device, const GradientSums& sums, std::size_t meshes,
                     const std::function<SceneGradient(std::span<const float>)>& finish);

/// The map from the summed arrays of [pass][view] to those of the views: what is a view's own is added up.
SparseMap make_fold(Device::Impl& device, SceneGradient& of_passes, SceneGradient& of_views);

}  // namespace dpr
