// The pipeline: the stages in order, then in reverse.
#include "dpr/renderer.hpp"

#include <array>
#include <atomic>
#include <cmath>

#include "base/checks.hpp"
#include "renderer/renderer_impl.hpp"

namespace dpr {
namespace {

/// A row of an affine matrix: linear part and translation.
cl_float4 matrix_row(const glm::mat4& m, int row) { return {{m[0][row], m[1][row], m[2][row], m[3][row]}}; }

shared::ViewParams view_params(const Camera& camera, int width, int height) {
  const Projection projected = projection(camera, width, height);
  const glm::dmat4 to_world = glm::inverse(glm::dmat4(camera.view));
  shared::ViewParams v{};
  for (int row = 0; row < 3; ++row) v.row[row] = matrix_row(camera.view, row);
  v.projection = {{projected.scale.x, projected.scale.y, projected.offset.x, projected.offset.y}};
  v.eye = to_cl(glm::vec3(to_world[3]));
  v.znear = camera.znear;
  v.zfar = camera.zfar;
  v.inverse_range = 1.0F / (camera.zfar - camera.znear);
  return v;
}

shared::FrameParams frame_params(const Scene& scene, const Geometry& geometry, std::size_t views,
                                 std::size_t first_view) {
  shared::FrameParams p{};
  p.views = static_cast<cl_uint>(views);
  p.first_view = static_cast<cl_uint>(first_view);
  p.meshes = static_cast<cl_uint>(scene.meshes.size());
  p.vertices = static_cast<cl_uint>(geometry.vertices);
  p.faces = static_cast<cl_uint>(geometry.faces);
  p.position_stride = geometry.view_positions.size() != 0 ? p.vertices : 0;
  p.color_stride = geometry.view_colors.size() != 0 ? static_cast<cl_uint>(geometry.colors) : 0;
  p.width = static_cast<cl_uint>(scene.width);
  p.height = static_cast<cl_uint>(scene.height);
  p.tiles_x = (p.width + DPR_TILE - 1) / DPR_TILE;
  p.tiles_y = (p.height + DPR_TILE - 1) / DPR_TILE;
  p.pixel_size = 2.0F / static_cast<float>(std::min(scene.width, scene.height));
  p.euclidean = scene.smoothing.distance == DistanceMetric::euclidean ? 1 : 0;
  const float radius = blur_radius(scene.smoothing);
  p.blur_distance = p.euclidean != 0 ? radius : std::sqrt(radius);
  p.perspective_correct = scene.perspective_correct ? 1 : 0;
  return p;
}

void check_frame_size(const shared::FrameParams& p) {
  // The noise of a view is named by its number, in what the counter has left for it.
  constexpr cl_uint most_views = 1U << 30U;
  if (p.first_view > most_views - p.views) {
    throw InvalidArgument("first_view (Renderer::set_views)", std::to_string(p.first_view),
                          "at most " + std::to_string(most_views - p.views));
  }
  const double largest = 4294967295.0;
  const auto views = static_cast<double>(p.views);
  const double pixels = views * p.width * p.height;
  const double corners = views * std::max(p.vertices * double{DPR_POSE_CHANNELS}, p.faces * 3.0);
  if (std::max(pixels * DPR_PIXEL_CHANNELS, corners) < largest) return;
  throw InvalidArgument("views (frame)", std::to_string(p.views),
                        "fewer, so that pixels and vertices can be counted");
}

/// Gradients that come by way of the vertices.
bool is_geometric(const GradientRequest& wanted) {
  return wanted.positions || wanted.transform || wanted.camera;
}

/// Device memory of a fragment: its share of what a band's stages hold, forward and backward.
constexpr std::size_t k_fragment_bytes = Rasterize::k_fragment_bytes + Shade::k_fragment_bytes +
                                         Occupancy::k_fragment_bytes + Aggregate::k_fragment_bytes;

/// Frames of all renderers, so that a loss knows which one it was evaluated on.
std::atomic<std::uint64_t> frames_rendered = 0;

}  // namespace

Renderer::Impl::Impl(Device device_)
    : device(std::move(device_)),
      transform(device.impl()),
      setup(device.impl()),
      bin(device.impl()),
      rasterize(device.impl()),
      shade(device.impl()),
      occupancy(device.impl()),
      aggregate(device.impl()),
      gather(device.impl()),
      reduce(device.impl()) {}

void Renderer::Impl::require_scene(const char* caller) const {
  if (!geometry) throw InvalidArgument(std::string(caller), "no scene", "set_scene() first");
}

void Renderer::Impl::require_forward(const char* caller) {
  if (!rendered)
    throw InvalidArgument(std::string(caller), "no image of the current scene", "forward() first");
  settle();
}

void Renderer::Impl::set_views(std::span<const View> new_views, std::size_t first_view) {
  if (new_views.empty()) throw InvalidArgument("views", "none", "at least one");
  std::vector<shared::ViewParams> cameras;
  std::vector<cl_float4> models;
  std::vector<cl_uint> starts{0};
  for (std::size_t v = 0; v < new_views.size(); ++v) {
    const View& view = new_views[v];
    validate(view.camera);
    if (view.transforms.size() != scene.meshes.size()) {
      throw InvalidArgument(checks::element("views", v) + ".transforms",
                            std::to_string(view.transforms.size()),
                            "one for each of the " + std::to_string(scene.meshes.size()) + " meshes");
    }
    cameras.push_back(view_params(view.camera, scene.width, scene.height));
    for (std::size_t m = 0; m < view.transforms.size(); ++m) {
      checks::require_affine(view.transforms[m],
                             checks::element(checks::element("views", v) + ".transforms", m));
      for (int row = 0; row < 3; ++row) models.push_back(matrix_row(view.transforms[m], row));
      starts.push_back(starts.back() + static_cast<cl_uint>(geometry->meshes[m].vertices));
    }
  }
  check_frame_size(frame_params(scene, *geometry, new_views.size(), first_view));

  geometry->view_positions.resize(device.impl(), 0);
  geometry->view_colors.resize(device.impl(), 0);
  const shared::FrameParams wanted = frame_params(scene, *geometry, new_views.size(), first_view);
  if (wanted.views != frame.views) last_counts.reset();
  frame = wanted;
  views.assign(new_views.begin(), new_views.end());
  device_views.cameras.upload(device.impl(), cameras);
  device_views.models.upload(device.impl(), models);
  view_vertex_starts.upload(device.impl(), starts);
  const std::array<cl_uint, 2> pixels{0, frame.views * frame.width * frame.height};
  all_pixels.upload(device.impl(), pixels);
  rendered = false;
}

void Renderer::Impl::set_shapes(std::span<const glm::vec3> positions, std::span<const glm::vec3> colors) {
  geometry->view_positions.resize(device.impl(), positions.size());
  geometry->view_colors.resize(device.impl(), colors.size());
  write_range(device.impl(), geometry->view_positions, 0, positions);
  write_range(device.impl(), geometry->view_colors, 0, colors);
  frame = frame_params(scene, *geometry, views.size(), frame.first_view);
  rendered = false;
}

void Renderer::Impl::set_smoothing(const Smoothing& smoothing) {
  occupancy.set_smoothing(smoothing);
  aggregate.set_smoothing(smoothing);
  scene.smoothing = smoothing;
  if (!views.empty()) frame = frame_params(scene, *geometry, views.size(), frame.first_view);
  rendered = false;
}

void Renderer::Impl::forward() {
  require_scene("Renderer::forward");
  rendered = false;
  transform.forward(frame, device_views, *geometry);
  setup.forward(frame, device_views, *geometry, transform.ndc);
  room = expected_room();
  if (room) {
    forward_within(*room);
  } else {
    forward_measured();
  }
  rendered = true;
  frame_number = ++frames_rendered;
}

/// None where the frame may have to be cut into bands: for that its sizes must be known.
std::optional<FrameCounts> Renderer::Impl::expected_room() const {
  if (!last_counts) return std::nullopt;
  const FrameCounts expected = rasterize.room_for(*last_counts, bin);
  if (with_headroom(expected.fragments) * k_fragment_bytes >= device.memory_budget()) return std::nullopt;
  return expected;
}

void Renderer::Impl::forward_within(const FrameCounts& expected) {
  bin.forward(frame, setup.triangles, expected.pairs);
  rasterize.forward_within(expected, frame, setup.triangles, bin);
  shade_and_aggregate();
}

void Renderer::Impl::forward_measured() {
  last_counts.reset();
  bin.forward(frame, setup.triangles);
  rasterize.cover(frame, setup.triangles, bin);
  bands = rasterize.cut(frame, device.memory_budget(), k_fragment_bytes);
  for (const Band& band : bands) render(band);
  if (bands.size() == 1) last_counts = rasterize.counted();
}

/// Learns whether the frame did fit into its room, and renders it again where it did not.
void Renderer::Impl::settle() {
  if (!room) return;
  const FrameCounts found = rasterize.read_counts();
  const bool fits = found.fit(*room);
  room.reset();
  if (fits) {
    bin.pairs = found.pairs;
    bands = {rasterize.set_counts(frame, found)};
    last_counts = found;
    return;
  }
  rendered = false;
  forward_measured();
  rendered = true;
}

void Renderer::Impl::render(const Band& band) {
  rasterize.forward(frame, setup.triangles, bin, band);
  shade_and_aggregate();
}

void Renderer::Impl::shade_and_aggregate() {
  shade.forward(shade_inputs());
  if (!aggregate.perturbs_distances()) occupancy.forward(frame, bin, rasterize);
  aggregate.forward(aggregate_inputs(), scene.background);
}

SceneGradient Renderer::Impl::backward(const Buffer<cl_float4>& grad_images, MeshLoss::Impl* mesh_loss) {
  const GradientRequest& wanted = scene.gradients;
  for (const Band& band : bands) {
    if (bands.size() > 1) render(band);  // its fragments have made room for other bands'
    differentiate(grad_images);
  }
  if (is_geometric(wanted)) {
    gather.per_view(frame, geometry->vertices, bin, geometry->vertex_corners, rasterize.grad_corners,
                    grad_ndc);
    if (shade.lit()) shade.backward_world(shade_inputs(), gather, grad_world);
    transform.backward(frame, device_views, *geometry, shade.lit(), grad_ndc, grad_world);
  }
  SceneGradient gradient;
  gradient.meshes.resize(scene.meshes.size());
  gradient.views.resize(views.size());
  for (ViewGradient& view : gradient.views) view.transforms.resize(scene.meshes.size());
  read_summed_gradients(gradient);
  read_mesh_gradients(gradient, mesh_loss);
  return gradient;
}

void Renderer::Impl::differentiate(const Buffer<cl_float4>& grad_images) {
  const GradientRequest& wanted = scene.gradients;
  const bool geometric = is_geometric(wanted);
  aggregate.backward(aggregate_inputs(), scene.background, grad_images);
  const bool sampled_jointly = aggregate.perturbs_distances();
  if ((geometric || wanted.smoothing) && !sampled_jointly) {
    occupancy.backward(frame, bin, rasterize, aggregate.grad_log_occupancy);
  }
  if (geometric || wanted.colors) shade.backward(shade_inputs(), aggregate.grad_color);
  if (geometric) {
    rasterize.backward(frame, setup.triangles, bin,
                       sampled_jointly ? aggregate.grad_distance : occupancy.grad_distance,
                       aggregate.grad_depth, shade.grad_bary1, shade.grad_bary2);
  }
  if (wanted.lights && shade.lit()) {
    for (std::size_t light = 0; light < shade.light_sets(); ++light) {
      shade.backward_light(shade_inputs(), aggregate.grad_color, light);
    }
  }
}

std::size_t Renderer::Impl::bytes() const {
  return (geometry ? geometry->bytes() : 0) + transform.bytes() + setup.bytes() + bin.bytes() +
         rasterize.bytes() + shade.bytes() + occupancy.bytes() + aggregate.bytes() + reduce.bytes() +
         (aov ? aov->bytes() : 0) + device_views.cameras.capacity_bytes() +
         device_views.models.capacity_bytes() + view_vertex_starts.capacity_bytes() +
         all_pixels.capacity_bytes() + host_grad_images.capacity_bytes() + grad_ndc.capacity_bytes() +
         grad_world.capacity_bytes() + grad_colors.capacity_bytes();
}

}  // namespace dpr
