#include "stages/auxiliary.hpp"

namespace dpr {

Auxiliary::Auxiliary(Device::Impl& device)
    : device_(device),
      forward_(device, "auxiliary.cl", "auxiliary_forward"),
      weigh_(device, "auxiliary.cl", "auxiliary_weigh") {}

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

void Auxiliary::weigh(const shared::FrameParams& p, const Aggregate& aggregate, Buffer<cl_float4>& surface,
                      Buffer<cl_float4>& coverage) {
  const std::size_t pixels = std::size_t{p.views} * p.width * p.height;
  surface.resize(device_, pixels);
  coverage.resize(device_, pixels);
  weigh_(pixels, p, outputs, aggregate.image, surface, coverage);
}

}  // namespace dpr
