// Faces cut for the lenses of a batch.
#pragma once

#include <ATen/core/Tensor.h>

#include "torch/batch.hpp"
#include "torch/renderer_pool.hpp"

namespace dpr::torch_op {

/// What subdivide_for_lens() finds for one mesh, as tensors: float32 weights, int64 else.
struct CutFaces {
  at::Tensor faces;           ///< [face, 3] the pieces
  at::Tensor face_of;         ///< [face] the face that each is a piece of
  at::Tensor vertices_of;     ///< [vertex, 3] old vertices that each new one is a combination of
  at::Tensor vertex_weights;  ///< [vertex, 3]
};

/// For checked inputs with one shape for all views.
CutFaces cut_for_lens(const Inputs& in, const Faces& faces, const RenderSettings& settings, double tolerance);

}  // namespace dpr::torch_op
