// From what the stages' backward passes left on the device to the gradients on the host.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>

#include "renderer/renderer_impl.hpp"
#include "scene/lens.hpp"
#include "scene/light_table.hpp"
#include "scene/projection_slopes.hpp"

namespace dpr {

using glm::dvec3;

/// Reads parts of joined buffers with one wait. Few rows come as they are; of many the device packs the vectors, which
/// go where they belong.
class RowReads {
 public:
  explicit RowReads(Renderer::Impl& renderer, Buffer<float>& packed)
      : renderer_(renderer), packed_(packed), reads_(impl_of(renderer.device)) {}

  /// All values of a buffer.
  void add(const Buffer<float>& buffer, std::span<float> out) { buffer.download(out, 0, reads_); }
  /// Fills `out`, which is empty, until finish() at the latest.
  template <class Vector>
  void add(const Buffer<cl_float4>& buffer, std::size_t first, std::size_t count, std::vector<Vector>& out) {
    if (count > k_rows_of_piece) return add_packed(buffer, first, count, out);
    if (used_ + count > k_rows_of_piece) finish();
    const std::span<cl_float4> rows(rows_.get() + used_, count);
    buffer.download(rows, first, reads_);
    arrivals_.emplace_back([rows, &out] {
      out.reserve(rows.size());
      for (const cl_float4& v : rows) {
        if constexpr (std::is_same_v<Vector, float>) {
          out.push_back(v.s[0]);
        } else {
          out.emplace_back(glm::vec3(v.s[0], v.s[1], v.s[2]));
        }
      }
    });
    used_ += count;
  }

  void finish() {
    reads_.finish();
    for (const std::function<void()>& take : arrivals_) take();
    arrivals_.clear();
    used_ = 0;
  }

 private:
  template <class Vector>
  void add_packed(const Buffer<cl_float4>& buffer, std::size_t first, std::size_t count,
                  std::vector<Vector>& out) {
    constexpr std::size_t k_components = sizeof(Vector) / sizeof(float);
    out.resize(count);
    packed_.resize(impl_of(renderer_.device), k_components * count);
    renderer_.made_exchange().give(vectors_of(buffer, first, 4), count, vectors_of(packed_, 0, k_components));
    packed_.download({reinterpret_cast<float*>(out.data()), k_components * count}, 0, reads_);
  }

