// The setters of the renderer: each prepares everything that can fail, then swaps it in.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "renderer/renderer_impl.hpp"
#include "renderer/setter_checks.hpp"
#include "scene/scene_parts.hpp"
#include "scene/see_through.hpp"
#include "smoothing/priors.hpp"

namespace dpr {
namespace {

// Without these the second half of a setter could fail.
static_assert(std::is_nothrow_swappable_v<Scene> && std::is_nothrow_swappable_v<ViewSet> &&
              std::is_nothrow_swappable_v<ClipPlanes>);
static_assert(std::is_nothrow_move_constructible_v<Geometry> && std::is_nothrow_move_assignable_v<Geometry>);

/// A row of an affine matrix: linear part and translation.
cl_float4 matrix_row(const glm::mat4& m, int row) { return {{m[0][row], m[1][row], m[2][row], m[3][row]}}; }

void set_distortion(shared::ViewParams& v, const Distortion& d) {
  const double radius = largest_radius(d);
  v.distorts = d.model == LensModel::fisheye ? DPR_FISHEYE : DPR_BROWN;
  v.radial[0] = d.k1;
  v.radial[1] = d.k2;
  v.radial[2] = d.k3;
  v.radial[3] = d.k4;
  v.largest_radius2 = static_cast<float>(radius * radius);
  v.tangential[0] = d.p2;
  v.tangential[1] = -d.p1;
}

shared::ViewParams view_params(const Camera& camera, int width, int height) {
  const Projection projected = projection(camera, width, height);
  const glm::dmat4 to_world = glm::inverse(glm::dmat4(camera.view));
  shared::ViewParams v{};
  for (int row = 0; row < 3; ++row) v.row[row] = matrix_row(camera.view, row);
  v.projection = {{projected.scale.x, projected.scale.y, projected.offset.x, projected.offset.y}};
  v.eye = to_cl(glm::vec3(camera.orthographic_height ? to_world[2] : to_world[3]));
  v.eye.s[3] = camera.orthographic_height ? 0.0F : 1.0F;
  if (camera.distortion) set_distortion(v, *camera.distortion);
  v.znear = camera.znear;
  v.zfar = camera.zfar;
  v.inverse_range = 1.0F / (camera.zfar - camera.znear);
  return v;
}

/// True if distances have no noise.
bool is_sharp(const Smoothing& smoothing) {
  return smoothing.noise == Noise::pixel || smoothing.occupancy_width == OccupancyWidth::zero;
}

/// 0 where distances have no noise: what lies outside a triangle has no part in it then.
float blur_distance(const Smoothing& smoothing) {
  if (is_sharp(smoothing)) return 0;
  const float radius = blur_radius(smoothing);
  return smoothing.distance == DistanceMetric::euclidean ? radius : std::sqrt(radius);
}

/// Normalised depth behind a triangle from where on nothing is seen. Infinite where distances have noise:
/// then triangles are not opaque.
float depth_of_hidden(const Smoothing& smoothing) {
  if (!is_sharp(smoothing)) return std::numeric_limits<float>::infinity();
  return smoothing.gamma * static_cast<float>(row_of(smoothing.depth_prior).hidden_behind);
}

/// NDC are the frame's own: the raster has the same middle, and reaches beyond them.
void set_raster(shared::FrameParams& p, const Scene& scene, const Raster& raster) noexcept {
  p.width = static_cast<cl_uint>(samples_of_side(scene.width, raster));
  p.height = static_cast<cl_uint>(samples_of_side(scene.height, raster));
  p.tiles_x = (p.width + DPR_TILE - 1) / DPR_TILE;
  p.tiles_y = (p.height + DPR_TILE - 1) / DPR_TILE;
  p.pixel_size = 2.0F / static_cast<float>(std::min(scene.width, scene.height) * raster.supersampling);
}

/// Orientation of culled faces; 0: no culling. Front faces wind counter-clockwise.
float culled_orientation(Cull cull) noexcept {
  if (cull == Cull::none) return 0;
  return cull == Cull::front ? 1.0F : -1.0F;
}

shared::FrameParams frame_params(const Scene& scene, const Geometry& geometry, std::span<const View> views,
                                 std::size_t first_view, const Raster& raster) {
  const auto distorts = [](const View& view) { return view.camera.distortion.has_value(); };
  shared::FrameParams p{};
  p.views = static_cast<cl_uint>(views.size());
  p.first_view = static_cast<cl_uint>(first_view);
  p.meshes = static_cast<cl_uint>(scene.meshes.size());
  p.vertices = static_cast<cl_uint>(geometry.vertices);
  p.faces = static_cast<cl_uint>(geometry.faces);
  p.own_faces = geometry.has_own_faces() ? 1 : 0;
  set_raster(p, scene, raster);
  p.euclidean = scene.smoothing.distance == DistanceMetric::euclidean ? 1 : 0;
  p.blur_distance = blur_distance(scene.smoothing);
  p.orthographic = views.front().camera.orthographic_height ? 1 : 0;  // all are, or none
  p.distorts = std::ranges::any_of(views, distorts) ? 1 : 0;
  p.perspective_correct = scene.perspective_correct && p.orthographic == 0 ? 1 : 0;
  p.sharp = is_sharp(scene.smoothing) ? 1 : 0;
  p.culled = culled_orientation(scene.cull);
  p.normals = static_cast<cl_uint>(geometry.normals());
  p.color_faces = to_uint(geometry.color_faces);
  p.normal_faces = to_uint(geometry.normal_faces);
  p.texcoord_faces = to_uint(geometry.texcoord_faces);
  p.opacity_faces = to_uint(geometry.opacity_faces);
  p.texels = to_uint(geometry.textures.texels);
  p.levels = geometry.textures.has_pyramids() ? 2 : 1;
  return p;
}

void check_frame_size(const Scene& scene, std::size_t views, std::size_t first_view,
                      std::size_t views_of_faces) {
  // The noise of a view is named by its number, in what the counter has left for it.
  constexpr std::size_t k_most_numbered = std::size_t{1} << 30U;
  if (views > most_views(scene, {}, views_of_faces)) {
    throw InvalidArgument("views (frame)", std::to_string(views),
                          "fewer, so that pixels and vertices can be counted");
  }
  if (first_view > k_most_numbered - views) {
    throw InvalidArgument("first_view (Renderer::set_views)", std::to_string(first_view),
                          "at most " + std::to_string(k_most_numbered - views));
  }
}

/// Throws InvalidArgument for a raster whose samples cannot be counted, or named by two 16-bit numbers.
void check_raster(const Scene& scene, std::size_t views, const Raster& raster, std::size_t views_of_faces) {
  constexpr std::size_t k_most_on_side = 1U << 15U;
  const std::size_t width = samples_of_side(scene.width, raster),
                    height = samples_of_side(scene.height, raster);
  if (raster.margin == 0 && raster.supersampling == 1) return;  // the frame itself
  if (std::max(width, height) <= k_most_on_side && views <= most_views(scene, raster, views_of_faces)) return;
  throw InvalidArgument("sigma and supersampling (smoothing)",
                        "a raster of " + std::to_string(width) + "x" + std::to_string(height) + " samples",
                        "smaller ones: at most " + std::to_string(k_most_on_side) +
                            " a side, and fewer than 2^32 / " + std::to_string(DPR_PIXEL_CHANNELS) +
                            " in all views");
}

/// Smoothing of the stages before the blur with noise of the pixel: distances have no noise.
Smoothing without_distance_noise(Smoothing smoothing) {
  smoothing.occupancy_width = OccupancyWidth::zero;
  smoothing.occupancy_prior = Prior::gaussian;  // has no part in it
  smoothing.occupancy_estimator = Estimator::exact;
  smoothing.sigma = 0;
  return smoothing;
}

}  // namespace

std::size_t ViewSet::bytes() const {
  return device_views.cameras.capacity_bytes() + device_views.models.capacity_bytes() +
         device_views.vertex_starts.capacity_bytes() + view_normal_starts.capacity_bytes();
}

void Renderer::Impl::set_scene(const Scene& wanted, std::size_t views_of_faces) {
  const View view = own_view(wanted);
  check_frame_size(wanted, 1, 0, views_of_faces);
  Scene new_scene = wanted;
  Geometry new_geometry(impl_of(device), wanted, views_of_faces);
  ClipPlanes new_clip_planes(wanted.meshes.size());
  if (is_textured(wanted)) {
    shade.make_surface();
    if (!texels) texels.emplace(impl_of(device));
  }
  if (new_geometry.textures.has_opacities() && !texel_opacities) texel_opacities.emplace(impl_of(device));
  Shade::Lighting lighting = shade.prepare(span_of(wanted.lights), is_textured(wanted));
  SmoothingSetting smoothing = prepare(wanted.smoothing, wanted, 1, views_of_faces);
  fill(spare_views_, wanted, new_geometry, std::span(&view, 1), 0);

  std::swap(scene, new_scene);
  is_see_through = dpr::is_see_through(scene);
  has_device_opacities = false;
  geometry = std::move(new_geometry);
  shade.set(std::move(lighting));
  set(spare_views_);
  set(std::move(smoothing));
  std::swap(clip_planes, new_clip_planes);
  last_counts.reset();
  reserved.reset();
  if (pixel_noise) pixel_noise->edges.reset();
  corner_texcoords.reset();
  shown_normals.reset();
}

void Renderer::Impl::set_views(std::span<const View> new_views, std::size_t first_view) {
  check_frame_size(scene, new_views.size(), first_view, geometry->views_of_faces);
  check_raster(scene, new_views.size(), raster, geometry->views_of_faces);
  fill(spare_views_, scene, *geometry, new_views, first_view);
  set(spare_views_);
}

void Renderer::Impl::set_views(std::span<const View> new_views, std::size_t first_view,
                               const Smoothing& smoothing, const std::optional<Lights>& lights) {
  check_frame_size(scene, new_views.size(), first_view, geometry->views_of_faces);
  std::optional<Lights> new_lights = lights;
  Shade::Lighting lighting = shade.prepare(span_of(lights), is_textured(scene));
  SmoothingSetting new_smoothing = prepare(smoothing, scene, new_views.size(), geometry->views_of_faces);
  fill(spare_views_, scene, *geometry, new_views, first_view);

  std::swap(scene.lights, new_lights);
  shade.set(std::move(lighting));
  set(spare_views_);
  set(std::move(new_smoothing));
}

void Renderer::Impl::fill(ViewSet& prepared, const Scene& of, const Geometry& its,
                          std::span<const View> its_views, std::size_t first_view) const {
  std::vector<shared::ViewParams> cameras;
  std::vector<cl_float4> models;
  std::vector<cl_uint> starts{0}, normal_starts{0};
  for (const View& view : its_views) {
    cameras.push_back(view_params(view.camera, of.width, of.height));
    for (std::size_t m = 0; m < view.transforms.size(); ++m) {
      for (int row = 0; row < 3; ++row) models.push_back(matrix_row(view.transforms[m], row));
      starts.push_back(starts.back() + static_cast<cl_uint>(its.meshes[m].vertices));
      normal_starts.push_back(normal_starts.back() + static_cast<cl_uint>(its.meshes[m].normals));
    }
  }
  prepared.frame = frame_params(of, its, its_views, first_view, raster);
  prepared.has_device_poses = prepared.has_device_cameras = false;
  prepared.views.assign(its_views.begin(), its_views.end());
  prepared.device_views.cameras.upload(impl_of(device), cameras);
  prepared.device_views.models.upload(impl_of(device), models);
  prepared.device_views.vertex_starts.upload(impl_of(device), starts);
  prepared.view_normal_starts.upload(impl_of(device), normal_starts);
}

void Renderer::Impl::set(ViewSet& prepared) noexcept {
  if (prepared.frame.views != frame.views) last_counts.reset();
  has_moved = has_moved || prepared.frame.position_stride != frame.position_stride;
  gradient_map.reset();
  std::swap(static_cast<ViewSet&>(*this), prepared);
  clip_planes.set_boxes_of_views({});
  rendered = false;
}

SmoothingSetting Renderer::Impl::prepare(const Smoothing& smoothing, const Scene& of, std::size_t its_views,
                                         std::size_t views_of_faces) const {
  if (smoothing.noise == Noise::triangle) {
    return {smoothing,
            occupancy.prepare(smoothing),
            aggregate.prepare(smoothing),
            blur_distance(smoothing),
            {},
            nullptr,
            {},
            nullptr};
  }
  BlurKernel kernel = pixel_blur(smoothing, of);
  const Raster around{kernel.supersampling, kernel.margin};
  check_raster(of, its_views, around, views_of_faces);
  const std::shared_ptr<PixelNoise> stages =
      pixel_noise ? pixel_noise : std::make_shared<PixelNoise>(impl_of(device));
  std::shared_ptr<BlurSampled> sampled;
  if (smoothing.occupancy_estimator == Estimator::monte_carlo) {
    sampled = std::make_shared<BlurSampled>(impl_of(device), smoothing, pixel_shifts(smoothing, of), kernel);
  }
  Blur::Setting blur = stages->blur.prepare(std::move(kernel));
  const Smoothing rigid = without_distance_noise(smoothing);
  return {smoothing, occupancy.prepare(rigid), aggregate.prepare(rigid), 0.0F, around,
          stages,    std::move(blur),          std::move(sampled)};
}

void Renderer::Impl::set(SmoothingSetting&& prepared) noexcept {
  scene.smoothing = prepared.smoothing;
  frame.euclidean = scene.smoothing.distance == DistanceMetric::euclidean ? 1 : 0;
  frame.blur_distance = prepared.blur_distance;
  frame.sharp = is_sharp(scene.smoothing) ? 1 : 0;
  hidden_reach = depth_of_hidden(scene.smoothing);
  raster = prepared.raster;
  set_raster(frame, scene, raster);
  gradient_map.reset();
  if ((pixel_noise != nullptr) != (prepared.pixel_noise != nullptr)) last_counts.reset();
  std::swap(pixel_noise, prepared.pixel_noise);
  if (pixel_noise) {
    pixel_noise->blur.set(std::move(prepared.blur));
    pixel_noise->sampled = std::move(prepared.blur_sampled);
  }
  occupancy.set(std::move(prepared.occupancy));
  aggregate.set(std::move(prepared.aggregate));
  rendered = false;
}

void Renderer::Impl::set_shapes(std::span<const glm::vec3> positions, std::span<const glm::vec3> colors) {
  spare_view_positions_.resize(impl_of(device), positions.size());
  spare_view_colors_.resize(impl_of(device), colors.size());
  write_range(impl_of(device), spare_view_positions_, 0, to_cl(positions));
  write_range(impl_of(device), spare_view_colors_, 0, to_cl(colors));
  std::vector<BoxCorners> boxes = ClipPlanes::boxes_of(positions, *geometry);
  shape_positions_.reserve(positions.size());

  std::swap(geometry->view_positions, spare_view_positions_);
  std::swap(geometry->view_colors, spare_view_colors_);
  clip_planes.set_boxes_of_views(std::move(boxes));
  shape_positions_.assign(positions.begin(), positions.end());
  shape_windings_.clear();
  frame.position_stride = positions.empty() ? 0 : static_cast<cl_uint>(geometry->position_count);
  frame.color_stride = colors.empty() ? 0 : static_cast<cl_uint>(geometry->colors);
  has_moved = true;
  rendered = false;
}

void Renderer::Impl::set_lights(std::span<const Lights> lights) {
  std::optional<Lights> new_lights;
  if (!lights.empty()) new_lights = lights.front();
  shade.set(shade.prepare(lights, is_textured(scene)));
  std::swap(scene.lights, new_lights);
  gradient_map.reset();
  rendered = false;
}

void Renderer::Impl::set_layers(cl_uint count) noexcept {
  layers = count;
  rendered = false;
}

void Renderer::Impl::set_cull(Cull cull) noexcept {
  scene.cull = cull;
  frame.culled = culled_orientation(cull);
  rendered = false;
}

}  // namespace dpr
