// Noise on the pixel around shading of the caller's own: what the samples show, and images of their colours.
#include <algorithm>
#include <string>
#include <utility>

#include "base/checks.hpp"
#include "base/parallel.hpp"
#include "renderer/renderer_impl.hpp"
#include "renderer/setter_checks.hpp"
#include "scene/gradient_table.hpp"

namespace dpr {
namespace {

/// The scene's request without what depends on the library's own shading, while it lives.
class GeometricRequest {
 public:
  explicit GeometricRequest(GradientRequest& of) : of_(of), whole_(of) {
    of = no_gradients();
    of.positions = whole_.positions;
    of.transform = whole_.transform;
    of.camera = whole_.camera;
    of.distortion = whole_.distortion;
  }
  ~GeometricRequest() { of_ = whole_; }
  GeometricRequest(const GeometricRequest&) = delete;
  GeometricRequest& operator=(const GeometricRequest&) = delete;

 private:
  GradientRequest& of_;
  GradientRequest whole_;
};

constexpr std::size_t k_of_group = 4;  // channels that are smoothed together

/// Four channels of packed vectors, or those that are left, from `first` on.
FloatVectors group_of(const Buffer<float>& packed, std::size_t first, std::size_t channels) {
  return {packed.cl_buffer()(), first, channels, std::min(channels - first, k_of_group)};
}

/// Calls a function while the rasterizer holds the fragments of each band of a frame.
template <class Function>
void for_each_band(Renderer::Impl& m, const Function& function) {
  for (const Band& band : m.bands) {
    if (m.bands.size() > 1) m.rasterize.forward(m.frame, m.setup.triangles, m.bin, band);
    function();
  }
}

}  // namespace

void Renderer::Impl::require_samples(const char* caller) {
  require_forward(caller);
  require_whole();
  if (!pixel_noise)
    throw InvalidArgument(std::string("noise (") + caller + ")", "that of the triangles",
                          "noise on the pixel, as the preset \"pixel\" has it");
  if (is_see_through)
    throw InvalidArgument(std::string("opacities (") + caller + ")", "some below 1",
                          "opaque meshes, and several layers that are blended: the shading is the caller's");
  if (scene.lights || geometry_colors)
    throw InvalidArgument(std::string("lights (") + caller + ")",
                          scene.lights ? "a scene with lights" : "colours by geometry",
                          "none: the shading is the caller's");
}

void Renderer::Impl::require_image() {
  if (!std::exchange(wants_samples_alone, false) || !pixel_noise) return;
  require_forward("image");
  render_again();
}

void Renderer::Impl::require_values(std::span<const float> samples, std::size_t channels) const {
  checks::require_channels(channels, "channels (resolve)");
  checks::require_numbers(samples, channels * views.size() * frame.width * frame.height, "samples (resolve)");
}

void Renderer::Impl::find_samples() {
  if (!surface_samples) surface_samples.emplace(impl_of(device));
  for_each_band(*this, [&] { surface_samples->forward(frame, bin, rasterize, layers); });
}

/// Finds the contours' crossings again, as they are seen through all but the last of so many layers.
void Renderer::Impl::see_layers(cl_uint count) {
  if (count == seen_layers_) return;
  for_each_band(
      *this, [&] { pixel_noise->antialias.find_front(frame, bin, rasterize, pixel_noise->contour, count); });
  pixel_noise->antialias.cross(contour_inputs(), pixel_noise->contour);
  seen_layers_ = count;
  resolved_ = 0;
}

/// From `grad_vertices` and, of clipped faces, `clip.grad` to the host's.
SceneGradient Renderer::Impl::finish_geometric_gradient() {
  transform.backward(frame, device_views, false, clip.grad, grad_lit, grad_vertices);
  gather_mesh_gradients({});
  sum_gradients();
  return read_gradient();
}

SceneGradient Renderer::Impl::samples_backward(const WritePlaces& write) {
  const GeometricRequest request(scene.gradients);
  own_group_.resize(impl_of(device), layers * views.size() * frame.width * frame.height);
  overwrite(own_group_, write);
  if (!surface_samples) surface_samples.emplace(impl_of(device));
  for_each_band(*this, [&] {
    surface_samples->backward(frame, own_group_, layers, rasterize);
    rasterize.backward(frame, setup.triangles, bin);
  });
  gather.per_view(frame, geometry->vertices, bin, geometry->vertex_corners, rasterize.grad_corners,
                  grad_vertices);
  if (frame.clips != 0)
    gather.per_view(frame, geometry->vertices, bin, geometry->vertex_corners, clip.grad_corners, clip.grad);
  if (frame.clips != 0 && frame.distorts != 0) {
    pixel_noise->contour.grad_cuts.resize(impl_of(device), DPR_CUT_CHANNELS * transform.ndc.size());
    pixel_noise->contour.grad_cuts.fill(0);
  }
  return finish_geometric_gradient();
}

bool Renderer::Impl::holds_resolved() const {
  return pixel_noise && resolved_ != 0 && resolved_ == pixel_noise->smoothed();
}

/// Four of the caller's channels at the samples, from `first` on, of values that are packed in `own_samples_`, or the
/// caller's.
void Renderer::Impl::take_group(const SampleValues& samples, std::size_t first) {
  const std::size_t count = views.size() * frame.width * frame.height;
  own_group_.resize(impl_of(device), count);
  if (!samples.numbers) {
    made_exchange().give(group_of(own_samples_, first, samples.channels), count,
                         vectors_of(own_group_, 0, k_of_group));
    return;
  }
  const std::size_t channels = std::min(samples.channels - first, k_of_group);
  overwrite(own_group_, [&](std::span<cl_float4> group) {
    for_each_in_parallel(group.size(), [&](std::size_t i) { group[i] = {}; });
    for_each_in_parallel(samples.numbers->size(), [&](std::size_t i) {
      std::copy_n(&samples.values[i * samples.channels + first], channels, group[(*samples.numbers)[i]].s);
    });
  });
}

/// The gradient of take_group(), in `grad_group_`, to `own_samples_`, or the caller's.
void Renderer::Impl::give_group(const SampleValues& samples, std::size_t first, std::span<float> grad) {
  if (!samples.numbers) {
    made_exchange().give(vectors_of(grad_group_, 0, k_of_group), grad_group_.size(),
                         group_of(own_samples_, first, samples.channels));
    return;
  }
  const std::size_t channels = std::min(samples.channels - first, k_of_group);
  const MappedRead group(grad_group_);
  for_each_in_parallel(samples.numbers->size(), [&](std::size_t i) {
    std::copy_n(group[(*samples.numbers)[i]].s, channels, &grad[i * samples.channels + first]);
  });
}

void Renderer::Impl::resolve(const SampleValues& samples, std::span<float> pixels) {
  see_layers(layers);
  Device::Impl& on = impl_of(device);
  const std::size_t channels = samples.channels, pixel_count = pixels.size() / channels;
  std::optional<LentWrite> write;
  if (!samples.numbers) {
    own_samples_.resize(on, samples.values.size());
    write.emplace(on, own_samples_.cl_buffer(), std::as_bytes(samples.values));
  }
  for (std::size_t first = 0; first < channels; first += k_of_group) {
    take_group(samples, first);
    pixel_noise->smooth(contour_inputs(), own_group_, image_size(), own_image_);
    if (channels == k_of_group) break;
    own_pixels_.resize(on, pixels.size());
    made_exchange().give(vectors_of(own_image_, 0, k_of_group), pixel_count,
                         group_of(own_pixels_, first, channels));
  }
  resolved_ = channels <= k_of_group ? pixel_noise->smoothed() : 0;
  if (channels == k_of_group) {
    own_image_.download({reinterpret_cast<cl_float4*>(pixels.data()), pixel_count});
  } else {
    own_pixels_.download(pixels);
  }
}

SceneGradient Renderer::Impl::resolve_backward(const SampleValues& samples,
                                               std::span<const float> grad_pixels,
                                               std::span<float> grad_samples) {
  see_layers(layers);
  const GeometricRequest request(scene.gradients);
  Device::Impl& on = impl_of(device);
  const std::size_t channels = samples.channels, pixel_count = grad_pixels.size() / channels;
  const std::size_t vertices = views.size() * frame.vertices;
  own_image_.resize(on, pixel_count);
  if (!samples.numbers) own_samples_.resize(on, grad_samples.size());
  std::optional<LentWrite> values, grads;
  if (!samples.numbers && !samples.are_kept)
    values.emplace(on, own_samples_.cl_buffer(), std::as_bytes(samples.values));
  if (channels == k_of_group) {
    grads.emplace(on, own_image_.cl_buffer(), std::as_bytes(grad_pixels));
  } else {
    own_pixels_.resize(on, grad_pixels.size());
    grads.emplace(on, own_pixels_.cl_buffer(), std::as_bytes(grad_pixels));
  }
  SceneGradient total;
  for (std::size_t first = 0; first < channels; first += k_of_group) {
    if (!samples.are_kept) {
      take_group(samples, first);
      pixel_noise->blend(own_group_, frame);
    }
    if (channels != k_of_group)
      made_exchange().give(group_of(own_pixels_, first, channels), pixel_count,
                           vectors_of(own_image_, 0, k_of_group));
    pixel_noise->smooth_backward(contour_inputs(), image_size(), own_image_, grad_group_,
                                 aggregate.scratch(frame));
    give_group(samples, first, grad_samples);
    grad_vertices.resize(on, vertices);
    grad_vertices.fill({});
    if (frame.clips != 0) {
      clip.grad.resize(on, vertices);
      clip.grad.fill({});
      if (frame.distorts != 0) {
        clip.grad_cuts.resize(on, DPR_CUT_CHANNELS * bin.pairs);
        clip.grad_cuts.fill(0);
      }
    }
    pixel_noise->contour.gather(contour_inputs(), pixel_noise->antialias.grad_ends, grad_vertices, clip.grad);
    SceneGradient of_group = finish_geometric_gradient();
    if (first == 0) {
      total = std::move(of_group);
    } else {
      add(total, of_group);
    }
  }
  if (!samples.numbers) own_samples_.download(grad_samples);
  return total;
}

SamplesTangent Renderer::Impl::samples_tangent(std::span<const SceneTangent> directions) {
  const std::size_t samples = layers * views.size() * frame.width * frame.height;
  SamplesTangent found;
  found.barycentrics.reserve(directions.size() * samples);
  found.depths.reserve(directions.size() * samples);
  if (!surface_samples) surface_samples.emplace(impl_of(device));
  cut_for_tangents(tangents_together(directions.size()));
  move_in_groups(directions, [&](std::size_t, std::size_t) {
    for_each_band(*this, [&] {
      rasterize.tangent(frame, setup.triangles, *geometry, bin, tangents);
      surface_samples->tangent(frame, rasterize, layers, tangents);
    });
    for (const cl_float4& place : surface_samples->moved.download()) {
      found.barycentrics.emplace_back(place.s[0], place.s[1]);
      found.depths.push_back(place.s[2]);
    }
  });
  return found;
}

void Renderer::Impl::resolve_tangent(std::span<const float> samples, std::size_t channels,
                                     std::span<const float> sample_tangents,
                                     std::span<const SceneTangent> directions, std::span<float> pixels) {
  see_layers(layers);
  Device::Impl& on = impl_of(device);
  const std::size_t sample_count = samples.size() / channels,
                    of_direction = pixels.size() / directions.size(), pixel_count = of_direction / channels;
  own_samples_.upload(on, samples);
  move_in_groups(directions, [&](std::size_t first_direction, std::size_t count) {
    own_tangents_.upload(on,
                         sample_tangents.subspan(first_direction * samples.size(), count * samples.size()));
    own_pixels_.resize(on, count * of_direction);
    for (std::size_t first = 0; first < channels; first += k_of_group) {
      own_group_.resize(on, sample_count);
      made_exchange().give(group_of(own_samples_, first, channels), sample_count,
                           vectors_of(own_group_, 0, k_of_group));
      pixel_noise->smooth(contour_inputs(), own_group_, image_size(), own_image_);
      own_group_.resize(on, count * sample_count);
      made_exchange().give(group_of(own_tangents_, first, channels), count * sample_count,
                           vectors_of(own_group_, 0, k_of_group));
      pixel_noise->smooth_tangent(contour_inputs(), image_size(), tangents, own_group_, own_image_,
                                  aggregate.scratch(frame));
      made_exchange().give(vectors_of(own_image_, 0, k_of_group), count * pixel_count,
                           group_of(own_pixels_, first, channels));
    }
    own_pixels_.download(pixels.subspan(first_direction * of_direction, count * of_direction));
  });
}

void Renderer::set_layers(int count) {
  check_layers(count, "count (Renderer::set_layers)");
  impl_->set_layers(static_cast<cl_uint>(count));
}

Samples Renderer::samples(bool with_steps) {
  Impl& m = *impl_;
  m.require_samples("Renderer::samples");
  m.find_samples();
  Samples found{static_cast<int>(m.frame.width),
                static_cast<int>(m.frame.height),
                m.raster.supersampling,
                m.raster.margin,
                static_cast<int>(m.layers),
                {},
                {},
                {}};
  {
    const MappedRead faces(m.surface_samples->faces);
    const MappedRead places(m.surface_samples->places);
    found.faces.resize(faces.size());
    found.barycentrics.resize(faces.size());
    found.depths.resize(faces.size());
    for_each_in_parallel(faces.size(), [&](std::size_t i) {
      const cl_float4& place = places[i];
      found.faces[i] = faces[i] == DPR_NO_FACE ? -1 : static_cast<std::int32_t>(faces[i]);
      found.barycentrics[i] = {place.s[0], place.s[1]};
      found.depths[i] = place.s[2];
    });
  }
  if (with_steps) {
    m.surface_samples->find_steps(m.frame, m.setup.triangles, m.clip.faces);
    found.steps.reserve(found.faces.size());
    for (const cl_float4& step : m.surface_samples->steps.download())
      found.steps.emplace_back(step.s[0], step.s[1], step.s[2], step.s[3]);
  }
  return found;
}

SceneGradient Renderer::samples_backward(std::span<const glm::vec2> grad_barycentrics,
                                         std::span<const float> grad_depths) {
  Impl& m = *impl_;
  m.require_samples("Renderer::samples_backward");
  const std::size_t count = m.layers * m.views.size() * m.frame.width * m.frame.height;
  checks::require_numbers(checks::floats_of(grad_barycentrics), 2 * count, "grad_barycentrics");
  checks::require_numbers(grad_depths, count, "grad_depths");
  return m.samples_backward([&](std::span<cl_float4> places) {
    for (std::size_t i = 0; i < count; ++i)
      places[i] = {{grad_barycentrics[i].x, grad_barycentrics[i].y, grad_depths[i], 0}};
  });
}

std::vector<float> Renderer::resolve(std::span<const float> samples, std::size_t channels) {
  Impl& m = *impl_;
  m.require_samples("Renderer::resolve");
  m.require_values(samples, channels);
  std::vector<float> pixels(channels * m.pixel_count());
  m.resolve({samples, channels}, pixels);
  return pixels;
}

ResolveGradient Renderer::resolve_backward(std::span<const float> samples, std::size_t channels,
                                           std::span<const float> grad_pixels) {
  Impl& m = *impl_;
  m.require_samples("Renderer::resolve_backward");
  m.require_values(samples, channels);
  checks::require_numbers(grad_pixels, channels * m.pixel_count(), "grad_pixels (resolve)");
  ResolveGradient found{std::vector<float>(samples.size()), {}};
  found.scene = m.resolve_backward({samples, channels}, grad_pixels, found.samples);
  return found;
}

SamplesTangent Renderer::samples_tangent(std::span<const SceneTangent> directions) {
  Impl& m = *impl_;
  m.require_samples("Renderer::samples_tangent");
  m.require_tangents(directions);
  return m.samples_tangent(directions);
}

std::vector<float> Renderer::resolve_tangent(std::span<const float> samples, std::size_t channels,
                                             std::span<const float> sample_tangents,
                                             std::span<const SceneTangent> directions) {
  Impl& m = *impl_;
  m.require_samples("Renderer::resolve_tangent");
  m.require_values(samples, channels);
  checks::require_numbers(sample_tangents, directions.size() * samples.size(), "sample_tangents (resolve)");
  m.require_tangents(directions);
  if (directions.empty()) return {};
  std::vector<float> pixels(directions.size() * channels * m.pixel_count());
  m.resolve_tangent(samples, channels, sample_tangents, directions, pixels);
  return pixels;
}

}  // namespace dpr
