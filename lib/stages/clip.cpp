#include "stages/clip.hpp"

#include "stages/rasterize.hpp"

namespace dpr {

Clip::Kernels::Kernels(Device::Impl& device)
    : forward(device, "clip.cl", "clip_forward"),
      cover(device, "clip.cl", "clip_cover"),
      fragments(device, "clip.cl", "clip_fragments"),
      backward(device, "clip.cl", "clip_backward") {}

void Clip::forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
                   const Transform& transform, Setup& setup, Buffer<cl_uint>& counts) {
  if (!kernels_) kernels_.emplace(device_);
  views_ = &views;
  const std::size_t count = std::size_t{p.views} * p.faces;
  faces.resize(device_, count);
  kernels_->forward(count, p, views.cameras, geometry.face_vertices, transform.world, transform.ndc, faces,
                    setup.facing, setup.kept, counts, setup.triangles);
}

void Clip::cover(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                 Buffer<cl_uint2>& masks, Buffer<cl_uint>& counts) {
  kernels_->cover(bin.pairs, p, static_cast<cl_uint>(bin.pairs), bin.pair_count, faces, triangles,
                  bin.pair_face, bin.pair_tile, masks, counts);
}

void Clip::fragments(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                     Rasterize& rasterize) {
  const Range pairs = rasterize.pairs(bin);
  kernels_->fragments(pairs, p, pairs.last(), faces, triangles, bin.pair_face, rasterize.fragment_starts,
                      rasterize.fragment_pixel, rasterize.distance, rasterize.depth, rasterize.bary1,
                      rasterize.bary2);
}

void Clip::backward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
                    Rasterize& rasterize, const Buffer<float>& grad_distance, const Buffer<float>& grad_depth,
                    const Buffer<float>& grad_bary1, const Buffer<float>& grad_bary2) {
  const Range pairs = rasterize.pairs(bin);
  grad_corners.resize(device_, std::size_t{9} * bin.pairs);
  kernels_->backward(pairs, p, pairs.last(), views_->cameras, faces, triangles, bin.pair_face,
                     rasterize.fragment_starts, rasterize.fragment_pixel, rasterize.distance, grad_distance,
                     grad_depth, grad_bary1, grad_bary2, rasterize.grad_corners, grad_corners);
}

}  // namespace dpr