  Renderer::Impl& renderer_;
  Buffer<float>& packed_;  // of one array after the other: the queue is in order
  std::unique_ptr<cl_float4[]> rows_ = std::make_unique_for_overwrite<cl_float4[]>(k_rows_of_piece);
  PendingReads reads_;  // destroyed first, since reads write to the rows
  std::size_t used_ = 0;
  std::vector<std::function<void()>> arrivals_;
};

bool Renderer::Impl::wants(ArrayId id) const {
  const MeshArray& row = row_of(id);
  return scene.gradients.*row.wanted && (!row.is_lit || shade.lit()) &&
         std::ranges::any_of(scene.meshes, row.exists, &Instance::mesh);
}

void Renderer::Impl::gather_mesh_gradients(const AddToGradient& add_to_positions) {
  if (scene.gradients.positions) transform.backward_positions(frame, device_views, *geometry, grad_vertices);
  if (add_to_positions) add_to_positions(geometry->positions, transform.grad_positions);
  if (wants(ArrayId::colors) && frame.color_stride != 0) {
    gather.per_view(frame, geometry->colors, bin, geometry->color_corners(), shade.grad_pairs, grad_colors);
  } else if (wants(ArrayId::colors)) {
    gather.over_views(frame, geometry->colors, bin, geometry->color_corners(), shade.grad_pairs, grad_colors);
  }
  if (wants(ArrayId::texcoords)) {
    gather.over_views(frame, geometry->textures.texcoords, bin, geometry->textures.texcoord_corners,
                      {shade.grad_pairs, DPR_PAIR_TEXCOORDS * bin.pairs}, grad_texcoords);
  }
  if (wants(ArrayId::opacities))
    gather.over_views(frame, geometry->opacities.values.size(), bin, geometry->opacities.corners,
                      opacity.grad_pairs, grad_opacities);
  if (wants(ArrayId::materials))
    gather.over_views(frame, bin, geometry->materials,
                      {shade.grad_pairs, (shade.first_lit_channel() + DPR_PAIR_MATERIAL) * bin.pairs},
                      material_channels);
}

SceneGradient Renderer::Impl::read_gradient() {
  std::vector<float> sums(gradient_sums_.size());
  SceneGradient by_mesh;
  by_mesh.meshes.resize(scene.meshes.size());
  RowReads reads(*this, packed_);
  reads.add(gradient_sums_, sums);
  read_mesh_gradients(by_mesh, reads);
  reads.finish();
  SceneGradient gradient = finish_summed_gradients(sums, std::move(by_mesh));
  require_finite(gradient);
  read_lights_of_views(sums);
  return gradient;
}

void Renderer::Impl::read_lights_of_views(std::span<const float> sums) {
  grad_lights.clear();
  const SumList& list = summed_[SumOf::lights];
  const std::span<const Lights> lights = shade.lights_of_views();
  for (std::size_t view = 0; list.channels > 0 && view < lights.size(); ++view) {
    std::vector<float> own;
    for (std::size_t c = 0; c < list.channels; ++c)
      own.push_back(sums[list.first + c * list.segments + view]);
    read_light_gradients(lights[view], own, grad_lights.emplace_back());
    require_finite(grad_lights.back());
  }
}

std::optional<DeviceGradient> Renderer::Impl::mesh_gradient(const GradientRow& row, std::size_t mesh,
                                                            std::size_t texture) {
  const ArrayRef at{id_of(row.wanted), mesh, texture};
  const MeshArray& array = row_of(at.id);
  const bool of_views = row.of == GradientOf::all_views;
  const bool has_views = array.stride != nullptr && frame.*array.stride != 0;
  if (!wants(at.id) || of_views != has_views) return std::nullopt;
  const Buffer<cl_float4>& values = array.gradient(*this);
  if (of_views) return DeviceGradient{values, 0, values.size()};
  Instance& owner = scene.meshes[mesh];
  if (owner.instance_of || !array.exists(owner.mesh)) return std::nullopt;
  const std::size_t count = count_of(array.host(owner.mesh, texture));
  if (count == 0) return std::nullopt;  // of a texture without opacities
  return DeviceGradient{values, array.first(*geometry, at), count};
}

/// Those of materials come with the sums.
void Renderer::Impl::read_mesh_gradients(SceneGradient& gradient, RowReads& rows) {
  for_each_array(gradient, [&](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    if (is_summed(row) || row.wanted == &GradientRequest::materials) return;
    const auto read = [&](auto& list, std::size_t texture = 0) {
      if (const auto from = mesh_gradient(row, index.item, texture))
        rows.add(from->values, from->first, from->count, list);
    };
    if (auto* const* vectors = std::get_if<std::vector<glm::vec3>*>(&array)) read(**vectors);
    if (auto* const* pairs = std::get_if<std::vector<glm::vec2>*>(&array)) read(**pairs);
    if (auto* const* numbers = std::get_if<std::vector<float>*>(&array)) read(**numbers);
    const auto read_textures = [&](auto* textures) {
      if (scene.gradients.*row.wanted) textures->resize(scene.meshes[index.item].mesh.textures.size());
      for (std::size_t k = 0; k < textures->size(); ++k) read((*textures)[k], k);
    };
    if (auto* const* colors = std::get_if<std::vector<std::vector<glm::vec3>>*>(&array))
      read_textures(*colors);
    if (auto* const* numbers = std::get_if<std::vector<std::vector<float>>*>(&array)) read_textures(*numbers);
  });
}

namespace {

/// From the gradients of the projection's scale and offset to those of the camera's own parameters.
void add_projection_gradient(const std::array<double, 4>& grad, const Camera& camera, int width, int height,
                             CameraGradient& out) {
  const ProjectionSlopes slopes = projection_slopes(camera, width, height);
  out.orthographic_height = (grad[0] + grad[1]) * slopes.by_orthographic_height;
  out.fov_y_degrees = (grad[0] + grad[1]) * slopes.by_fov_y_degrees;
  for (std::size_t k = 0; k < 4; ++k) out.intrinsics[k] = grad[k] * slopes.by_intrinsics[k];
}

/// Sets the derivatives of the coefficients of a camera's lens, which are in the lens' order.
void set_lens(CameraGradient& gradient, const Camera& camera, const std::array<double, 5>& lens) {
  if (is_fisheye(camera)) {
    std::copy_n(lens.begin(), gradient.fisheye.size(), gradient.fisheye.begin());
  } else {
    gradient.distortion = lens;
  }
}

/// The derivatives of poses and cameras, from sums by [DPR_POSE_CHANNELS or DPR_LENS_CHANNELS][view][mesh], and
/// two by [DPR_CUT_CHANNELS][view], or none.
void add_pose_gradients(std::span<const float> sums, const std::array<std::span<const float>, 2>& of_cuts,
                        const Scene& scene, std::span<const View> views, SceneGradient& gradient) {
  const std::size_t meshes = scene.meshes.size(), segments = views.size() * meshes;
  const auto sum = [&](std::size_t channel, std::size_t segment) {
    return static_cast<double>(sums[channel * segments + segment]);
  };
  const auto sum3 = [&](std::size_t channel, std::size_t segment) {
    return dvec3(sum(channel, segment), sum(channel + 1, segment), sum(channel + 2, segment));
  };
  for (std::size_t v = 0; v < views.size(); ++v) {
    CameraGradient camera;
    std::array<double, 4> projected{};
    std::array<double, 5> lens{};
    for (std::size_t m = 0; m < meshes; ++m) {
      const std::size_t segment = v * meshes + m;
      if (scene.gradients.transform) {
        gradient.views[v].transforms[m] = {sum3(DPR_CHANNEL_MODEL, segment),
                                           sum3(DPR_CHANNEL_MODEL + 3, segment)};
      }
      camera.view.rotation += sum3(DPR_CHANNEL_VIEW, segment);
      camera.view.translation += sum3(DPR_CHANNEL_VIEW + 3, segment);
      for (std::size_t k = 0; k < 4; ++k) projected[k] += sum(DPR_CHANNEL_PROJECTION + k, segment);
      for (std::size_t k = 0; k < 5 && views[v].camera.distortion; ++k)
        lens[k] += sum(DPR_CHANNEL_DISTORTION + k, segment);
    }
    for (const std::span<const float> cuts : of_cuts) {
      if (cuts.empty() || !views[v].camera.distortion) continue;
      for (std::size_t k = 0; k < DPR_CUT_CHANNELS; ++k)
        (k < 4 ? projected[k] : lens[k - 4]) += static_cast<double>(cuts[k * views.size() + v]);
    }
    add_projection_gradient(projected, views[v].camera, scene.width, scene.height, camera);
    if (scene.gradients.camera) gradient.views[v].camera = camera;
    if (scene.gradients.distortion) set_lens(gradient.views[v].camera, views[v].camera, lens);
  }
}

/// Adds the normals' turning to the gradients of rotations, from sums by [3][view][mesh].
void add_normal_gradients(std::span<const float> sums, SceneGradient& gradient) {
  const std::size_t meshes = gradient.meshes.size(), segments = gradient.views.size() * meshes;
  for (std::size_t i = 0; i < segments; ++i) {
    gradient.views[i / meshes].transforms[i % meshes].rotation +=
        dvec3(sums[i], sums[segments + i], sums[2 * segments + i]);
  }
}

/// From sums by [DPR_MATERIAL_CHANNELS][material]. Meshes without materials have no gradients of them.
void read_material_gradients(std::span<const float> sums, const Geometry& geometry, const Scene& scene,
                             SceneGradient& gradient) {
  const std::size_t count = geometry.materials.count;
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const std::size_t first = geometry.meshes[m].first_material;
    for (std::size_t i = first; i < first + scene.meshes[m].mesh.materials.size(); ++i) {
      gradient.meshes[m].specular.emplace_back(sums[i], sums[count + i], sums[2 * count + i]);
      gradient.meshes[m].shininess.push_back(sums[3 * count + i]);
    }
  }
}

/// Highlights move with the camera's centre c = -A^-1 t: dc = A^-1 (r x t) for a rotation, -A^-1 dt for a
/// translation. One infinitely far away lies in the direction A^-1 z, which is as if t were -z and fixed.
/// From sums by [3][view].
void add_eye_gradients(std::span<const float> sums, std::span<const View> views, SceneGradient& gradient) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    const dvec3 grad_eye(sums[v], sums[views.size() + v], sums[2 * views.size() + v]);
    const glm::dmat4 view(views[v].camera.view);
    const dvec3 in_camera = glm::transpose(glm::inverse(glm::dmat3(view))) * grad_eye;
    PoseGradient& out = gradient.views[v].camera.view;
    const bool is_distant = views[v].camera.orthographic_height.has_value();
    out.rotation += glm::cross(is_distant ? dvec3(0, 0, -1) : dvec3(view[3]), in_camera);
    if (!is_distant) out.translation -= in_camera;
  }
}

}  // namespace

