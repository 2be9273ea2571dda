#include "stages/auxiliary.hpp"

namespace dpr {

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
    launch_(run, kernel::auxiliary_forward{.p = in.p,
                                           .last_pixel = run.last(),
                                           .starts = r.pixel_starts,
                                           .list = r.list,
                                           .grads = r.grads,
                                           .channels = aggregate.channels,
                                           .fragments = r.values,
                                           .fragment_pair = r.fragment_pair,
                                           .pair_face = in.bin.pair_face,
                                           .faces = geometry.face_vertices,
                                           .world = transform.world,
                                           .outputs = outputs,
                                           .face_id = face_id});
  }
}

void Auxiliary::weigh(const shared::FrameParams& p, const Aggregate& aggregate) {
  const std::size_t pixels = std::size_t{p.views} * p.width * p.height;
  surface.resize(device_, pixels);
  coverage.resize(device_, pixels);
  launch_(pixels, kernel::auxiliary_weigh{.p = p,
                                          .outputs = outputs,
                                          .channels = aggregate.channels,
                                          .surface = surface,
                                          .coverage = coverage});
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
  launch_(count, kernel::auxiliary_finish{.p = p,
                                          .image = image,
                                          .blurred = cl_uint{blurred_surface.size() > 0},
                                          .has_uv = cl_uint{!texcoords.empty()},
                                          .outputs = outputs,
                                          .face_id = face_id,
                                          .surface = blurred_surface,
                                          .coverage = blurred_coverage,
                                          .texcoord_of = texcoords.map.row_of,
                                          .texcoords = BufferRef<cl_float2>(texcoords.values.cl_buffer()()),
                                          .normals = normals,
                                          .places = places,
                                          .uvs = uvs,
                                          .faces = faces});
}

}  // namespace dpr
