#include "stages/opacity.hpp"

namespace dpr {

Opacity::Kernels& Opacity::kernels() { return launch_ ? *launch_ : launch_.emplace(device_); }

void Opacity::set_bounds(Composition composition, bool follows_opacities) {
  bounds_ = {{composition == Composition::joint ? 1e-6F : 1e-20F, follows_opacities ? 1 - 1e-6F : 1}};
}

void Opacity::forward(const shared::FrameParams& p, const Geometry& geometry, const Bin& bin,
                      Rasterize& rasterize) {
  const PairGroups groups = rasterize.pair_groups(bin);
  kernels()(groups.count, kernel::opacity_forward{.p = p,
                                                  .bounds = bounds_,
                                                  .range = groups.pairs,
                                                  .pairs = bin.pair_count,
                                                  .pair_face = bin.pair_face,
                                                  .fragment_starts = rasterize.fragment_starts,
                                                  .faces = geometry.face_vertices,
                                                  .opacities = geometry.opacities.values,
                                                  .fragments = rasterize.values});
}

void Opacity::backward(const shared::FrameParams& p, const Geometry& geometry, const Bin& bin,
                       Rasterize& rasterize, bool is_sampled) {
  grad_pairs.resize(device_, Length::varying(std::size_t{9} * bin.pairs));
  const PairGroups groups = rasterize.pair_groups(bin);
  kernels()(groups.count, kernel::opacity_backward{.p = p,
                                                   .bounds = bounds_,
                                                   .range = groups.pairs,
                                                   .is_sampled = cl_uint{is_sampled},
                                                   .pairs = bin.pair_count,
                                                   .pair_face = bin.pair_face,
                                                   .fragment_starts = rasterize.fragment_starts,
                                                   .faces = geometry.face_vertices,
                                                   .opacities = geometry.opacities.values,
                                                   .fragments = rasterize.values,
                                                   .grads = rasterize.grads,
                                                   .grad_opacities = grad_pairs});
}

void Opacity::tangent(const shared::FrameParams& p, const Geometry& geometry, const Bin& bin,
                      const Rasterize& rasterize, Tangents& tangents) {
  const PairGroups groups = rasterize.pair_groups(bin);
  kernels()(groups.count,
            kernel::opacity_tangent{.p = p,
                                    .bounds = bounds_,
                                    .range = groups.pairs,
                                    .q = tangents.params,
                                    .moving = to_uint(tangents.opacities.size() / tangents.params.directions),
                                    .pairs = bin.pair_count,
                                    .pair_face = bin.pair_face,
                                    .fragment_starts = rasterize.fragment_starts,
                                    .faces = geometry.face_vertices,
                                    .opacities = geometry.opacities.values,
                                    .opacity_tangents = tangents.opacities,
                                    .fragments = rasterize.values,
                                    .tangents = tangents.fragments});
}

}  // namespace dpr
