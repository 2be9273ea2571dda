#include "stages/shade.hpp"

#include "scene/light_table.hpp"

namespace dpr {
namespace {

std::string shading_options(const ShadingModel& model) {
  return " -DDPR_SHADING=" + std::to_string(static_cast<int>(model.shading) + DPR_FLAT) +
         " -DDPR_LIGHTS=" + std::to_string(model.lights) +
         " -DDPR_BASE=" + std::to_string(model.is_textured ? DPR_BASE_OF_FRAGMENTS : DPR_BASE_OF_CORNERS);
}

}  // namespace

LitShading::LitShading(Device::Impl& device, const ShadingModel& of)
    : model(of),
      normals_forward(device, "normals.cl", "normals_forward"),
      normals_backward_normalize(device, "normals.cl", "normals_backward_normalize"),
      normals_backward(device, "normals.cl", "normals_backward"),
      normals_given_forward(device, "normals.cl", "normals_given_forward"),
      normals_given_backward(device, "normals.cl", "normals_given_backward"),
      forward(device, "shade_lit.cl", "shade_lit_forward", shading_options(of)),
      backward(device, "shade_lit.cl", "shade_lit_backward", shading_options(of)),
      backward_lights(device, "shade_lit.cl", "shade_lit_backward_lights", shading_options(of)) {}

Shade::Shade(Device::Impl& device)
    : device_(device),
      forward_(device, "shade.cl", "shade_forward"),
      backward_(device, "shade.cl", "shade_backward") {}

void Shade::make_surface() {
  if (!surface) surface.emplace(device_);
}

Shade::Lighting Shade::prepare(const std::optional<Lights>& lights, bool is_textured) const {
  Lighting prepared;
  if (!lights) return prepared;
  const ShadingModel model{lights->shading, needs_of(*lights), is_textured};
  const bool known = now_.kernels && now_.kernels->model == model;
  prepared.kernels = known ? now_.kernels : std::make_shared<LitShading>(device_, model);
  prepared.params = lighting_params(*lights);
  std::vector<shared::Light> values = device_lights(*lights);
  prepared.params.lights = static_cast<cl_uint>(values.size());
  if (values.empty()) values.emplace_back();  // never read, but an argument all the same
  prepared.lights.upload(device_, values);
  return prepared;
}

std::size_t Shade::light_channel_count() const {
  const cl_uint needs = now_.kernels ? now_.kernels->model.lights : 0;
  return DPR_ENVIRONMENT_CHANNELS(needs) + lights() * DPR_LIGHT_CHANNELS(needs);
}

void Shade::settle(std::size_t fragments) {
  color.settle(fragments);
  base_.settle(fragments);
}

void Shade::forward(const ShadeInputs& in) {
  const bool is_textured = !in.geometry.textures.empty();
  color.resize(device_, in.rasterize.fragment_length());
  if (is_textured) surface->forward(in.surface(), lit() ? base_ : color);
  if (lit()) {
    light(in);
  } else if (!is_textured) {
    const PairGroups groups = in.rasterize.pair_groups(in.bin);
    forward_(groups.count, in.p, groups.pairs, in.bin.pair_face, in.rasterize.fragment_starts,
             in.geometry.face_colors(), in.geometry.colors_of(in.p), in.rasterize.bary1, in.rasterize.bary2,
             color.red, color.green, color.blue);
  }
}

void Shade::find_normals(const ShadeInputs& in) {
  const GivenNormals& given = in.geometry.given_normals;
  normals_.resize(device_, std::size_t{in.p.views} * in.p.normals);
  if (is_flat()) return;
  now_.kernels->normals_forward(std::size_t{in.p.views} * in.p.vertices, in.p, in.geometry.face_vertices,
                                in.geometry.vertex_corners.starts, in.geometry.vertex_corners.corners,
                                in.transform.world, normals_);
  if (given.empty()) return;
  now_.kernels->normals_given_forward(in.p.views * given.count, in.p, in.views.models, given.values,
                                      given.mesh, in.geometry.places, normals_);
}

void Shade::light(const ShadeInputs& in) {
  const Range pairs = in.rasterize.pairs(in.bin);
  find_normals(in);
  now_.kernels->forward(pairs, in.p, now_.params, pairs.last(), in.views.cameras, now_.lights,
                        in.geometry.face_vertices, in.geometry.face_colors(), in.geometry.colors_of(in.p),
                        in.transform.world, in.geometry.face_normals(), normals_,
                        in.geometry.materials.values, in.bin.pair_face, in.rasterize.fragment_starts,
                        in.rasterize.bary1, in.rasterize.bary2, base_.red, base_.green, base_.blue, color.red,
                        color.green, color.blue);
}

void Shade::backward(const ShadeInputs& in, const ColorPlanes& grad) {
  const bool is_textured = !in.geometry.textures.empty();
  for (Buffer<float>* buffer : {&grad_bary1, &grad_bary2}) buffer->resize(device_, in.rasterize.fragments);
  grad_corner_colors.resize(device_, Length::varying(std::size_t{9} * in.bin.pairs));
  if (lit()) light_backward(in, grad);
  if (is_textured) {
    surface->backward(in.surface(), grad_base(grad), lit(), grad_bary1, grad_bary2, grad_corner_colors);
  } else if (!lit()) {
    const PairGroups groups = in.rasterize.pair_groups(in.bin);
    backward_(groups.count, in.p, groups.pairs, in.bin.pair_face, in.rasterize.fragment_starts,
              in.geometry.face_colors(), in.geometry.colors_of(in.p), in.rasterize.bary1, in.rasterize.bary2,
              grad.red, grad.green, grad.blue, grad_bary1, grad_bary2, grad_corner_colors);
  }
}

void Shade::light_backward(const ShadeInputs& in, const ColorPlanes& grad) {
  const Range pairs = in.rasterize.pairs(in.bin);
  if (now_.kernels->model.is_textured) grad_base_.resize(device_, in.rasterize.fragments);
  grad_corner_positions_.resize(device_, Length::varying(std::size_t{9} * in.bin.pairs));
  grad_corner_normals_.resize(device_, Length::varying(std::size_t{9} * in.bin.pairs));
  grad_materials.resize(device_, Length::varying(std::size_t{DPR_MATERIAL_CHANNELS} * in.bin.pairs));
  grad_eye.resize(device_, Length::varying(std::size_t{3} * in.bin.pairs));
  now_.kernels->backward(pairs, in.p, now_.params, static_cast<cl_uint>(in.bin.pairs), pairs.last(),
                         in.views.cameras, now_.lights, in.geometry.face_vertices, in.geometry.face_colors(),
                         in.geometry.colors_of(in.p), in.transform.world, in.geometry.face_normals(),
                         normals_, in.geometry.materials.values, in.bin.pair_face,
                         in.rasterize.fragment_starts, in.rasterize.bary1, in.rasterize.bary2, base_.red,
                         base_.green, base_.blue, grad.red, grad.green, grad.blue, grad_bary1, grad_bary2,
                         grad_base_.red, grad_base_.green, grad_base_.blue, grad_corner_colors,
                         grad_corner_positions_, grad_corner_normals_, grad_materials, grad_eye);
}

void Shade::backward_world(const ShadeInputs& in, Gather& gather, Buffer<cl_float4>& grad_world) {
  gather.per_view(in.p, in.p.vertices, in.bin, in.geometry.vertex_corners, grad_corner_positions_,
                  grad_world);
  if (is_flat()) return;
  gather.per_view(in.p, in.p.normals, in.bin, in.geometry.normal_corners(), grad_corner_normals_,
                  grad_normals_);
  now_.kernels->normals_backward_normalize(std::size_t{in.p.views} * in.p.normals, in.p, normals_,
                                           grad_normals_);
  now_.kernels->normals_backward(std::size_t{in.p.views} * in.p.vertices, in.p, in.geometry.face_vertices,
                                 in.geometry.vertex_corners.starts, in.geometry.vertex_corners.corners,
                                 in.transform.world, grad_normals_, grad_world);
}

void Shade::backward_given_normals(const ShadeInputs& in) {
  const GivenNormals& given = in.geometry.given_normals;
  if (given.empty()) return;
  grad_given_normals.resize(device_, given.values.size());
  normal_channels.resize(device_, std::size_t{3} * in.p.views * given.count);
  if (is_flat()) {
    grad_given_normals.fill(cl_float4{});
    normal_channels.fill(0.0F);
    return;
  }
  now_.kernels->normals_given_backward(given.count, in.p, in.views.models, given.values, given.mesh,
                                       in.geometry.places, grad_normals_, grad_given_normals,
                                       normal_channels);
}

void Shade::backward_light(const ShadeInputs& in, const ColorPlanes& grad, std::size_t light) {
  const Range pairs = in.rasterize.pairs(in.bin);
  light_channels.resize(device_, light_channel_count() * in.bin.pairs);
  now_.kernels->backward_lights(
      pairs, in.p, now_.params, static_cast<cl_uint>(in.bin.pairs), pairs.last(), static_cast<cl_uint>(light),
      in.views.cameras, now_.lights, in.geometry.face_vertices, in.geometry.face_colors(),
      in.geometry.colors_of(in.p), in.transform.world, in.geometry.face_normals(), normals_,
      in.geometry.materials.values, in.bin.pair_face, in.rasterize.fragment_starts, in.rasterize.bary1,
      in.rasterize.bary2, base_.red, base_.green, base_.blue, grad.red, grad.green, grad.blue,
      light_channels);
}

std::size_t Shade::bytes() const {
  std::size_t bytes = now_.lights.capacity_bytes() + normals_.capacity_bytes() +
                      grad_normals_.capacity_bytes() + grad_given_normals.capacity_bytes() +
                      (surface ? surface->bytes() : 0) + color.bytes() + base_.bytes() + grad_base_.bytes();
  for (const Buffer<float>* buffer :
       {&grad_bary1, &grad_bary2, &grad_corner_colors, &grad_materials, &normal_channels, &grad_eye,
        &light_channels, &grad_corner_positions_, &grad_corner_normals_}) {
    bytes += buffer->capacity_bytes();
  }
  return bytes;
}

}  // namespace dpr
