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
  start_list(in.p, rasterize);
  launch_(pairs, kernel::surface_list::pick(SurfaceListArguments{in, cells, seen}));
  finish_list(in, bin, rasterize);
}

void Surface::start_list(const shared::FrameParams& p, const Rasterize& rasterize) {
  const std::size_t places = p.levels * rasterize.fragments;
  place_count.resize(device_, 1);
  cells.resize(device_, places);
  seen.resize(device_, places);
}

void Surface::finish_list(const SurfaceArguments& in, const Bin& bin, const Rasterize& rasterize) {
  launch_(std::max<std::size_t>(seen.size(), 1),
          kernel::surface_place{.p = in.p,
                                .fragment_starts = in.fragment_starts,
                                .fragment_pair = rasterize.fragment_pair,
                                .pair_tile = bin.pair_tile,
                                .places = place_count,
                                .seen = seen});
}

}  // namespace dpr
