#include "stages/setup.hpp"

namespace dpr {

Setup::Setup(Device::Impl& device) : device_(device), forward_(device, "setup.cl", "setup_forward") {}

void Setup::forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
                    const Buffer<cl_float4>& ndc, const Buffer<float>& hidden, Buffer<cl_uint>& counts) {
  const std::size_t count = std::size_t{p.views} * p.faces;
  facing.resize(device_, count);
  kept.resize(device_, count);
  counts.resize(device_, count + 1);
  triangles.resize(device_, count);
  forward_(count, p, views.cameras, geometry.face_vertices, ndc, hidden, facing, kept, counts, triangles);
}

}  // namespace dpr
