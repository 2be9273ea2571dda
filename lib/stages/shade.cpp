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

Shade::Lighting Shade::prepare(std::span<const Lights> lights, bool is_textured) const {
  Lighting prepared;
  if (lights.empty()) return prepared;
  const Lights& first = lights.front();
  const ShadingModel model{first.shading, needs_of(first), is_textured};
  const bool known = now_.kernels && now_.kernels->model == model;
  prepared.kernels = known ? now_.kernels : std::make_shared<LitShading>(device_, model);
  std::vector<shared::Light> rows;
  for (const Lights& of_view : lights) {
    const std::vector<shared::Light> own = device_lights(of_view);
    rows.insert(rows.end(), own.begin(), own.end());
  }
  const cl_uint of_view = to_uint(rows.size() / lights.size());
  const bool is_shared = lights.size() == 1;
  prepared.params = {of_view - DPR_ENVIRONMENT_ROWS, 0, is_shared ? 0 : of_view, first.shininess};
  prepared.lights.upload(device_, rows);
  if (!is_shared) prepared.of_views.assign(lights.begin(), lights.end());
  return prepared;
}

std::size_t Shade::light_channel_count() const {
  const cl_uint needs = now_.kernels ? now_.kernels->model.lights : 0;
  return DPR_ENVIRONMENT_CHANNELS(needs) + lights() * DPR_LIGHT_CHANNELS(needs);
}

SurfaceArguments Shade::arguments(const ShadeInputs& in) {
  const Geometry& g = in.geometry;
  return {.p = in.p,
          .lp = now_.params,
          .pairs = in.bin.pair_count,
          .pair_face = in.bin.pair_face,
          .fragment_starts = in.rasterize.fragment_starts,
          .views = in.views.cameras,
          .lights = now_.lights,
          .faces = g.face_vertices,
          .colors = g.colors_of(in.p),
          .world = in.transform.world,
          .materials = g.materials.values,
          .texcoords = g.textures.texcoord_values,
          .texels = g.textures.texel_values,
          .textures = g.textures.textures,
          .triangles = in.triangles,
          .clipped = in.clipped,
          .fragments = in.rasterize.values,
          .grads = in.rasterize.grads,
          .grad_pairs = grad_pairs,
          .channels = light_channels};
}

SurfaceTangentArguments Shade::arguments(const ShadeInputs& in, Tangents& tangents) {
  return {arguments(in), tangents.params, tangents.colors,   tangents.world,
          tangents.ndc,  tangents.clip,   tangents.fragments};
}

void Shade::forward(const ShadeInputs& in) {
  const bool is_textured = !in.geometry.textures.empty();
  const Range pairs = in.rasterize.pairs(in.bin);
  if (is_textured) surface->forward(arguments(in), pairs);
  if (lit()) {
    find_normals(in);
    now_.kernels->shade(pairs, kernel::shade_lit_forward::pick(arguments(in)));
  } else if (!is_textured) {
    interpolate(in, in.p, {in.geometry.face_vertices, in.geometry.colors_of(in.p)});
  }
}

namespace {

/// The frame whose triangles show vectors of their own list, the same in all views.
shared::FrameParams showing_vectors(shared::FrameParams p) {
  p.color_faces = p.color_stride = 0;
  return p;
}

}  // namespace

void Shade::forward(const ShadeInputs& in, const CornerVectors& vectors) {
  interpolate(in, showing_vectors(in.p), vectors);
}

void Shade::interpolate(const ShadeInputs& in, const shared::FrameParams& p, const CornerVectors& colors) {
  const PairGroups groups = in.rasterize.pair_groups(in.bin);
  launch_(groups.count, kernel::shade_forward{.p = p,
                                              .range = groups.pairs,
                                              .pairs = in.bin.pair_count,
                                              .pair_face = in.bin.pair_face,
                                              .fragment_starts = in.rasterize.fragment_starts,
                                              .faces = colors.faces,
                                              .colors = colors.values,
                                              .fragments = in.rasterize.values});
}

void Shade::find_normals(const ShadeInputs& in) {
  const GivenNormals& given = in.geometry.given_normals;
  if (is_flat()) return;
  now_.kernels->normals(std::size_t{in.p.views} * in.p.vertices,
                        kernel::normals_forward{.p = in.p,
                                                .faces = in.geometry.face_vertices,
                                                .corner_starts = in.geometry.vertex_corners.starts,
                                                .corners = in.geometry.vertex_corners.corners,
                                                .world = in.transform.world});
  if (given.empty()) return;
  now_.kernels->normals(in.p.views * given.count, kernel::normals_given_forward{.p = in.p,
                                                                                .models = in.views.models,
                                                                                .values = given.values,
                                                                                .given_mesh = given.mesh,
                                                                                .places = in.geometry.places,
                                                                                .world = in.transform.world});
}

