#include "stages/surface.hpp"

namespace dpr {

void ColorPlanes::resize(Device::Impl& device, Length length) {
  for (Buffer<float>* plane : {&red, &green, &blue}) plane->resize(device, length);
}

void ColorPlanes::settle(std::size_t fragments) {
  for (Buffer<float>* plane : {&red, &green, &blue}) plane->settle(fragments);
}

std::size_t ColorPlanes::bytes() const {
  return red.capacity_bytes() + green.capacity_bytes() + blue.capacity_bytes();
}

Surface::Surface(Device::Impl& device)
    : device_(device),
      forward_(device, "surface.cl", "surface_forward"),
      backward_(device, "surface.cl", "surface_backward"),
      backward_detail_(device, "surface.cl", "surface_detail_backward"),
      list_(device, "surface.cl", "surface_list") {}

void Surface::forward(const SurfaceInputs& in, ColorPlanes& base) {
  const Textures& t = in.geometry.textures;
  const Range pairs = in.rasterize.pairs(in.bin);
  base.resize(device_, in.rasterize.fragment_length());
  forward_(pairs, in.p, pairs.last(), in.bin.pair_face, in.rasterize.fragment_starts,
           in.geometry.face_colors(), in.geometry.colors_of(in.p), t.face_texcoords, t.texcoord_values,
           t.textures, t.texel_values, in.triangles, in.clipped, in.rasterize.bary1, in.rasterize.bary2,
           base.red, base.green, base.blue);
}

void Surface::backward(const SurfaceInputs& in, const ColorPlanes& grad_base, bool adds,
                       Buffer<float>& grad_bary1, Buffer<float>& grad_bary2,
                       Buffer<float>& grad_corner_colors) {
  const Textures& t = in.geometry.textures;
  const Range pairs = in.rasterize.pairs(in.bin);
  grad_corner_texcoords.resize(device_, std::size_t{9} * in.bin.pairs);
  grad_steps_.resize(device_, std::size_t{9} * in.bin.pairs);
  backward_(pairs, in.p, pairs.last(), adds ? 1 : 0, in.bin.pair_face, in.rasterize.fragment_starts,
            in.geometry.face_colors(), in.geometry.colors_of(in.p), t.face_texcoords, t.texcoord_values,
            t.textures, t.texel_values, in.triangles, in.clipped, in.rasterize.bary1, in.rasterize.bary2,
            grad_base.red, grad_base.green, grad_base.blue, grad_bary1, grad_bary2, grad_corner_colors,
            grad_corner_texcoords, grad_steps_);
}

void Surface::backward_detail(const SurfaceInputs& in, Buffer<float>& grad_corners,
                              Buffer<float>& grad_clip) {
  const Textures& t = in.geometry.textures;
  if (!t.has_pyramids()) return;
  const Range pairs = in.rasterize.pairs(in.bin);
  backward_detail_(pairs, in.p, pairs.last(), in.bin.pair_face, t.face_texcoords, t.textures, in.triangles,
                   in.clipped, grad_steps_, grad_corners, grad_clip);
}

void Surface::list(const SurfaceInputs& in, const ColorPlanes& grad_base) {
  const Textures& t = in.geometry.textures;
  const Range pairs = in.rasterize.pairs(in.bin);
  const std::size_t levels = t.has_pyramids() ? 2 : 1, places = levels * in.rasterize.fragments;
  place_count.resize(device_, 1);
  for (Buffer<cl_uint>* buffer : {&cells, &numbers}) buffer->resize(device_, places);
  parts.resize(device_, places);
  grad_seen.resize(device_, places);
  list_(pairs, in.p, pairs.last(), static_cast<cl_uint>(t.texels), static_cast<cl_uint>(levels),
        in.bin.pair_face, in.rasterize.fragment_starts, in.geometry.face_colors(),
        in.geometry.colors_of(in.p), t.face_texcoords, t.texcoord_values, t.textures, in.triangles,
        in.clipped, in.rasterize.bary1, in.rasterize.bary2, grad_base.red, grad_base.green, grad_base.blue,
        place_count, cells, numbers, parts, grad_seen);
}

std::size_t Surface::bytes() const {
  return grad_corner_texcoords.capacity_bytes() + grad_steps_.capacity_bytes() +
         place_count.capacity_bytes() + cells.capacity_bytes() + numbers.capacity_bytes() +
         parts.capacity_bytes() + grad_seen.capacity_bytes();
}

}  // namespace dpr
