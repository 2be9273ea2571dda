// The edges of the scene's meshes on the device, with the faces that meet there.
#pragma once

#include <vector>

#include "kernels/edges.hpp"
#include "mesh/solid.hpp"
#include "stages/geometry.hpp"

namespace dpr {

class Edges {
 public:
  /// By the vertices that faces share. Throws InvalidArgument for more faces than can be numbered.
  /// `views_of_faces`: see Geometry. `is_see_through`: edges between faces with opacities are those of a seam.
  Edges(Device::Impl& device, const Scene& scene, std::size_t views_of_faces = 1,
        bool is_see_through = false);

  /// Joins those that coincide where vertices lie now. To be called before edges are read, after positions
  /// have changed, or p.position_stride or, where that is set, p.views. Does not wait for the device.
  void join(const shared::FrameParams& p, const Geometry& geometry);

  bool sees_through;
  std::size_t count = 0;       ///< of a view
  std::vector<Solid> solids;   ///< [mesh] of each view of faces, for the first who wants them
  Buffer<cl_uint2> edges;      ///< [edge] see DPR_EDGE_FLAG; [view][edge] where p.position_stride is set
  Buffer<cl_uint> face_edges;  ///< [face] see DPR_FACE_SIDES

  std::size_t bytes() const;

 private:
  Device::Impl& device_;
  Launcher<kernel::edges_list, kernel::edges_join> launch_;
  Buffer<shared::OpenEdge> open_;  // [open edge], of each view of faces
  std::size_t open_count_ = 0;     // of a view
  Buffer<cl_uint> heads_, next_;
};

}  // namespace dpr
