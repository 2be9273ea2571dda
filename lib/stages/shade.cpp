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
    : model(of), normals(device), shade(device, shading_options(of)) {}

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
    launch_(groups.count, kernel::shade_forward{.p = in.p,
                                                .range = groups.pairs,
                                                .pairs = in.bin.pair_count,
                                                .pair_face = in.bin.pair_face,
                                                .fragment_starts = in.rasterize.fragment_starts,
                                                .face_colors = in.geometry.face_colors(),
                                                .colors = in.geometry.colors_of(in.p),
                                                .bary1 = in.rasterize.bary1,
                                                .bary2 = in.rasterize.bary2,
                                                .red = color.red,
                                                .green = color.green,
                                                .blue = color.blue});
  }
}

void Shade::find_normals(const ShadeInputs& in) {
  const GivenNormals& given = in.geometry.given_normals;
  normals_.resize(device_, std::size_t{in.p.views} * in.p.normals);
  if (is_flat()) return;
  now_.kernels->normals(std::size_t{in.p.views} * in.p.vertices,
                        kernel::normals_forward{.p = in.p,
                                                .faces = in.geometry.face_vertices,
                                                .corner_starts = in.geometry.vertex_corners.starts,
                                                .corners = in.geometry.vertex_corners.corners,
                                                .world = in.transform.world,
                                                .normals = normals_});
  if (given.empty()) return;
  now_.kernels->normals(in.p.views * given.count, kernel::normals_given_forward{.p = in.p,
                                                                                .models = in.views.models,
                                                                                .values = given.values,
                                                                                .given_mesh = given.mesh,
                                                                                .places = in.geometry.places,
                                                                                .normals = normals_});
}

void Shade::light(const ShadeInputs& in) {
  const Range pairs = in.rasterize.pairs(in.bin);
  find_normals(in);
  now_.kernels->shade(pairs, kernel::shade_lit_forward{.p = in.p,
                                                       .lp = now_.params,
                                                       .last_pair = pairs.last(),
                                                       .pair_count = in.bin.pair_count,
                                                       .views = in.views.cameras,
                                                       .lights = now_.lights,
                                                       .faces = in.geometry.face_vertices,
                                                       .face_colors = in.geometry.face_colors(),
                                                       .colors = in.geometry.colors_of(in.p),
                                                       .world = in.transform.world,
                                                       .face_normals = in.geometry.face_normals(),
                                                       .normals = normals_,
                                                       .materials = in.geometry.materials.values,
                                                       .pair_face = in.bin.pair_face,
                                                       .fragment_starts = in.rasterize.fragment_starts,
                                                       .bary1 = in.rasterize.bary1,
                                                       .bary2 = in.rasterize.bary2,
                                                       .base_red = base_.red,
                                                       .base_green = base_.green,
                                                       .base_blue = base_.blue,
                                                       .red = color.red,
                                                       .green = color.green,
                                                       .blue = color.blue});
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
    launch_(groups.count, kernel::shade_backward{.p = in.p,
                                                 .range = groups.pairs,
                                                 .pairs = in.bin.pair_count,
                                                 .pair_face = in.bin.pair_face,
                                                 .fragment_starts = in.rasterize.fragment_starts,
                                                 .face_colors = in.geometry.face_colors(),
                                                 .colors = in.geometry.colors_of(in.p),
                                                 .bary1 = in.rasterize.bary1,
                                                 .bary2 = in.rasterize.bary2,
                                                 .grad_red = grad.red,
                                                 .grad_green = grad.green,
                                                 .grad_blue = grad.blue,
                                                 .grad_bary1 = grad_bary1,
                                                 .grad_bary2 = grad_bary2,
                                                 .grad_colors = grad_corner_colors});
  }
}

