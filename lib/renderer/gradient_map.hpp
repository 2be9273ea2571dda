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

/// Sums: channels of pixels; sigma; poses, by view and mesh; what cuts of faces and of contours add to
/// projections and lenses, by view; the eye, by view; lights; the rotations of normals that meshes give, by
/// view and mesh; materials; and the scale of the pixel's noise.
enum class SumOf { pixels, sigma, poses, cuts, contour_cuts, eye, lights, normals, materials, scale };

/// The lists of a backward pass, one after the other in one buffer.
struct GradientSums {
  std::array<SumList, 10> lists;  // by SumOf

  SumList& operator[](SumOf of) { return lists[static_cast<std::size_t>(of)]; }
  const SumList& operator[](SumOf of) const { return lists[static_cast<std::size_t>(of)]; }
  std::size_t count() const {
    std::size_t count = 0;
    for (const SumList& list : lists) count += list.count();
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
