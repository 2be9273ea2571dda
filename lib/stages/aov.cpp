#include "stages/aov.hpp"

namespace dpr {

AovStage::AovStage(Device::Impl& device) : device_(device), forward_(device, "aov.cl", "aov_forward") {}

void AovStage::forward(const AggregateInputs& in, const Geometry& geometry, const Transform& transform,
                       Aggregate& aggregate) {
  const std::size_t pixels = std::size_t{in.p.views} * in.p.width * in.p.height;
  const std::vector<cl_float4> red(pixels, cl_float4{{1, 0, 0, 0}});
  unit_gradient_.upload(device_, red);
  aggregate.backward(in, glm::vec3(1),
                     unit_gradient_);  // the colour of the background has no part in its weight
  std::vector<float> background(pixels);
  aggregate.channels.download(background, DPR_CHANNEL_BACKGROUND * pixels);
  background_weight_.upload(device_, background);

  outputs.resize(device_, DPR_AOV_CHANNELS * pixels);
  face_id.resize(device_, pixels);
  const Rasterize& r = in.rasterize;
  forward_(r.pixels(in.p), in.p, r.pixel_starts, r.list, aggregate.grad_color.red, background_weight_,
           r.depth, r.bary1, r.bary2, r.fragment_pair, in.bin.pair_face, geometry.face_vertices,
           transform.world, outputs, face_id);
}

}  // namespace dpr