/// One segment of so many, uploaded anew where they have become more or less.
const Buffer<cl_uint>& Renderer::Impl::Segment::of(Device::Impl& device, std::size_t wanted) {
  if (count != wanted) {
    count = 0;
    starts.upload(device, std::array<cl_uint, 2>{0, static_cast<cl_uint>(wanted)});
    count = wanted;
  }
  return starts;
}

void Renderer::Impl::sum_gradients() {
  const GradientRequest& wanted = scene.gradients;
  const std::size_t pixels = std::size_t{frame.views} * frame.width * frame.height;
  const std::size_t vertices = std::size_t{frame.views} * frame.vertices;
  const std::size_t faces = std::size_t{frame.views} * frame.faces;
  // Every kept face has a tile, and every tile some face: so many pairs, whatever room there is for them.
  const std::size_t pairs = faces + std::size_t{frame.views} * frame.tiles_x * frame.tiles_y;
  const bool poses = wanted.transform || wanted.camera || wanted.distortion;
  const bool cuts = (wanted.camera || wanted.distortion) && frame.clips != 0 && frame.distorts != 0;
  const bool eye = wanted.camera && shade.lit(), lights = wanted.lights && shade.lit();
  const std::size_t light_views = std::max<std::size_t>(shade.lights_of_views().size(), 1);
  const bool normals = wanted.transform && shade.lit() && !geometry->given_normals.empty();
  const auto channels = [](bool is_wanted, std::size_t count) { return is_wanted ? count : 0; };
  // In the sampled joint composition the pixels hold what the pairs hold otherwise.
  const bool scale = wanted.smoothing && pixel_noise != nullptr;
  const std::size_t sigmas = channels(wanted.smoothing && !scale, 1);
  const Buffer<cl_uint>& all_pixels = all_pixels_.of(impl_of(device), pixels);
  const Summation sigma =
      aggregate.perturbs_distances()
          ? Summation{pixels, sigmas, 1, 1, all_pixels, aggregate.grad_sigma}
          : Summation{bin.pairs, sigmas, 1, faces, bin.pair_starts, occupancy.grad_sigma, pairs};
  const std::size_t pixel_channels = channels(sums_pixels(), aggregate.channel_count());
  const Summation of_pixels = sample_bands.empty()
                                  ? Summation{pixels, pixel_channels, 1, 1, all_pixels, aggregate.channels}
                                  : Summation{pixels,
                                              pixel_channels,
                                              1,
                                              1,
                                              all_pixels,
                                              pixel_parts_,
                                              pixels,
                                              0,
                                              Reduce::part_slots(pixels)};
  std::vector<std::pair<SumOf, Summation>> all{
      {SumOf::pixels, of_pixels},
      {SumOf::sigma, sigma},
      {SumOf::poses,
       {vertices, channels(poses, frame.distorts != 0 ? DPR_LENS_CHANNELS : DPR_POSE_CHANNELS),
        views.size() * scene.meshes.size(), 1, device_views.vertex_starts, transform.partial_sums, 0, 0,
        transform.slots}},
      {SumOf::cuts,
       {bin.pairs, channels(cuts, DPR_CUT_CHANNELS), views.size(), frame.faces, bin.pair_starts,
        clip.grad_cuts, pairs}},
      {SumOf::eye,
       {bin.pairs, channels(eye, 3), views.size(), frame.faces, bin.pair_starts, shade.grad_pairs, pairs,
        shade.first_lit_channel() + DPR_PAIR_EYE}},
      {SumOf::lights,
       {bin.pairs, channels(lights, shade.light_channel_count()), light_views, faces / light_views,
        bin.pair_starts, shade.light_channels, pairs}},
      {SumOf::normals,
       {views.size() * geometry->given_normals.count, channels(normals, 3),
        views.size() * scene.meshes.size(), 1, view_normal_starts, shade.normal_channels}},
      {SumOf::materials,
       {geometry->rows(), channels(wants(ArrayId::materials), DPR_MATERIAL_CHANNELS),
        geometry->materials.count, 1, geometry->materials.starts, material_channels}}};
  if (pixel_noise) {
    all.push_back({SumOf::contour_cuts,
                   {vertices, channels(cuts, DPR_CUT_CHANNELS), views.size(), scene.meshes.size(),
                    device_views.vertex_starts, pixel_noise->contour.grad_cuts}});
  }
  if (scale)
    all.push_back(
        {SumOf::scale,
         {views.size(), 1, 1, 1, all_views_.of(impl_of(device), views.size()), pixel_noise->grad_scale()}});
  summed_ = {};
  for (const auto& [of, what] : all) summed_[of] = {summed_.count(), what.channels, what.segments};
  gradient_sums_.resize(impl_of(device), summed_.count());
  for (const auto& [of, what] : all) reduce.add(what, gradient_sums_, summed_[of].first);
}