void Shade::light_backward(const ShadeInputs& in, const ColorPlanes& grad) {
  const Range pairs = in.rasterize.pairs(in.bin);
  if (now_.kernels->model.is_textured) grad_base_.resize(device_, in.rasterize.fragments);
  grad_corner_positions_.resize(device_, Length::varying(std::size_t{9} * in.bin.pairs));
  grad_corner_normals_.resize(device_, Length::varying(std::size_t{9} * in.bin.pairs));
  grad_materials.resize(device_, Length::varying(std::size_t{DPR_MATERIAL_CHANNELS} * in.bin.pairs));
  grad_eye.resize(device_, Length::varying(std::size_t{3} * in.bin.pairs));
  now_.kernels->shade(pairs, kernel::shade_lit_backward{.p = in.p,
                                                        .lp = now_.params,
                                                        .pairs = static_cast<cl_uint>(in.bin.pairs),
                                                        .last_pair = pairs.last(),
                                                        .pair_count = in.bin.pair_count,
                                                        .views = in.views.cameras,
                                                        .lights = now_.lights,
                                                        .faces = in.geometry.face_vertices,
                                                        .face_colors = in.geometry.face_colors(),
                                                        .colors = in.geometry.colors_of(in.p),
                                                        .world = in.transform.world,
                                                        .face_normals = in.geometry.face_normals(),
                                                        .normals = normals_,
                                                        .materials = in.geometry.materials.values,
                                                        .pair_face = in.bin.pair_face,
                                                        .fragment_starts = in.rasterize.fragment_starts,
                                                        .bary1 = in.rasterize.bary1,
                                                        .bary2 = in.rasterize.bary2,
                                                        .base_red = base_.red,
                                                        .base_green = base_.green,
                                                        .base_blue = base_.blue,
                                                        .grad_red = grad.red,
                                                        .grad_green = grad.green,
                                                        .grad_blue = grad.blue,
                                                        .grad_bary1 = grad_bary1,
                                                        .grad_bary2 = grad_bary2,
                                                        .grad_base_red = grad_base_.red,
                                                        .grad_base_green = grad_base_.green,
                                                        .grad_base_blue = grad_base_.blue,
                                                        .grad_colors = grad_corner_colors,
                                                        .grad_positions = grad_corner_positions_,
                                                        .grad_normals = grad_corner_normals_,
                                                        .grad_materials = grad_materials,
                                                        .grad_eye = grad_eye});
}

void Shade::backward_world(const ShadeInputs& in, Gather& gather, Buffer<cl_float4>& grad_world) {
  gather.per_view(in.p, in.p.vertices, in.bin, in.geometry.vertex_corners, grad_corner_positions_,
                  grad_world);
  if (is_flat()) return;
  gather.per_view(in.p, in.p.normals, in.bin, in.geometry.normal_corners(), grad_corner_normals_,
                  grad_normals_);
  now_.kernels->normals(
      std::size_t{in.p.views} * in.p.normals,
      kernel::normals_backward_normalize{.p = in.p, .normals = normals_, .grad_normals = grad_normals_});
  now_.kernels->normals(std::size_t{in.p.views} * in.p.vertices,
                        kernel::normals_backward{.p = in.p,
                                                 .faces = in.geometry.face_vertices,
                                                 .corner_starts = in.geometry.vertex_corners.starts,
                                                 .corners = in.geometry.vertex_corners.corners,
                                                 .world = in.transform.world,
                                                 .grad_sums = grad_normals_,
                                                 .grad_world = grad_world});
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
  now_.kernels->normals(given.count, kernel::normals_given_backward{.p = in.p,
                                                                    .models = in.views.models,
                                                                    .values = given.values,
                                                                    .given_mesh = given.mesh,
                                                                    .places = in.geometry.places,
                                                                    .grad_sums = grad_normals_,
                                                                    .grad_values = grad_given_normals,
                                                                    .channels = normal_channels});
}

void Shade::backward_light(const ShadeInputs& in, const ColorPlanes& grad, std::size_t light) {
  const Range pairs = in.rasterize.pairs(in.bin);
  light_channels.resize(device_, light_channel_count() * in.bin.pairs);
  now_.kernels->shade(pairs,
                      kernel::shade_lit_backward_lights{.p = in.p,
                                                        .lp = now_.params,
                                                        .pairs = static_cast<cl_uint>(in.bin.pairs),
                                                        .last_pair = pairs.last(),
                                                        .pair_count = in.bin.pair_count,
                                                        .light = static_cast<cl_uint>(light),
                                                        .views = in.views.cameras,
                                                        .lights = now_.lights,
                                                        .faces = in.geometry.face_vertices,
                                                        .face_colors = in.geometry.face_colors(),
                                                        .colors = in.geometry.colors_of(in.p),
                                                        .world = in.transform.world,
                                                        .face_normals = in.geometry.face_normals(),
                                                        .normals = normals_,
                                                        .materials = in.geometry.materials.values,
                                                        .pair_face = in.bin.pair_face,
                                                        .fragment_starts = in.rasterize.fragment_starts,
                                                        .bary1 = in.rasterize.bary1,
                                                        .bary2 = in.rasterize.bary2,
                                                        .base_red = base_.red,
                                                        .base_green = base_.green,
                                                        .base_blue = base_.blue,
                                                        .grad_red = grad.red,
                                                        .grad_green = grad.green,
                                                        .grad_blue = grad.blue,
                                                        .channels = light_channels});
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
