#include "stages/surface.hpp"

namespace dpr {

void Surface::backward_detail(const SurfaceArguments& in, const Range& pairs, Buffer<float>& grad_corners,
                              Buffer<float>& grad_clip) {
  if (in.p.levels == 1) return;
  launch_(pairs, kernel::surface_detail_backward{.p = in.p,
                                                 .pairs = in.pairs,
                                                 .pair_face = in.pair_face,
                                                 .faces = in.faces,
                                                 .textures = in.textures,
                                                 .triangles = in.triangles,
                                                 .clipped = in.clipped,
                                                 .grad_pairs = in.grad_pairs,
                                                 .grad_corners = grad_corners,
                                                 .grad_clip = grad_clip});
}

void Surface::list(const SurfaceArguments& in, const Range& pairs, const Bin& bin,
                   const Rasterize& rasterize) {
  const std::size_t places = in.p.levels * rasterize.fragments;
  place_count.resize(device_, 1);
  cells.resize(device_, places);
  seen.resize(device_, places);
  launch_(pairs, kernel::surface_list{.p = in.p,
                                      .pairs = in.pairs,
                                      .pair_face = in.pair_face,
                                      .fragment_starts = in.fragment_starts,
                                      .faces = in.faces,
                                      .colors = in.colors,
                                      .texcoords = in.texcoords,
                                      .textures = in.textures,
                                      .triangles = in.triangles,
                                      .clipped = in.clipped,
                                      .fragments = in.fragments,
                                      .grads = in.grads,
                                      .cells = cells,
                                      .seen = seen});
  launch_(std::max<std::size_t>(places, 1), kernel::surface_place{.p = in.p,
                                                                  .fragment_starts = in.fragment_starts,
                                                                  .fragment_pair = rasterize.fragment_pair,
                                                                  .pair_tile = bin.pair_tile,
                                                                  .places = place_count,
                                                                  .seen = seen});
}

}  // namespace dpr
