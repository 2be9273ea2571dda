// State of a MeshLoss on its device.
#pragma once

#include <cstdint>

#include "dpr/mesh_loss.hpp"
#include "kernels/mesh_loss.hpp"
#include "stages/reduce.hpp"

namespace dpr {

/// Throws InvalidArgument for what a MeshLoss refuses.
void check_mesh_loss(const MeshLossWeights& weights, const Mesh& mesh);

struct MeshLoss::Impl {
  Impl(const Device& device, const MeshLossWeights& weights, const Mesh& mesh);

  /// Fills in the terms and what the gradient needs; the mesh's positions begin at `first_vertex`. Returns
  /// the weighted sum.
  double evaluate(const Buffer<cl_float4>& positions, std::size_t first_vertex);
  /// Adds the gradient of the last evaluate(), of the same positions, at the same place.
  void add_gradient(const Buffer<cl_float4>& positions, Buffer<cl_float4>& grad);

  Device device;
  MeshLossWeights weights;
  MeshLossTerms terms;
  std::size_t edges = 0;
  shared::MeshLossParams params{};
  std::uint64_t frame_number = 0;  // of the render that the last evaluate() belongs to; 0: none

  Launcher<kernel::mesh_loss_vertices, kernel::mesh_loss_hinges, kernel::mesh_loss_gather> launch;
  Reduce reduce;
  Buffer<cl_uint> ring_starts, ring;           // [vertex + 1], [...]
  Buffer<cl_uint4> hinges;                     // [hinge] across, across, ends of the edge
  Buffer<cl_uint> hinge_starts, hinge_places;  // [vertex + 1], [hinge * 4]
  Buffer<cl_uint> all_vertices, all_hinges;    // [2]: one segment each
  Buffer<cl_float4> laplacians, partial;       // [vertex], [hinge][4]
  Buffer<float> vertex_channels, hinge_channels;
};

}  // namespace dpr
