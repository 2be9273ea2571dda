#include "stages/samples.hpp"

namespace dpr {

void SampledSurface::forward(const shared::FrameParams& p, const Bin& bin, const Rasterize& rasterize,
                             cl_uint layers) {
  const std::size_t samples = std::size_t{layers} * p.views * p.width * p.height;
  places.resize(device_, samples);
  faces.resize(device_, samples);
  for (const Range& pixels : rasterize.pixels(p)) {
    launch_(pixels, kernel::samples_forward{.p = p,
                                            .last_pixel = pixels.last(),
                                            .layers = layers,
                                            .starts = rasterize.pixel_starts,
                                            .list = rasterize.list,
                                            .fragments = rasterize.values,
                                            .fragment_pair = rasterize.fragment_pair,
                                            .pair_face = bin.pair_face,
                                            .places = places,
                                            .face = faces});
  }
}

void SampledSurface::find_steps(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
                                const Buffer<shared::ClippedFace>& clipped) {
  steps.resize(device_, places.size());
  launch_(places.size(), kernel::samples_steps{.p = p,
                                               .count = static_cast<cl_uint>(places.size()),
                                               .places = places,
                                               .face = faces,
                                               .triangles = triangles,
                                               .clipped = clipped,
                                               .steps = steps});
}

void SampledSurface::backward(const shared::FrameParams& p, const Buffer<cl_float4>& grad_places,
                              cl_uint layers, Rasterize& rasterize) {
  rasterize.start_gradients(p);
  for (const Range& pixels : rasterize.pixels(p)) {
    launch_(pixels, kernel::samples_backward{.p = p,
                                             .last_pixel = pixels.last(),
                                             .layers = layers,
                                             .starts = rasterize.pixel_starts,
                                             .list = rasterize.list,
                                             .fragments = rasterize.values,
                                             .grad_places = grad_places,
                                             .grads = rasterize.grads});
  }
}

void SampledSurface::tangent(const shared::FrameParams& p, const Rasterize& rasterize, cl_uint layers,
                             const Tangents& tangents) {
  moved.resize(device_, std::size_t{tangents.params.directions} * layers * p.views * p.width * p.height);
  for (const Range& pixels : rasterize.pixels(p)) {
    launch_(pixels, kernel::samples_tangent{.p = p,
                                            .last_pixel = pixels.last(),
                                            .layers = layers,
                                            .q = tangents.params,
                                            .starts = rasterize.pixel_starts,
                                            .list = rasterize.list,
                                            .fragments = rasterize.values,
                                            .moved = tangents.fragments,
                                            .tangents = moved});
  }
}

}  // namespace dpr
