#include "stages/opacity.hpp"

namespace dpr {
namespace {

template <class Arguments>
OpacityArguments<Arguments> with_texels(const Arguments& in, const shared::OpacityParams& in_force,
                                        const Geometry& geometry) {
  return {in, in_force, geometry.textures.opacities};
}

}  // namespace

void Opacity::set_params(const Smoothing& smoothing, bool follows_opacities, bool is_textured) {
  in_force_ = {smoothing.composition == Composition::joint ? 1e-6F : 1e-20F,
               follows_opacities ? 1 - 1e-6F : 1,
               cl_uint{smoothing.occupancy_estimator == Estimator::monte_carlo}, cl_uint{is_textured}};
}

void Opacity::forward(const SurfaceArguments& in, const Geometry& geometry, const Bin& bin,
                      const Rasterize& rasterize) {
  const PairGroups groups = rasterize.pair_groups(bin);
  kernels()(groups.count, kernel::opacity_forward{.p = in.p,
                                                  .in_force = in_force_,
                                                  .range = groups.pairs,
                                                  .pairs = in.pairs,
                                                  .pair_face = in.pair_face,
                                                  .fragment_starts = in.fragment_starts,
                                                  .faces = in.faces,
                                                  .opacities = geometry.opacities.values,
                                                  .fragments = in.fragments});
  if (in_force_.is_textured)
    texture_kernels()(rasterize.pairs(bin),
                      kernel::opacity_texels_forward::pick(with_texels(in, in_force_, geometry)));
}

void Opacity::backward(const SurfaceArguments& in, const Geometry& geometry, const Bin& bin,
                       const Rasterize& rasterize) {
  if (in_force_.is_textured)
    texture_kernels()(rasterize.pairs(bin),
                      kernel::opacity_texels_backward::pick(with_texels(in, in_force_, geometry)));
  grad_pairs.resize(device_, Length::varying(std::size_t{9} * bin.pairs));
  const PairGroups groups = rasterize.pair_groups(bin);
  kernels()(groups.count, kernel::opacity_backward{.p = in.p,
                                                   .in_force = in_force_,
                                                   .range = groups.pairs,
                                                   .pairs = in.pairs,
                                                   .pair_face = in.pair_face,
                                                   .fragment_starts = in.fragment_starts,
                                                   .faces = in.faces,
                                                   .opacities = geometry.opacities.values,
                                                   .fragments = in.fragments,
                                                   .grads = in.grads,
                                                   .grad_opacities = grad_pairs});
}

void Opacity::list_texels(const SurfaceArguments& in, Surface& surface, const Bin& bin,
                          const Rasterize& rasterize) {
  surface.start_list(in.p, rasterize);
  texture_kernels()(rasterize.pairs(bin),
                    kernel::opacity_texels_list::pick(SurfaceListArguments{in, surface.cells, surface.seen}));
  surface.finish_list(in, bin, rasterize);
}

void Opacity::tangent(const SurfaceTangentArguments& in, const Geometry& geometry, const Bin& bin,
                      const Rasterize& rasterize, const Buffer<cl_float4>& opacity_tangents,
                      Surface* surface) {
  const PairGroups groups = rasterize.pair_groups(bin);
  kernels()(groups.count,
            kernel::opacity_tangent{.p = in.p,
                                    .in_force = in_force_,
                                    .range = groups.pairs,
                                    .q = in.q,
                                    .moving = to_uint(opacity_tangents.size() / in.q.directions),
                                    .pairs = in.pairs,
                                    .pair_face = in.pair_face,
                                    .fragment_starts = in.fragment_starts,
                                    .faces = in.faces,
                                    .opacities = geometry.opacities.values,
                                    .opacity_tangents = opacity_tangents,
                                    .fragments = in.fragments,
                                    .tangents = in.tangents});
  if (!in_force_.is_textured) return;
  const Range pairs = rasterize.pairs(bin);
  texture_kernels()(pairs, kernel::opacity_texels_tangent::pick(with_texels(in, in_force_, geometry)));
  SurfaceTangentArguments to_log = in;
  to_log.q.base_plane =
      DPR_PLANE_LOG_OCCUPANCY - 2;  // of the third of three planes; shading fills the others
  surface->tangent_detail(to_log, pairs);
}

}  // namespace dpr
