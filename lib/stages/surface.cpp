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

void Surface::forward(const SurfaceInputs& in, ColorPlanes& base) {
  const Textures& t = in.geometry.textures;
  const Range pairs = in.rasterize.pairs(in.bin);
  base.resize(device_, in.rasterize.fragment_length());
  launch_(pairs, kernel::surface_forward{.p = in.p,
                                         .last_pair = pairs.last(),
                                         .pairs = in.bin.pair_count,
                                         .pair_face = in.bin.pair_face,
                                         .fragment_starts = in.rasterize.fragment_starts,
                                         .face_colors = in.geometry.face_colors(),
                                         .colors = in.geometry.colors_of(in.p),
                                         .face_texcoords = t.face_texcoords,
                                         .texcoords = t.texcoord_values,
                                         .textures = t.textures,
                                         .texels = t.texel_values,
                                         .triangles = in.triangles,
                                         .clipped = in.clipped,
                                         .bary1 = in.rasterize.bary1,
                                         .bary2 = in.rasterize.bary2,
                                         .red = base.red,
                                         .green = base.green,
                                         .blue = base.blue});
}

void Surface::backward(const SurfaceInputs& in, const ColorPlanes& grad_base, bool adds,
                       Buffer<float>& grad_bary1, Buffer<float>& grad_bary2,
                       Buffer<float>& grad_corner_colors) {
  const Textures& t = in.geometry.textures;
  const Range pairs = in.rasterize.pairs(in.bin);
  grad_corner_texcoords.resize(device_, std::size_t{9} * in.bin.pairs);
  grad_steps_.resize(device_, std::size_t{9} * in.bin.pairs);
  launch_(pairs, kernel::surface_backward{.p = in.p,
                                          .last_pair = pairs.last(),
                                          .pairs = in.bin.pair_count,
                                          .adds = cl_uint{adds},
                                          .pair_face = in.bin.pair_face,
                                          .fragment_starts = in.rasterize.fragment_starts,
                                          .face_colors = in.geometry.face_colors(),
                                          .colors = in.geometry.colors_of(in.p),
                                          .face_texcoords = t.face_texcoords,
                                          .texcoords = t.texcoord_values,
                                          .textures = t.textures,
                                          .texels = t.texel_values,
                                          .triangles = in.triangles,
                                          .clipped = in.clipped,
                                          .bary1 = in.rasterize.bary1,
                                          .bary2 = in.rasterize.bary2,
                                          .grad_red = grad_base.red,
                                          .grad_green = grad_base.green,
                                          .grad_blue = grad_base.blue,
                                          .grad_bary1 = grad_bary1,
                                          .grad_bary2 = grad_bary2,
                                          .grad_colors = grad_corner_colors,
                                          .grad_texcoords = grad_corner_texcoords,
                                          .grad_steps = grad_steps_});
}

void Surface::backward_detail(const SurfaceInputs& in, Buffer<float>& grad_corners,
                              Buffer<float>& grad_clip) {
  const Textures& t = in.geometry.textures;
  if (!t.has_pyramids()) return;
  const Range pairs = in.rasterize.pairs(in.bin);
  launch_(pairs, kernel::surface_detail_backward{.p = in.p,
                                                 .last_pair = pairs.last(),
                                                 .pairs = in.bin.pair_count,
                                                 .pair_face = in.bin.pair_face,
                                                 .face_texcoords = t.face_texcoords,
                                                 .textures = t.textures,
                                                 .triangles = in.triangles,
                                                 .clipped = in.clipped,
                                                 .grad_steps = grad_steps_,
                                                 .grad_corners = grad_corners,
                                                 .grad_clip = grad_clip});
}

void Surface::list(const SurfaceInputs& in, const ColorPlanes& grad_base) {
  const Textures& t = in.geometry.textures;
  const Range pairs = in.rasterize.pairs(in.bin);
  const std::size_t levels = t.has_pyramids() ? 2 : 1, places = levels * in.rasterize.fragments;
  place_count.resize(device_, 1);
  for (Buffer<cl_uint>* buffer : {&cells, &numbers}) buffer->resize(device_, places);
  parts.resize(device_, places);
  grad_seen.resize(device_, places);
  launch_(pairs, kernel::surface_list{.p = in.p,
                                      .last_pair = pairs.last(),
                                      .pairs = in.bin.pair_count,
                                      .no_cell = static_cast<cl_uint>(t.texels),
                                      .levels = static_cast<cl_uint>(levels),
                                      .pair_face = in.bin.pair_face,
                                      .pair_tile = in.bin.pair_tile,
                                      .fragment_starts = in.rasterize.fragment_starts,
                                      .face_colors = in.geometry.face_colors(),
                                      .colors = in.geometry.colors_of(in.p),
                                      .face_texcoords = t.face_texcoords,
                                      .texcoords = t.texcoord_values,
                                      .textures = t.textures,
                                      .triangles = in.triangles,
                                      .clipped = in.clipped,
                                      .bary1 = in.rasterize.bary1,
                                      .bary2 = in.rasterize.bary2,
                                      .grad_red = grad_base.red,
                                      .grad_green = grad_base.green,
                                      .grad_blue = grad_base.blue,
                                      .places = place_count,
                                      .cells = cells,
                                      .numbers = numbers,
                                      .parts = parts,
                                      .grad_seen = grad_seen});
}

std::size_t Surface::bytes() const {
  return grad_corner_texcoords.capacity_bytes() + grad_steps_.capacity_bytes() +
         place_count.capacity_bytes() + cells.capacity_bytes() + numbers.capacity_bytes() +
         parts.capacity_bytes() + grad_seen.capacity_bytes();
}

}  // namespace dpr
