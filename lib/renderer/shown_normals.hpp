// Normals that frames show beside colours, by the same triangles.
#pragma once

#include "dpr/scene.hpp"
#include "stages/antialias.hpp"
#include "stages/shade.hpp"
#include "stages/tangents.hpp"

namespace dpr {

struct ShownNormals {
  /// Those that the scene's meshes give, 0 of meshes without.
  ShownNormals(Device::Impl& device, const Scene& scene);

  CornerVectors at_corners() const { return {faces, values}; }
  std::size_t bytes() const;

  Buffer<cl_uint4> faces;    ///< [face] normals of the corners
  Buffer<cl_float4> values;  ///< [normal] object space
  Buffer<cl_float4> raster;  ///< [pixels_of(p)] normals, alpha
  ImageTangents tangents;

  // Of noise on the pixel, whose contours are those of colours too.
  Antialias antialias;
  KeptSamples kept;
  Buffer<cl_float4> smoothed;  ///< [view][height][width]
};

}  // namespace dpr
