// The pipeline: the stages in order, then in reverse.
#include "dpr/renderer.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "dpr/error.hpp"
#include "renderer/frame.hpp"
#include "renderer/renderer_impl.hpp"
#include "scene/see_through.hpp"

namespace dpr {
namespace {

/// Gradients that come by way of the vertices.
bool is_geometric(const GradientRequest& wanted) {
  return wanted.positions || wanted.transform || wanted.camera || wanted.distortion || wanted.normals;
}

}  // namespace

std::uint64_t next_frame_number() {
  static std::atomic<std::uint64_t> frames_rendered = 0;
  return ++frames_rendered;
}

Renderer::Impl::Impl(Device device_)
    : OnDevice{std::move(device_)},
      transform(impl_of(device)),
      setup(impl_of(device)),
      clip(impl_of(device)),
      bin(impl_of(device)),
      rasterize(impl_of(device)),
      shade(impl_of(device)),
      occupancy(impl_of(device)),
      opacity(impl_of(device)),
      aggregate(impl_of(device)),
      gather(impl_of(device)),
      reduce(impl_of(device)) {}

void Renderer::Impl::require_scene(const char* caller) const {
  if (!geometry) throw InvalidArgument(std::string(caller), "no scene", "set_scene() first");
}

void Renderer::Impl::require_rendered(const char* caller) const {
  if (!rendered)
    throw InvalidArgument(std::string(caller), "no image of the current scene", "forward() first");
}

void Renderer::Impl::require_forward(const char* caller) {
  require_rendered(caller);
  settle();
}

void Renderer::Impl::forward(FrameSizes sizes) {
  require_scene("Renderer::forward");
  if (is_see_through || wants_opacities()) require_sees_through(scene.smoothing);
  rendered = false;
  build_pyramids();
  transform.forward(frame, device_views, *geometry, shade.lit());
  if (geometry_colors) geometry_colors->forward(frame, *geometry, transform, geometry->view_colors);
  find_edges();
  set_up();
  capacity.reset();
  const FrameNote note = sizes == FrameSizes::kept ? learn() : FrameNote();
  if (note.emptied == 0) capacity = expected_capacity();
  if (capacity) {
    forward_within(*capacity, sizes);
  } else {
    const FrameCounts before = last_counts.value_or(FrameCounts());
    forward_measured();
    if (sizes == FrameSizes::kept) expect(before);
  }
  rendered = true;
  frame_number = next_frame_number();
}

void Renderer::Impl::build_pyramids() {
  Textures& textures = geometry->textures;
  if (textures.has_levels || textures.empty()) return;
  texels->build(textures, textures.texel_values);
  if (textures.has_opacities()) texel_opacities->build(textures, textures.opacities);
  textures.has_levels = true;
}

void Renderer::Impl::set_up() {
  opacity.set_params(scene.smoothing, follows_opacities_ || wants_opacities(),
                     geometry->textures.has_opacities());
  hide_back_faces();
  frame.has_base = shade.lit() && !geometry->textures.empty() ? 1 : 0;
  frame.clips = has_device_poses || clip_planes.may_be_crossed(scene, views) ? 1 : 0;
  if (pixel_noise) {
    set_edges(frame, *pixel_noise->edges, scene.lights ? std::optional(scene.lights->shading) : std::nullopt,
              depth_reach(scene.smoothing));
    if (shown_normals) frame.shading = DPR_BESIDE_NORMALS;
  }
  rasterize.clip = frame.clips != 0 ? &clip : nullptr;
  rasterize.hiding.reset();
  if (std::isfinite(hidden_reach) && layers == 1 && !sees_through())
    rasterize.hiding.emplace(hidden_reach, device_views.cameras);
  const Buffer<float>& hidden = hides_by_device_ ? setup.hide(frame, hidden_) : hidden_;
  setup.forward(frame, device_views, *geometry, transform.ndc, hidden, bin.pair_starts);
  if (frame.clips != 0) clip.forward(frame, device_views, *geometry, transform, setup, bin.pair_starts);
  bin.start();
}

/// None where the frame may have to be cut into bands: for that its sizes must be known.
std::optional<FrameCounts> Renderer::Impl::expected_capacity() const {
  if (!last_counts && !reserved) return std::nullopt;
  const FrameCounts counts = larger(last_counts.value_or(FrameCounts()), reserved.value_or(FrameCounts()));
  if (!cut_samples().empty()) return std::nullopt;
  const FrameCounts expected{std::min(with_headroom(counts.pairs), k_most_pairs),
                             with_headroom(counts.fragments), with_headroom(counts.contours)};
  if (with_headroom(expected.fragments) * fragment_bytes() >= fragment_budget()) return std::nullopt;
  return expected;
}

/// Counts that kernels are launched for: those of the last known frame, within the room. Work-items take more
/// where there are more; those without any would leave a CPU's last threads idle.
FrameCounts Renderer::Impl::likely_counts(const FrameCounts& room) const {
  if (!known_counts) return room;
  const auto likely = [](std::size_t known, std::size_t most) {
    return std::min(std::max<std::size_t>(known, 1), most);
  };
  return {likely(known_counts->pairs, room.pairs), likely(known_counts->fragments, room.fragments),
          likely(known_counts->contours, room.contours)};
}

ContourInputs Renderer::Impl::contour_inputs() const {
  const bool shows_normals = shown_normals.has_value();
  return {frame,
          device_views,
          *geometry,
          *pixel_noise->edges,
          transform,
          setup.facing,
          clip.faces,
          shows_normals ? shown_normals->faces : geometry->face_vertices,
          shows_normals ? shown_normals->values : geometry->color_values};
}

Blur::Size Renderer::Impl::image_size() const {
  return {views.size(), static_cast<std::size_t>(scene.width), static_cast<std::size_t>(scene.height)};
}

/// Finds the contours of noise on the pixel, within the capacity for what is expected, or blocks to count.
void Renderer::Impl::find_contours(const std::optional<FrameCounts>& expected) {
  if (!pixel_noise) return;
  Contour& contour = pixel_noise->contour;
  if (expected) {
    contour.forward_within(contour_inputs(), expected->contours, likely_counts(*expected).contours);
  } else {
    contour.forward(contour_inputs());
  }
}

/// From samples to pixels, once all bands are rendered.
void Renderer::Impl::finish_image() {
  if (!pixel_noise) return;
  pixel_noise->prepare(contour_inputs(), image_size(), bin.tile_starts);
  if (shown_normals) blend_normals();
  if (!defers_image()) pixel_noise->forward(contour_inputs(), aggregate.image, image_size());
  seen_layers_ = front_layers();
  resolved_ = 0;
}

void Renderer::Impl::forward_within(const FrameCounts& expected, FrameSizes sizes) {
  const FrameCounts likely = likely_counts(expected);
  find_contours(expected);
  bin.forward(frame, setup, expected.pairs, likely.pairs);
  std::optional<ContourCount> contours;
  if (pixel_noise) {
    Contour& contour = pixel_noise->contour;
    contours.emplace(contour.pair_starts.size() - 1, contour.pair_starts);
  }
  rasterize.forward_within(expected, likely.fragments, frame, setup.triangles, bin, contours,
                           sizes == FrameSizes::read);
  bands = {*rasterize.band};
  sample_bands.clear();
  shade_and_aggregate();
  finish_image();
}

void Renderer::Impl::forward_measured(bool is_whole) {
  last_counts.reset();
  sample_bands = is_whole || defers_image() ? std::vector<Range>() : cut_samples();
  find_contours(std::nullopt);
  bin.forward(frame, setup);
  rasterize.cover(frame, setup.triangles, bin, sample_bands.empty());
  if (!sample_bands.empty()) return forward_in_bands();
  bands = rasterize.cut(frame, bin, tile_rows_of(frame), fragment_budget(), fragment_bytes());
  Rasterize::require_fits(bands, fragment_budget(), fragment_bytes());
  for (const Band& band : bands) render(band);
  finish_image();
  if (bands.size() > 1) return;
  last_counts = rasterize.counted();
  if (pixel_noise) last_counts->contours = pixel_noise->contour.pairs;
  known_counts = last_counts;
}

/// What has arrived of earlier frames' counts, without waiting. Those of a scene before count for nothing.
FrameNote Renderer::Impl::learn() {
  if (!last_counts) rasterize.disown_notes();
  const FrameNote note = rasterize.poll_notes();
  if (reserved && !last_counts) last_counts.emplace();  // from here on notes are this scene's
  // Buffers are kept while most of their headroom is left.
  const auto with_least_room = [](std::size_t count) { return count + count * 3 / 16; };
  const FrameCounts& found = note.counts;
  const FrameCounts wanted{with_least_room(found.pairs), with_least_room(found.fragments),
                           with_least_room(found.contours)};
  const std::optional<FrameCounts> room = expected_capacity();
  if (!room || !wanted.fit(*room)) expect(found);
  if (found.pairs > 0) known_counts = found;
  found_emptied_ += note.emptied;
  return note;
}

void Renderer::Impl::reserve(const FrameCounts& counts) {
  reserved = larger(reserved.value_or(FrameCounts()), counts);
}

void Renderer::Impl::expect(const FrameCounts& counts) {
  if (last_counts || reserved) last_counts = larger(last_counts.value_or(FrameCounts()), counts);
}

/// Learns whether the frame has exceeded the capacity of its buffers, and renders it again if so.
void Renderer::Impl::settle() {
  if (!capacity) return;
  const FrameCounts found = rasterize.read_counts();
  const bool fits = found.fit(*capacity);
  capacity.reset();
  if (fits) {
    bin.settle(found.pairs);
    bands = {rasterize.settle(frame, found)};
    known_counts = last_counts = found;
    if (pixel_noise) pixel_noise->contour.settle(found.contours);
    return;
  }
  render_again();
  aov_frame = 0;
}

void Renderer::Impl::require_whole() {
  if (!sample_bands.empty()) render_again(/*is_whole*/ true);
}

/// The same frame, whatever its buffers hold.
void Renderer::Impl::render_again(bool is_whole) {
  capacity.reset();
  rendered = false;
  set_up();  // what did not fit has been emptied, runs of pairs among it
  forward_measured(is_whole);
  rendered = true;
}

void Renderer::Impl::render(const Band& band) {
  rasterize.forward(frame, setup.triangles, bin, band);
  shade_and_aggregate();
}

void Renderer::Impl::shade_and_aggregate() {
  if (!defers_image()) {
    if (!aggregate.perturbs_distances()) occupancy.forward(frame, bin, rasterize);
    if (sees_through()) opacity.forward(shade.arguments(shade_inputs()), *geometry, bin, rasterize);
    if (shown_normals) shade_normals();
    shade.forward(shade_inputs());
    aggregate.forward(aggregate_inputs(), scene.background);
  }
  if (!pixel_noise) return;
  pixel_noise->antialias.find_front(frame, bin, rasterize, pixel_noise->contour, front_layers());
  pixel_noise->unblend();
}

Buffer<cl_float4>& Renderer::Impl::room_for_grad_images(std::size_t pixels) {
  if (pixel_noise && sample_bands.empty()) return pixel_noise->room(frame, pixels);
  grad_images_.resize(impl_of(device), pixels);
  return grad_images_;
}

SceneGradient Renderer::Impl::backward(const BufferRef<cl_float4>& grad_images,
                                       const AddToGradient& add_to_positions) {
  enqueue_backward(grad_images, add_to_positions);
  return read_gradient();
}

void Renderer::Impl::backward_on_device(const BufferRef<cl_float4>& grad_images) {
  enqueue_backward(grad_images);
  if (!gradient_map) gradient_map = make_gradient_map();
  made_exchange().map(*gradient_map, gradient_sums_, grad_numbers);
  if (wants(ArrayId::materials)) join_material_gradients();
  device_gradient_frame = frame_number;
}

void Renderer::Impl::enqueue_backward(const BufferRef<cl_float4>& grad_images,
                                      const AddToGradient& add_to_positions) {
  device_gradient_frame = 0;  // its buffers are written again
  const GradientRequest& wanted = scene.gradients;
  if (has_device_cameras && wanted.camera && shade.lit()) {
    throw InvalidArgument("gradient of the camera (backward)",
                          "a lit scene, with view matrices from a buffer",
                          "Renderer::set_views(): the eye's part of it needs their inverses");
  }
  if (wants_opacities()) {
    require_sees_through(scene.smoothing);
    follow_opacities();
  }
  if (!sample_bands.empty()) {
    if (pixel_noise->lacks_image(wanted.smoothing)) render_again();
  } else if (pixel_noise) {
    if (pixel_noise->lacks_raster(wanted.smoothing)) render_again();
    see_layers(front_layers());
    pixel_noise->backward(contour_inputs(), aggregate.image, image_size(), grad_images, wanted.smoothing,
                          bands.size() == 1, aggregate.scratch(frame));
  }
  if (wants(ArrayId::texels)) texels->start(geometry->textures);
  if (wants(ArrayId::texel_opacities)) texel_opacities->start(geometry->textures);
  if (sample_bands.empty()) {
    const BufferRef<cl_float4> grad_raster =
        pixel_noise ? pixel_noise->grad_raster(aggregate.image) : grad_images;
    for (const Band& band : bands) {
      if (bands.size() > 1) render(band);  // other bands' fragments have replaced its own
      differentiate(grad_raster);
    }
  } else {
    differentiate_in_bands(grad_images);
  }
  if (is_geometric(wanted)) {
    gather.per_view(frame, geometry->vertices, bin, geometry->vertex_corners, rasterize.grad_corners,
                    grad_vertices);
    if (frame.clips != 0) {
      gather.per_view(frame, geometry->vertices, bin, geometry->vertex_corners, clip.grad_corners, clip.grad);
    }
    if (pixel_noise)
      pixel_noise->contour.gather(contour_inputs(), pixel_noise->antialias.grad_ends, grad_vertices,
                                  clip.grad);
    if (shade.lit()) shade.backward_world(shade_inputs(), gather, grad_lit);
    if (shade.lit()) shade.backward_given_normals(shade_inputs());
    if (geometry_colors) {
      gather.per_view(frame, geometry->colors, bin, geometry->color_corners(), shade.grad_pairs, grad_colors);
      // The depth of vertices that may lie behind the camera goes the way of homogeneous coordinates.
      geometry_colors->backward(frame, *geometry, transform, grad_colors,
                                frame.clips != 0 ? clip.grad : grad_vertices, grad_lit);
    }
    const bool is_lit = shade.lit() || geometry_colors;
    transform.backward(frame, device_views, is_lit, clip.grad, grad_lit, grad_vertices);
  }
  if (wants(ArrayId::texels)) texels->finish(geometry->textures);
  if (wants(ArrayId::texel_opacities)) texel_opacities->finish(geometry->textures);
  gather_mesh_gradients(add_to_positions);
  sum_gradients();
}

void Renderer::Impl::differentiate(const BufferRef<cl_float4>& grad_images) {
  const GradientRequest& wanted = scene.gradients;
  const bool geometric = is_geometric(wanted);
  aggregate.backward(aggregate_inputs(), scene.background, grad_images, sums_pixels());
  const bool shows_texels = wants(ArrayId::texels) || wants(ArrayId::texcoords);
  const bool fades = sees_through() && (geometric || shows_texels || wanted.smoothing || wants_opacities());
  if (geometric || wanted.colors || wanted.materials || shows_texels ||
      (fades && geometry->textures.has_opacities()))
    shade.backward(shade_inputs());
  if (wants(ArrayId::texels)) {
    shade.list_texels(shade_inputs());
    texels->add(geometry->textures, *shade.surface);
  }
  if (fades) opacity.backward(shade.arguments(shade_inputs()), *geometry, bin, rasterize);
  if (wants(ArrayId::texel_opacities)) {
    opacity.list_texels(shade.arguments(shade_inputs()), *shade.surface, bin, rasterize);
    texel_opacities->add(geometry->textures, *shade.surface);
  }
  // Distances without noise have no gradient, and rasterization does not read one.
  if ((geometric || wanted.smoothing) && !aggregate.perturbs_distances() && !pixel_noise)
    occupancy.backward(frame, bin, rasterize);
  if (geometric) {
    rasterize.backward(frame, setup.triangles, bin);
    if (!geometry->textures.empty())
      shade.backward_detail(shade_inputs(), rasterize.grad_corners, clip.grad_corners);
  }
  if (wanted.lights && shade.lit()) {
    for (std::size_t light = 0; light < shade.light_launches(); ++light)
      shade.backward_light(shade_inputs(), light);
  }
}

void Renderer::forward() { impl_->forward(); }

}  // namespace dpr
