// A frame's fragments after rasterization and shading, pixel by pixel, in double precision. Independent
// evaluations of the renderer's members start from them.
#pragma once

#include <array>
#include <cstddef>
#include <glm/glm.hpp>
#include <vector>

#include "dpr/renderer.hpp"
#include "renderer/renderer_impl.hpp"

namespace dpr::check {

struct Fragment {
  std::size_t index = 0;           ///< in the stages' buffers
  double distance = 0, depth = 0;  ///< signed, in the unit of sigma; view space
  glm::dvec3 color{0.0};
  std::array<double, 2> barycentric{};  ///< of the corners 1 and 2
  double occupancy = 0;                 ///< 0 where no stage of its own computes it
};

using Pixel = std::vector<Fragment>;

/// The fragments of every pixel of the last frame, which is one band.
inline std::vector<Pixel> pixels_of(const Renderer& renderer) {
  const Renderer::Impl& m = impl_of(renderer);
  const std::vector<cl_uint> starts = m.rasterize.pixel_starts.download(), list = m.rasterize.list.download();
  const std::vector<float> values = m.rasterize.values.download();
  const bool has_occupancies = !m.aggregate.perturbs_distances();
  const auto number = [&](std::size_t plane, cl_uint k) {
    return static_cast<double>(values[plane * m.frame.fragments + k]);
  };
  std::vector<Pixel> pixels(starts.size() - 1);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    for (cl_uint at = starts[i]; at < starts[i + 1]; ++at) {
      const cl_uint k = list.at(at);
      pixels[i].push_back(
          {k,
           number(DPR_PLANE_DISTANCE, k),
           number(DPR_PLANE_DEPTH, k),
           {number(DPR_PLANE_COLOR, k), number(DPR_PLANE_COLOR + 1, k), number(DPR_PLANE_COLOR + 2, k)},
           {number(DPR_PLANE_BARY, k), number(DPR_PLANE_BARY + 1, k)},
           has_occupancies ? number(DPR_PLANE_OCCUPANCY, k) : 0.0});
    }
  }
  return pixels;
}

/// Normalised depth: 1 at znear, 0 at zfar.
inline double zeta(const Scene& scene, double depth) {
  const double znear = static_cast<double>(scene.camera.znear), zfar = static_cast<double>(scene.camera.zfar);
  return (zfar - depth) / (zfar - znear);
}

}  // namespace dpr::check
