#include "stages/clip.hpp"

#include "stages/rasterize.hpp"

namespace dpr {

void Clip::forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
                   const Transform& transform, Setup& setup, Buffer<cl_uint>& counts) {
  if (!launch_) launch_.emplace(device_);
  views_ = &views;
  const std::size_t count = std::size_t{p.views} * p.faces;
  faces.resize(device_, count);
  (*launch_)(count, kernel::clip_forward{.p = p,
                                         .views = views.cameras,
                                         .faces = geometry.face_vertices,
                                         .world = transform.world,
                                         .ndc = transform.ndc,
                                         .clipped = faces,
                                         .facing = setup.facing,
                                         .kept = setup.kept,
                                         .counts = counts,
                                         .triangles = setup.triangles});
}

void Clip::cover(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                 Buffer<cl_uint2>& masks, Buffer<cl_uint>& counts) {
  (*launch_)(bin.pairs, kernel::clip_cover{.p = p,
                                           .capacity = static_cast<cl_uint>(bin.pairs),
                                           .pairs = bin.pair_count,
                                           .clipped = faces,
                                           .triangles = triangles,
                                           .pair_face = bin.pair_face,
                                           .pair_tile = bin.pair_tile,
                                           .masks = masks,
                                           .counts = counts});
}

void Clip::fragments(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                     Rasterize& rasterize) {
  const Range pairs = rasterize.pairs(bin);
  (*launch_)(pairs, kernel::clip_fragments{.p = p,
                                           .last_pair = pairs.last(),
                                           .pairs = bin.pair_count,
                                           .clipped = faces,
                                           .triangles = triangles,
                                           .pair_face = bin.pair_face,
                                           .fragment_starts = rasterize.fragment_starts,
                                           .pixels = rasterize.fragment_pixel,
                                           .fragments = rasterize.values});
}

void Clip::backward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                    Rasterize& rasterize) {
  const Range pairs = rasterize.pairs(bin);
  grad_corners.resize(device_, std::size_t{9} * bin.pairs);
  grad_cuts.resize(device_, p.distorts != 0 ? DPR_CUT_CHANNELS * bin.pairs : 1);
  (*launch_)(pairs, kernel::clip_backward{.p = p,
                                          .pairs = bin.pair_count,
                                          .views = views_->cameras,
                                          .clipped = faces,
                                          .triangles = triangles,
                                          .pair_face = bin.pair_face,
                                          .fragment_starts = rasterize.fragment_starts,
                                          .pixels = rasterize.fragment_pixel,
                                          .fragments = rasterize.values,
                                          .grads = rasterize.grads,
                                          .grad_corners = rasterize.grad_corners,
                                          .grad_clip = grad_corners,
                                          .grad_cuts = grad_cuts});
  if (p.distorts == 0) return;
  (*launch_)(pairs, kernel::clip_backward_lens{.p = p,
                                               .pairs = bin.pair_count,
                                               .views = views_->cameras,
                                               .clipped = faces,
                                               .pair_face = bin.pair_face,
                                               .fragment_starts = rasterize.fragment_starts,
                                               .grad_cuts = grad_cuts});
}

void Clip::tangent_of_outlines(const shared::FrameParams& p, const Geometry& geometry, Tangents& tangents) {
  if (!tangent_) tangent_.emplace(device_);
  const std::size_t count = std::size_t{p.views} * p.faces;
  tangents.outlines.resize(device_, 4 * tangents.params.directions * count);
  (*tangent_)(count, kernel::clip_outline_tangent{.p = p,
                                                  .q = tangents.params,
                                                  .views = views_->cameras,
                                                  .clipped = faces,
                                                  .faces = geometry.face_vertices,
                                                  .view_tangents = tangents.views,
                                                  .vertices = tangents.ndc,
                                                  .clip_vertices = tangents.clip,
                                                  .outlines = tangents.outlines});
}

void Clip::tangent(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                   const Rasterize& rasterize, Tangents& tangents) {
  (*tangent_)(rasterize.pairs(bin), kernel::clip_tangent{.p = p,
                                                         .q = tangents.params,
                                                         .pairs = bin.pair_count,
                                                         .clipped = faces,
                                                         .triangles = triangles,
                                                         .pair_face = bin.pair_face,
                                                         .fragment_starts = rasterize.fragment_starts,
                                                         .pixels = rasterize.fragment_pixel,
                                                         .outlines = tangents.outlines,
                                                         .fragments = rasterize.values,
                                                         .tangents = tangents.fragments});
}

}  // namespace dpr