void Shade::backward(const ShadeInputs& in) {
  const bool is_textured = !in.geometry.textures.empty();
  const Range pairs = in.rasterize.pairs(in.bin);
  const std::size_t unlit = DPR_PAIR_LIT(is_textured), channels = lit() ? unlit + DPR_PAIR_LIT_END : unlit;
  grad_pairs.resize(device_, Length::varying(channels * in.bin.pairs));
  if (lit()) now_.kernels->shade(pairs, kernel::shade_lit_backward::pick(arguments(in)));
  if (is_textured) {
    surface->backward(arguments(in), pairs);
  } else if (!lit()) {
    const PairGroups groups = in.rasterize.pair_groups(in.bin);
    launch_(groups.count, kernel::shade_backward{.p = in.p,
                                                 .range = groups.pairs,
                                                 .pairs = in.bin.pair_count,
                                                 .pair_face = in.bin.pair_face,
                                                 .fragment_starts = in.rasterize.fragment_starts,
                                                 .faces = in.geometry.face_vertices,
                                                 .colors = in.geometry.colors_of(in.p),
                                                 .fragments = in.rasterize.values,
                                                 .grads = in.rasterize.grads,
                                                 .grad_colors = grad_pairs});
  }
}

void Shade::backward_world(const ShadeInputs& in, Gather& gather, Buffer<cl_float4>& grad_world) {
  const std::size_t lit = first_lit_channel();
  gather.per_view(in.p, in.p.vertices, in.bin, in.geometry.vertex_corners,
                  {grad_pairs, (lit + DPR_PAIR_POSITIONS) * in.p.pairs}, grad_world);
  if (is_flat()) return;
  gather.per_view(in.p, in.p.normals, in.bin, in.geometry.normal_corners(),
                  {grad_pairs, (lit + DPR_PAIR_NORMALS) * in.p.pairs}, grad_normals_);
  now_.kernels->normals(std::size_t{in.p.views} * in.p.normals,
                        kernel::normals_backward_normalize{
                            .p = in.p, .world = in.transform.world, .grad_normals = grad_normals_});
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

void Shade::backward_light(const ShadeInputs& in, std::size_t light) {
  now_.params.light = to_uint(light);
  light_channels.resize(device_, light_channel_count() * in.bin.pairs);
  now_.kernels->shade(in.rasterize.pairs(in.bin), kernel::shade_lit_backward_lights::pick(arguments(in)));
}

void Shade::tangent_of_normals(const ShadeInputs& in, Tangents& tangents) {
  const GivenNormals& given = in.geometry.given_normals;
  if (is_flat()) return;
  now_.kernels->normals(std::size_t{in.p.views} * in.p.vertices,
                        kernel::normals_tangent{.p = in.p,
                                                .q = tangents.params,
                                                .faces = in.geometry.face_vertices,
                                                .corner_starts = in.geometry.vertex_corners.starts,
                                                .corners = in.geometry.vertex_corners.corners,
                                                .world = in.transform.world,
                                                .vertex_mesh = in.geometry.vertex_mesh,
                                                .model_tangents = tangents.models,
                                                .tangents = tangents.world});
  if (given.empty()) return;
  now_.kernels->normals(in.p.views * given.count,
                        kernel::normals_given_tangent{.p = in.p,
                                                      .q = tangents.params,
                                                      .given_mesh = given.mesh,
                                                      .model_tangents = tangents.models,
                                                      .world = in.transform.world,
                                                      .tangents = tangents.world});
}

void Shade::tangent(const ShadeInputs& in, Tangents& tangents) {
  const bool is_textured = !in.geometry.textures.empty();
  const Range pairs = in.rasterize.pairs(in.bin);
  const SurfaceTangentArguments all = arguments(in, tangents);
  if (is_textured) {
    surface->tangent(all, pairs);
  } else if (!lit() || tangents.params.colors != 0) {
    interpolate_tangent(in, in.p, {in.geometry.face_vertices, in.geometry.colors_of(in.p)}, tangents.params,
                        tangents);
  }
  if (!lit()) return;
  if (!now_.kernels->tangent) now_.kernels->tangent.emplace(device_, shading_options(now_.kernels->model));
  (*now_.kernels->tangent)(pairs, kernel::shade_lit_tangent::pick(all));
}

void Shade::tangent(const ShadeInputs& in, const CornerVectors& vectors, Tangents& tangents) {
  shared::TangentParams still = tangents.params;
  still.colors = 0;
  interpolate_tangent(in, showing_vectors(in.p), vectors, still, tangents);
}

void Shade::interpolate_tangent(const ShadeInputs& in, const shared::FrameParams& p,
                                const CornerVectors& colors, const shared::TangentParams& q,
                                Tangents& tangents) {
  const PairGroups groups = in.rasterize.pair_groups(in.bin);
  launch_(groups.count, kernel::shade_tangent{.p = p,
                                              .range = groups.pairs,
                                              .q = q,
                                              .pairs = in.bin.pair_count,
                                              .pair_face = in.bin.pair_face,
                                              .fragment_starts = in.rasterize.fragment_starts,
                                              .faces = colors.faces,
                                              .colors = colors.values,
                                              .color_tangents = tangents.colors,
                                              .fragments = in.rasterize.values,
                                              .tangents = tangents.fragments});
}

std::size_t Shade::bytes() const {
  return now_.lights.capacity_bytes() + grad_normals_.capacity_bytes() + grad_given_normals.capacity_bytes() +
         (surface ? surface->bytes() : 0) + grad_pairs.capacity_bytes() + normal_channels.capacity_bytes() +
         light_channels.capacity_bytes();
}

}  // namespace dpr
