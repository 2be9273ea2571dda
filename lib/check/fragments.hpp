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
  const std::vector<float> distance = m.rasterize.distance.download(), depth = m.rasterize.depth.download(),
                           red = m.shade.color.red.download(), green = m.shade.color.green.download(),
                           blue = m.shade.color.blue.download(), bary1 = m.rasterize.bary1.download(),
                           bary2 = m.rasterize.bary2.download(), occupancy = m.occupancy.occupancy.download();
  const auto number = [](const std::vector<float>& values, cl_uint k) {
    return k < values.size() ? static_cast<double>(values[k]) : 0.0;
  };
  std::vector<Pixel> pixels(starts.size() - 1);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    for (cl_uint at = starts[i]; at < starts[i + 1]; ++at) {
      const cl_uint k = list.at(at);
      pixels[i].push_back({k,
                           number(distance, k),
                           number(depth, k),
                           {number(red, k), number(green, k), number(blue, k)},
                           {number(bary1, k), number(bary2, k)},
                           number(occupancy, k)});
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
