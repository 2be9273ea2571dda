// Losses of a mesh's shape alone, that keep it smooth while images shape it; evaluated on the device.
#pragma once

#include <cstddef>
#include <memory>

#include "dpr/device.hpp"
#include "dpr/export.h"
#include "dpr/mesh.hpp"

namespace dpr {

class Renderer;

/// Weight of each term. Any soup of triangles will do: a vertex' one-ring is every other vertex of its
/// faces, a hinge every two faces that share an edge, whatever their orientation; where an edge has three
/// faces it has three hinges. Distances are in object space.
struct MeshLossWeights {
  float laplacian = 0;           ///< sum over vertices of |v - mean of its one-ring|^2, eq. (77)
  float edge_length = 0;         ///< mean over edges of (length - edge_target)^2
  float normal_consistency = 0;  ///< mean over hinges of 1 - cos of the angle between the normals
  float flatness = 0;            ///< mean over hinges of (1 - cos)^2, as SoftRas flattens
  float edge_target = 0;         ///< >= 0
};

/// The terms of a MeshLoss, unweighted.
struct MeshLossTerms {
  double laplacian = 0, edge_length = 0, normal_consistency = 0, flatness = 0;
};

/// Weighted sum of the terms for a mesh whose connectivity stays; its gradient joins that of the images in
/// Renderer::backward. Everything is gathered in a fixed order: the same bits from run to run on a device.
/// Faces without area have no normal, and their hinges no loss.
class DPR_API MeshLoss {
 public:
  /// Throws InvalidArgument for a mesh that is not valid and for weights that are negative or not finite; all
  /// may be 0. O(faces log faces).
  MeshLoss(const Device& device, const MeshLossWeights& weights, const Mesh& mesh);
  ~MeshLoss();
  MeshLoss(MeshLoss&&) noexcept;
  MeshLoss& operator=(MeshLoss&&) noexcept;

  /// The loss of a mesh of the renderer's scene, at the positions of its last forward(); for
  /// Renderer::backward(image_loss, mesh_loss). Blocks. Throws InvalidArgument for another Device's renderer,
  /// a mesh that is not there or has other vertices, and where every view has a shape of its own.
  double evaluate(const Renderer& renderer, std::size_t mesh = 0);
  /// The terms of the last evaluate().
  const MeshLossTerms& terms() const;
  struct DPR_LOCAL Impl;

 private:
  friend struct Internals;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dpr
