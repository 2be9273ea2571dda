#include "stages/auxiliary.hpp"

namespace dpr {

Auxiliary::Auxiliary(Device::Impl& device)
    : device_(device),
      forward_(device, "auxiliary.cl", "auxiliary_forward"),
      weigh_(device, "auxiliary.cl", "auxiliary_weigh"),
      finish_(device, "auxiliary.cl", "auxiliary_finish") {}

void Auxiliary::forward(const AggregateInputs& in, const Geometry& geometry, const Transform& transform,
                        Aggregate& aggregate) {
  const std::size_t pixels = std::size_t{in.p.views} * in.p.width * in.p.height;
  grad_red_.resize(device_, pixels);
  grad_red_.fill({{1, 0, 0, 0}});
  aggregate.backward(in, glm::vec3(1), grad_red_);  // the colour of the background has no part in its weight

  outputs.resize(device_, DPR_AUXILIARY_CHANNELS * pixels);
  face_id.resize(device_, pixels);
  const Rasterize& r = in.rasterize;
  for (const Range& run : r.pixels(in.p)) {
    forward_(run, in.p, run.last(), r.pixel_starts, r.list, aggregate.grad_color.red, aggregate.channels,
             r.depth, r.bary1, r.bary2, r.fragment_pair, in.bin.pair_face, geometry.face_vertices,
             transform.world, outputs, face_id);
  }
}

void Auxiliary::weigh(const shared::FrameParams& p, const Aggregate& aggregate) {
  const std::size_t pixels = std::size_t{p.views} * p.width * p.height;
  surface.resize(device_, pixels);
  coverage.resize(device_, pixels);
  weigh_(pixels, p, outputs, aggregate.channels, surface, coverage);
}

void Auxiliary::finish(const shared::FrameParams& p, const Raster& raster,
                       const Buffer<cl_float4>& blurred_surface, const Buffer<cl_float4>& blurred_coverage,
                       const CornerTexcoords& texcoords) {
  const std::size_t count = p.views * raster.width * raster.height;
  normals.resize(device_, count);
  places.resize(device_, count);
  uvs.resize(device_, count);
  faces.resize(device_, count);
  const cl_uint4 image{
      {to_uint(raster.width), to_uint(raster.height), to_uint(raster.supersampling), to_uint(raster.margin)}};
  finish_(count, p, image, blurred_surface.size() > 0 ? 1 : 0, texcoords.empty() ? 0 : 1, outputs, face_id,
          blurred_surface, blurred_coverage, texcoords.map.row_of,
          BufferRef<cl_float2>(texcoords.values.cl_buffer()()), normals, places, uvs, faces);
}

}  // namespace dpr
