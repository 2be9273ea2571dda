// Directions of forward mode on the device, and the tangents that each stage leaves for the next.
#pragma once

#include "device/buffer.hpp"
#include "shared_types.h"

namespace dpr {

/// Tangents of the images that show something.
struct ImageTangents {
  Buffer<cl_float4>
      rasters;  ///< [direction][view][sample] of noise on the pixel, before contours are blended
  Buffer<cl_float4> of_group;  ///< as `images`, along the group's directions, where there are several groups
  Buffer<cl_float4> images;    ///< [direction][view][height][width] RGBA, of all directions

  std::size_t bytes() const {
    return rasters.capacity_bytes() + of_group.capacity_bytes() + images.capacity_bytes();
  }
};

/// As many directions at a time as there is memory for, from `first` on.
struct Tangents {
  shared::TangentParams params{};
  cl_uint first = 0;
  Buffer<shared::ViewTangent> views;    ///< [direction][view]
  Buffer<shared::ModelTangent> models;  ///< [direction][view][mesh]
  Buffer<shared::FrameTangent> frames;  ///< [direction]
  Buffer<cl_float4> positions, colors;  ///< [direction][position], [color]; of views' own by view
  Buffer<cl_float4> opacities;          ///< [direction][opacity]; empty: none changes

  Buffer<cl_float4> ndc;       ///< [direction][view][vertex] x, y, view depth
  Buffer<cl_float4> world;     ///< [direction][as Transform::world, then eyes], of lit scenes
  Buffer<cl_float4> clip;      ///< [direction][view][vertex] homogeneous, where p.clips is set
  Buffer<cl_float4> outlines;  ///< [direction][view][face][4] of clipped faces (kernels/clip_tangent.cl)
  Buffer<float> fragments;     ///< [direction][planes][p.grad_fragments], and what is the same for all
  Buffer<cl_float4> shares;    ///< [p.grad_fragments][direction] RGBA of their pixels
  ImageTangents shown;         ///< of colours

  std::size_t bytes() const {
    return views.capacity_bytes() + models.capacity_bytes() + frames.capacity_bytes() +
           positions.capacity_bytes() + colors.capacity_bytes() + opacities.capacity_bytes() +
           ndc.capacity_bytes() + world.capacity_bytes() + clip.capacity_bytes() + outlines.capacity_bytes() +
           fragments.capacity_bytes() + shares.capacity_bytes() + shown.bytes();
  }
};

}  // namespace dpr