SceneGradient Renderer::Impl::finish_summed_gradients(std::span<const float> sums,
                                                      SceneGradient gradient) const {
  const GradientRequest& wanted = scene.gradients;
  const auto list = [&](SumOf of) { return sums.subspan(summed_[of].first, summed_[of].count()); };
  gradient.meshes.resize(scene.meshes.size());
  gradient.views.resize(views.size());
  for (ViewGradient& view : gradient.views) view.transforms.resize(scene.meshes.size());
  const std::span<const float> pixel_sums = list(SumOf::pixels);
  if (wanted.smoothing) {
    gradient.gamma = pixel_sums[DPR_CHANNEL_GAMMA];
    if (pixel_sums.size() > DPR_CHANNEL_ALPHA) gradient.alpha = pixel_sums[DPR_CHANNEL_ALPHA];
    const double by_scale =
        pixel_noise ? pixel_scale(scene.smoothing, std::min(scene.width, scene.height)).by_sigma : 1.0;
    gradient.sigma = by_scale * static_cast<double>(list(pixel_noise ? SumOf::scale : SumOf::sigma)[0]);
  }
  if (wanted.background) {
    gradient.background = dvec3(pixel_sums[DPR_CHANNEL_BACKGROUND], pixel_sums[DPR_CHANNEL_BACKGROUND + 1],
                                pixel_sums[DPR_CHANNEL_BACKGROUND + 2]);
  }
  if (!list(SumOf::poses).empty()) {
    add_pose_gradients(list(SumOf::poses), {list(SumOf::cuts), list(SumOf::contour_cuts)}, scene, views,
                       gradient);
  }
  if (!list(SumOf::eye).empty()) add_eye_gradients(list(SumOf::eye), views, gradient);
  if (!list(SumOf::normals).empty()) add_normal_gradients(list(SumOf::normals), gradient);
  if (!list(SumOf::materials).empty())
    read_material_gradients(list(SumOf::materials), *geometry, scene, gradient);
  if (!list(SumOf::lights).empty() && shade.lights_of_views().empty())
    read_light_gradients(*scene.lights, list(SumOf::lights), gradient);
  return gradient;
}

void Renderer::Impl::join_material_gradients() {
  const std::size_t count = geometry->materials.count;
  grad_materials.resize(impl_of(device), count);
  for (std::size_t k = 0; k < DPR_MATERIAL_CHANNELS; ++k) {
    made_exchange().give(vectors_of(gradient_sums_, summed_[SumOf::materials].first + k * count, 1), count,
                         {grad_materials.cl_buffer()(), k, DPR_MATERIAL_CHANNELS, 1});
  }
}

GradientMap Renderer::Impl::make_gradient_map() const {
  return make_map(impl_of(device), summed_, scene.meshes.size(),
                  [this](std::span<const float> sums) { return finish_summed_gradients(sums); });
}

SceneGradient Renderer::Impl::empty_gradient() const {
  return finish_summed_gradients(std::vector<float>(summed_.count()));
}

}  // namespace dpr
