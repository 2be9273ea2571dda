#include "stages/setup.hpp"

namespace dpr {

void Setup::forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
                    const Buffer<cl_float4>& ndc, const Buffer<float>& hidden, Buffer<cl_uint>& counts) {
  const std::size_t count = std::size_t{p.views} * p.faces;
  facing.resize(device_, count);
  kept.resize(device_, count);
  counts.resize(device_, count + 1);
  triangles.resize(device_, count);
  const std::size_t faces_of_item = device_.info.lanes == 1 ? 1 : DPR_FACE_GROUP;
  launch_((count + faces_of_item - 1) / faces_of_item, kernel::setup_forward{.p = p,
                                                                             .views = views.cameras,
                                                                             .faces = geometry.face_vertices,
                                                                             .ndc = ndc,
                                                                             .hidden = hidden,
                                                                             .facing = facing,
                                                                             .kept = kept,
                                                                             .counts = counts,
                                                                             .triangles = triangles});
}

}  // namespace dpr
