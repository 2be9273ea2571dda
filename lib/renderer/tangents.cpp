// Forward mode: directions in which the scene changes, and how the images follow.
#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "base/checks.hpp"
#include "renderer/renderer_impl.hpp"
#include "renderer/tangents.hpp"
#include "scene/lens.hpp"
#include "scene/projection_slopes.hpp"
#include "scene/see_through.hpp"

namespace dpr {

bool has_tangent(const GradientRow& row) {
  using Request = GradientRequest;
  constexpr std::array k_known{&Request::positions,  &Request::colors,     &Request::transform,
                               &Request::camera,     &Request::distortion, &Request::smoothing,
                               &Request::background, &Request::opacities};
  return std::ranges::find(k_known, row.wanted) != k_known.end();
}

namespace {

using glm::dmat3;
using glm::dmat4;
using glm::dvec3;

/// Throws InvalidArgument for a list that is neither empty nor as long as it has to be.
void require_length(std::size_t length, std::size_t wanted, const std::string& name) {
  if (length != 0 && length != wanted) {
    throw InvalidArgument("length of " + name + " (tangent)", std::to_string(length),
                          "0 or " + std::to_string(wanted));
  }
}

/// Throws InvalidArgument for a direction that does not suit the scene, or that the images do not follow.
void validate(const SceneTangent& direction, const Scene& scene, std::size_t views, const Geometry& geometry,
              const shared::FrameParams& frame) {
  require_length(direction.meshes.size(), scene.meshes.size(), "meshes");
  require_length(direction.views.size(), views, "views");
  const ShapesGradient& shapes = direction.shapes;
  require_length(shapes.positions.size(), frame.position_stride == 0 ? 0 : views * geometry.position_count,
                 "shapes.positions");
  require_length(shapes.colors.size(), frame.color_stride == 0 ? 0 : views * geometry.colors,
                 "shapes.colors");
  for (std::size_t m = 0; m < direction.meshes.size(); ++m) {
    const MeshGradient& mesh = direction.meshes[m];
    const bool owns = !scene.meshes[m].instance_of;
    const MeshRange& range = geometry.meshes[m];
    const std::string name = "meshes[" + std::to_string(m) + "].";
    require_length(mesh.positions.size(), owns && frame.position_stride == 0 ? range.vertices : 0,
                   name + "positions");
    require_length(mesh.colors.size(), owns && frame.color_stride == 0 ? range.colors : 0, name + "colors");
    const Mesh& own = scene.meshes[m].mesh;
    require_length(mesh.opacities.size(), own.vertex_opacities.size() + own.face_opacities.size(),
                   name + "opacities");
  }
  for (const ViewGradient& view : direction.views)
    require_length(view.transforms.size(), scene.meshes.size(), "transforms");
  SceneTangent copy = direction;
  for_each_array(copy, [](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    transform_numbers(array, [&](double number) {
      const bool known = has_tangent(row);
      if (!std::isfinite(number) || (!known && number != 0)) {
        throw InvalidArgument(name_of(row, index) + " (tangent)", checks::text(number),
                              known ? "a finite number" : "0: images' derivatives by it are not known");
      }
      return number;
    });
  });
}

bool moves_opacities(const SceneTangent& direction) {
  return std::ranges::any_of(direction.meshes, [](const MeshGradient& m) { return !m.opacities.empty(); });
}

cl_float4 float4_of(const dvec3& v) { return to_cl(glm::vec3(v)); }

shared::ViewTangent view_tangent(const CameraGradient& by, const Camera& camera, int width, int height) {
  const ProjectionSlopes slopes = projection_slopes(camera, width, height);
  const double scale =
      slopes.by_orthographic_height * by.orthographic_height + slopes.by_fov_y_degrees * by.fov_y_degrees;
  std::array<double, 4> projection{scale, scale, 0, 0};
  for (std::size_t k = 0; k < 4; ++k) projection[k] += slopes.by_intrinsics[k] * by.intrinsics[k];
  // The camera's centre is -A^-1 t. One infinitely far away lies in the direction A^-1 z, which is as if t
  // were -z and fixed.
  const dmat4 view(camera.view);
  const bool is_distant = camera.orthographic_height.has_value();
  const dvec3 from = is_distant ? dvec3(0, 0, -1) : dvec3(view[3]);
  const dvec3 moved = glm::cross(by.view.rotation, from) - (is_distant ? dvec3(0) : by.view.translation);
  shared::ViewTangent t{};
  t.rotation = float4_of(by.view.rotation);
  t.translation = float4_of(by.view.translation);
  for (std::size_t k = 0; k < 4; ++k) t.projection.s[k] = static_cast<float>(projection[k]);
  const std::span<const double> lens =
      is_fisheye(camera) ? std::span<const double>(by.fisheye) : by.distortion;
  for (std::size_t k = 0; k < lens.size(); ++k) t.lens[k / 4].s[k % 4] = static_cast<float>(lens[k]);
  t.eye = float4_of(glm::inverse(dmat3(view)) * moved);
  return t;
}

/// Arrays of meshes, or those of views' own shapes if there are any, one direction after the other; none if none
/// moves.
/// `first` says where a mesh's begin.
template <class Element>
std::vector<cl_float4> joined(std::span<const SceneTangent> directions, std::size_t count,
                              std::vector<Element> MeshGradient::*of_mesh,
                              std::vector<glm::vec3> ShapesGradient::*of_shapes, const Geometry& geometry,
                              std::size_t MeshRange::*first) {
  const bool any = std::ranges::any_of(directions, [&](const SceneTangent& d) {
    return (of_shapes && !(d.shapes.*of_shapes).empty()) ||
           std::ranges::any_of(d.meshes, [&](const MeshGradient& m) { return !(m.*of_mesh).empty(); });
  });
  std::vector<cl_float4> values(any ? directions.size() * count : 0);
  for (std::size_t d = 0; any && d < directions.size(); ++d) {
    const auto copy = [&](const auto& from, std::size_t begin) {
      for (std::size_t i = 0; i < from.size(); ++i) values[d * count + begin + i] = to_cl(to_vec3(from[i]));
    };
    if (of_shapes) copy(directions[d].shapes.*of_shapes, 0);
    for (std::size_t m = 0; m < directions[d].meshes.size(); ++m)
      copy(directions[d].meshes[m].*of_mesh, geometry.meshes[m].*first);
  }
  return values;
}

}  // namespace

/// Renders the last frame again if its opaque surfaces hide what derivatives by their opacities need.
void Renderer::Impl::follow_opacities() {
  if (opacity.is_bounded()) return;
  follows_opacities_ = true;
  render_again();
  follows_opacities_ = false;
}

void Renderer::Impl::upload_directions(std::span<const SceneTangent> directions) {
  const std::size_t count = directions.size(), meshes = scene.meshes.size();
  std::vector<shared::ViewTangent> of_views(count * views.size());
  std::vector<shared::ModelTangent> of_models(count * views.size() * meshes);
  std::vector<shared::FrameTangent> of_frames(count);
  for (std::size_t d = 0; d < count; ++d) {
    const SceneTangent& by = directions[d];
    of_frames[d] = {float4_of(by.background), static_cast<float>(by.sigma), static_cast<float>(by.gamma),
                    static_cast<float>(by.alpha), 0};
    for (std::size_t v = 0; v < by.views.size(); ++v) {
      const std::size_t view = d * views.size() + v;
      of_views[view] = view_tangent(by.views[v].camera, views[v].camera, scene.width, scene.height);
      for (std::size_t m = 0; m < by.views[v].transforms.size(); ++m) {
        const PoseGradient& pose = by.views[v].transforms[m];
        of_models[view * meshes + m] = {float4_of(pose.rotation), float4_of(pose.translation)};
      }
    }
  }
  const auto upload = [&](const std::vector<cl_float4>& values, Buffer<cl_float4>& buffer) {
    buffer.upload(impl_of(device), values);
    return to_uint(values.size() / count);
  };
  Device::Impl& on = impl_of(device);
  tangents.params.directions = to_uint(count);
  tangents.params.lit = cl_uint{shade.lit() || (geometry_colors && geometry_colors->needs_world())};
  tangents.views.upload(on, of_views);
  tangents.models.upload(on, of_models);
  tangents.frames.upload(on, of_frames);
  const std::size_t shapes = frame.position_stride != 0 ? views.size() : 1,
                    colorings = frame.color_stride != 0 ? views.size() : 1;
  tangents.params.positions =
      upload(joined(directions, shapes * geometry->position_count, &MeshGradient::positions,
                    &ShapesGradient::positions, *geometry, &MeshRange::first_position),
             tangents.positions);
  tangents.params.colors = upload(joined(directions, colorings * geometry->colors, &MeshGradient::colors,
                                         &ShapesGradient::colors, *geometry, &MeshRange::first_color),
                                  tangents.colors);
  upload(joined(directions, geometry->opacities.values.size(), &MeshGradient::opacities, nullptr, *geometry,
                &MeshRange::first_opacity),
         tangents.opacities);
}

void Renderer::Impl::require_tangents(std::span<const SceneTangent> directions) const {
  if (aggregate.is_sampled() || occupancy.is_sampled())
    throw InvalidArgument("tangent", "Monte Carlo", "the exact estimators");
  const auto moves_camera = [](const ViewGradient& view) {
    return view.camera.view.rotation != dvec3(0) || view.camera.view.translation != dvec3(0);
  };
  for (const SceneTangent& direction : directions) {
    validate(direction, scene, views.size(), *geometry, frame);
    if (has_device_cameras && shade.lit() && std::ranges::any_of(direction.views, moves_camera)) {
      throw InvalidArgument("camera (tangent)", "a lit scene, with view matrices from a buffer",
                            "Renderer::set_views(): the eye's part of it needs their inverses");
    }
    if (moves_opacities(direction)) require_sees_through(scene.smoothing);
    if (pixel_noise && direction.sigma != 0)
      throw InvalidArgument("sigma (tangent)", checks::text(direction.sigma), "0 with noise on the pixel");
  }
}

/// Device memory of a direction's numbers but those of fragments.
std::size_t Renderer::Impl::tangent_bytes() const {
  const std::size_t samples = std::size_t{frame.views} * frame.width * frame.height,
                    of_vertices = std::size_t{frame.views} * frame.vertices, shown = shown_normals ? 2 : 1;
  const std::size_t clipped = frame.clips != 0 ? of_vertices + 4 * std::size_t{frame.views} * frame.faces : 0;
  return sizeof(cl_float4) * (2 * of_vertices + clipped + (shade.lit() ? transform.world.size() : 0)) +
         (pixel_noise ? samples * (shown * 2 * sizeof(cl_float4) + Antialias::k_tangent_bytes) : 0);
}

/// Bands whose fragments have memory for tangents along so many directions: the frame's own, or smaller ones.
void Renderer::Impl::cut_for_tangents(std::size_t directions) {
  const std::size_t budget = fragment_budget();
  const std::size_t planes = DPR_TANGENT_PLANES + 3 * std::size_t{frame.has_base};
  const std::size_t bytes =
      2 * directions * (planes * sizeof(float) + sizeof(cl_float4));  // half of the budget
  std::size_t largest = 0;
  for (const Band& band : bands) largest = std::max(largest, band.fragments.count);
  if (largest * bytes <= budget) return;
  if (bands.size() == 1) rasterize.read_rows(frame);
  bands = rasterize.cut(frame, bin, tile_rows_of(frame), budget, std::max(bytes, fragment_bytes()));
}

std::size_t Renderer::Impl::tangents_together(std::size_t directions) const {
  constexpr std::size_t k_most = 16;  // at a time
  const std::size_t fitting = std::max<std::size_t>(device.memory_budget() / 2 / tangent_bytes(), 1);
  return std::min({directions, fitting, k_most});
}

void Renderer::Impl::move_in_groups(std::span<const SceneTangent> directions,
                                    const std::function<void(std::size_t, std::size_t)>& function) {
  const std::size_t together = tangents_together(directions.size());
  for (std::size_t first = 0; first < directions.size(); first += together) {
    const auto group = directions.subspan(first, std::min(together, directions.size() - first));
    upload_directions(group);
    tangents.first = to_uint(first);
    transform.tangent(frame, device_views, *geometry, tangents);
    if (frame.clips != 0) clip.tangent_of_outlines(frame, *geometry, tangents);
    function(first, group.size());
  }
}

void Renderer::Impl::tangent(std::span<const SceneTangent> directions) {
  require_whole();
  if (std::ranges::any_of(directions, moves_opacities)) follow_opacities();
  const std::size_t samples = std::size_t{frame.views} * frame.width * frame.height;
  for (ImageTangents* of : shown_tangents())
    of->images.resize(impl_of(device), directions.size() * image().size());
  cut_for_tangents(tangents_together(directions.size()));
  if (pixel_noise) see_layers(front_layers());
  move_in_groups(directions, [&](std::size_t first, std::size_t count) {
    for (ImageTangents* of : shown_tangents())
      if (pixel_noise) of->rasters.resize(impl_of(device), count * samples);
    if (geometry_colors) geometry_colors->tangent(frame, *geometry, transform, tangents);
    if (shade.lit()) shade.tangent_of_normals(shade_inputs(), tangents);
    for (const Band& band : bands) {
      if (bands.size() > 1) render(band);
      rasterize.tangent(frame, setup.triangles, *geometry, bin, tangents);
      occupancy.tangent(frame, rasterize, tangents);
      if (sees_through())
        opacity.tangent(shade.arguments(shade_inputs(), tangents), *geometry, bin, rasterize,
                        tangents.opacities, shade.surface ? &*shade.surface : nullptr);
      const std::size_t place = pixel_noise ? 0 : first;
      if (shown_normals) move_normals(place);
      shade.tangent(shade_inputs(), tangents);
      aggregate.tangent(aggregate_inputs(), scene.background, tangents, place,
                        pixel_noise ? tangents.shown.rasters : tangents.shown.images);
    }
    if (pixel_noise) smooth_tangents();
  });
}

/// From the tangents of a group's samples to those of its pixels.
void Renderer::Impl::smooth_tangents() {
  const std::size_t count = tangents.params.directions * pixel_count();
  for (ImageTangents* of : shown_tangents()) {
    const bool are_all = of->images.size() == count;
    Buffer<cl_float4>& pixels = are_all ? of->images : of->of_group;
    if (of == &tangents.shown) {
      pixel_noise->tangent(contour_inputs(), image_size(), tangents, of->rasters, pixels,
                           aggregate.scratch(frame));
    } else {
      blend_normal_tangents(pixels);
    }
    if (!are_all) pixels.copy_to(of->images, tangents.first * pixel_count());
  }
}

/// Of colours, and of normals if they are shown too.
std::vector<ImageTangents*> Renderer::Impl::shown_tangents() {
  std::vector<ImageTangents*> all{&tangents.shown};
  if (shown_normals) all.push_back(&shown_normals->tangents);
  return all;
}

std::vector<Image> Renderer::tangent(std::span<const SceneTangent> directions) {
  Impl& m = *impl_;
  m.require_forward("Renderer::tangent");
  m.require_tangents(directions);
  m.tangent(directions);
  std::vector<Image> images(directions.size() * m.views.size(), Image(m.scene.width, m.scene.height));
  PendingReads reads(impl_of(m.device));
  std::size_t first = 0;
  for (Image& image : images) {
    const auto bytes = std::as_writable_bytes(std::span(image.pixels));
    reads.start(m.tangents.shown.images.cl_buffer(), first * sizeof(cl_float4), bytes);
    first += image.pixels.size();
  }
  reads.finish();
  return images;
}

}  // namespace dpr
