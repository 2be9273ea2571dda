// The pipeline: the stages in order, then in reverse.
#include "dpr/renderer.hpp"

#include <array>
#include <atomic>
#include <cmath>

#include "dpr/opencl.hpp"
#include "loss/image_loss_impl.hpp"
#include "renderer_impl.hpp"
#include "scene/checks.hpp"

namespace dpr {
namespace {

using glm::dvec3;

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

shared::FrameParams frame_params(const Scene& scene, const Geometry& geometry, std::size_t views) {
  shared::FrameParams p{};
  p.views = static_cast<cl_uint>(views);
  p.meshes = static_cast<cl_uint>(scene.meshes.size());
  p.vertices = static_cast<cl_uint>(geometry.vertices);
  p.faces = static_cast<cl_uint>(geometry.faces);
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
  const double largest = 4294967295.0;
  const auto views = static_cast<double>(p.views);
  const double pixels = views * p.width * p.height;
  const double corners = views * std::max(p.vertices * double{DPR_POSE_CHANNELS}, p.faces * 3.0);
  if (std::max(pixels * DPR_PIXEL_CHANNELS, corners) < largest) return;
  throw InvalidArgument("views (frame)", std::to_string(p.views), "fewer, so that pixels and vertices can be counted");
}

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

void Renderer::Impl::require_forward(const char* caller) const {
  if (!rendered) throw InvalidArgument(std::string(caller), "no image of the current scene", "forward() first");
}

void Renderer::Impl::set_views(std::span<const View> new_views) {
  if (new_views.empty()) throw InvalidArgument("views", "none", "at least one");
  std::vector<shared::ViewParams> cameras;
  std::vector<cl_float4> models;
  std::vector<cl_uint> starts{0};
  for (std::size_t v = 0; v < new_views.size(); ++v) {
    const View& view = new_views[v];
    validate(view.camera);
    if (view.transforms.size() != scene.meshes.size()) {
      throw InvalidArgument(checks::element("views", v) + ".transforms", std::to_string(view.transforms.size()),
                            "one for each of the " + std::to_string(scene.meshes.size()) + " meshes");
    }
    cameras.push_back(view_params(view.camera, scene.width, scene.height));
    for (std::size_t m = 0; m < view.transforms.size(); ++m) {
      checks::require_affine(view.transforms[m], checks::element(checks::element("views", v) + ".transforms", m));
      for (int row = 0; row < 3; ++row) models.push_back(matrix_row(view.transforms[m], row));
      starts.push_back(starts.back() + static_cast<cl_uint>(geometry->meshes[m].vertices));
    }
  }
  const shared::FrameParams wanted = frame_params(scene, *geometry, new_views.size());
  check_frame_size(wanted);

  frame = wanted;
  views.assign(new_views.begin(), new_views.end());
  device_views.cameras.upload(device.impl(), cameras);
  device_views.models.upload(device.impl(), models);
  view_vertex_starts.upload(device.impl(), starts);
  const std::array<cl_uint, 2> pixels{0, frame.views * frame.width * frame.height};
  all_pixels.upload(device.impl(), pixels);
  rendered = false;
}

void Renderer::Impl::set_smoothing(const Smoothing& smoothing) {
  occupancy.set_smoothing(smoothing);
  aggregate.set_smoothing(smoothing);
  scene.smoothing = smoothing;
  if (!views.empty()) frame = frame_params(scene, *geometry, views.size());
  rendered = false;
}

void Renderer::Impl::forward() {
  require_scene("Renderer::forward");
  rendered = false;
  transform.forward(frame, device_views, *geometry);
  setup.forward(frame, device_views, *geometry, transform.ndc);
  bin.forward(frame, setup.triangles);
  rasterize.forward(frame, setup.triangles, bin);
  shade.forward(shade_inputs());
  occupancy.forward(frame, bin, rasterize);
  aggregate.forward(aggregate_inputs(), scene.background);
  rendered = true;
  frame_number = ++frames_rendered;
}

SceneGradient Renderer::Impl::backward(const Buffer<cl_float4>& grad_images) {
  const GradientRequest& wanted = scene.gradients;
  const bool geometric = wanted.positions || wanted.transform || wanted.camera;
  SceneGradient gradient;
  gradient.meshes.resize(scene.meshes.size());
  gradient.views.resize(views.size());
  for (ViewGradient& view : gradient.views) view.transforms.resize(scene.meshes.size());

  aggregate.backward(aggregate_inputs(), scene.background, grad_images);
  if (geometric || wanted.smoothing) occupancy.backward(frame, bin, rasterize, aggregate.grad_log_occupancy);
  if (geometric || wanted.colors) shade.backward(shade_inputs(), aggregate.grad_color);
  if (geometric) {
    rasterize.backward(frame, setup.triangles, bin, occupancy.grad_distance, aggregate.grad_depth, shade.grad_bary1,
                       shade.grad_bary2);
    gather.per_view(frame, geometry->vertices, bin, geometry->vertex_corners, rasterize.grad_corners, grad_ndc);
    if (shade.lit()) shade.backward_world(shade_inputs(), gather, grad_world);
    transform.backward(frame, device_views, *geometry, shade.lit(), grad_ndc, grad_world);
  }
  read_smoothing_gradients(gradient);
  read_mesh_gradients(gradient);
  if (wanted.transform || wanted.camera) read_pose_gradients(gradient);
  if (wanted.lights && shade.lit()) read_light_gradients(gradient);
  return gradient;
}

void Renderer::Impl::read_smoothing_gradients(SceneGradient& gradient) {
  if (scene.gradients.smoothing || scene.gradients.background) {
    const std::size_t pixels = std::size_t{frame.views} * frame.width * frame.height;
    const std::vector<float> sums = reduce.read(pixels, DPR_PIXEL_CHANNELS, 1, 1, all_pixels, aggregate.channels);
    if (scene.gradients.smoothing) {
      gradient.gamma = sums[DPR_CHANNEL_GAMMA];
      gradient.alpha = sums[DPR_CHANNEL_ALPHA];
    }
    if (scene.gradients.background) {
      gradient.background = dvec3(sums[DPR_CHANNEL_BACKGROUND], sums[DPR_CHANNEL_BACKGROUND + 1],
                                  sums[DPR_CHANNEL_BACKGROUND + 2]);
    }
  }
  if (scene.gradients.smoothing) {
    const std::size_t stride = std::size_t{frame.views} * frame.faces;
    gradient.sigma = reduce.read(bin.pairs, 1, 1, stride, bin.pair_starts, occupancy.grad_sigma)[0];
  }
}

namespace {

/// A mesh's part of a joined buffer.
std::vector<glm::vec3> read_range(const Buffer<cl_float4>& buffer, std::size_t first, std::size_t count) {
  std::vector<cl_float4> values(count);
  buffer.download(values, first);
  std::vector<glm::vec3> result;
  result.reserve(count);
  for (const cl_float4& v : values) result.emplace_back(v.s[0], v.s[1], v.s[2]);
  return result;
}

}  // namespace

void Renderer::Impl::read_mesh_gradients(SceneGradient& gradient) {
  if (scene.gradients.positions) transform.backward_positions(frame, device_views, *geometry, grad_world);
  if (scene.gradients.colors) {
    gather.over_views(frame, geometry->colors, bin, geometry->color_corners, shade.grad_corner_colors, grad_colors);
  }
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const MeshRange& range = geometry->meshes[m];
    const Mesh& mesh = scene.meshes[m].mesh;
    if (scene.gradients.positions) {
      gradient.meshes[m].positions = read_range(transform.grad_positions, range.first_vertex, range.vertices);
    }
    if (scene.gradients.colors && !(mesh.vertex_colors.empty() && mesh.face_colors.empty())) {
      gradient.meshes[m].colors = read_range(grad_colors, range.first_color, range.colors);
    }
  }
}

namespace {

/// From the gradients of the projection's scale and offset to those of the camera's own parameters.
void add_projection_gradient(const std::array<double, 4>& grad, const Camera& camera, int width, int height,
                             CameraGradient& out) {
  const double short_side = std::min(width, height);
  if (camera.intrinsics) {
    const double factor = 2.0 / short_side;
    out.intrinsics = {grad[0] * factor, grad[1] * factor, grad[2] * factor, -grad[3] * factor};
    return;
  }
  const double half_angle = glm::radians(static_cast<double>(camera.fov_y_degrees)) / 2;
  const double scale_by_half_angle = -height / short_side / std::pow(std::sin(half_angle), 2);
  out.fov_y_degrees = (grad[0] + grad[1]) * scale_by_half_angle * glm::radians(0.5);
}

}  // namespace

void Renderer::Impl::read_pose_gradients(SceneGradient& gradient) {
  const std::size_t segments = views.size() * scene.meshes.size();
  const std::vector<float> sums = reduce.read(std::size_t{frame.views} * frame.vertices, DPR_POSE_CHANNELS, segments, 1,
                                              view_vertex_starts, transform.channels);
  const auto sum = [&](std::size_t channel, std::size_t segment) {
    return static_cast<double>(sums[channel * segments + segment]);
  };
  const auto sum3 = [&](std::size_t channel, std::size_t segment) {
    return dvec3(sum(channel, segment), sum(channel + 1, segment), sum(channel + 2, segment));
  };
  for (std::size_t v = 0; v < views.size(); ++v) {
    CameraGradient camera;
    std::array<double, 4> projected{};
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      const std::size_t segment = v * scene.meshes.size() + m;
      if (scene.gradients.transform) {
        gradient.views[v].transforms[m] = {sum3(DPR_CHANNEL_MODEL, segment), sum3(DPR_CHANNEL_MODEL + 3, segment)};
      }
      camera.view.rotation += sum3(DPR_CHANNEL_VIEW, segment);
      camera.view.translation += sum3(DPR_CHANNEL_VIEW + 3, segment);
      for (std::size_t k = 0; k < 4; ++k) projected[k] += sum(DPR_CHANNEL_PROJECTION + k, segment);
    }
    add_projection_gradient(projected, views[v].camera, scene.width, scene.height, camera);
    if (scene.gradients.camera) gradient.views[v].camera = camera;
  }
  if (scene.gradients.camera && shade.lit()) add_eye_gradients(gradient);
}

/// Highlights move with the camera's centre c = -A^-1 t: dc = A^-1 (r x t) for a rotation, -A^-1 dt for a translation.
void Renderer::Impl::add_eye_gradients(SceneGradient& gradient) {
  const std::vector<float> sums =
      reduce.read(bin.pairs, 3, views.size(), frame.faces, bin.pair_starts, shade.grad_eye);
  for (std::size_t v = 0; v < views.size(); ++v) {
    const dvec3 grad_eye(sums[v], sums[views.size() + v], sums[2 * views.size() + v]);
    const glm::dmat4 view(views[v].camera.view);
    const dvec3 in_camera = glm::transpose(glm::inverse(glm::dmat3(view))) * grad_eye;
    PoseGradient& out = gradient.views[v].camera.view;
    out.rotation += glm::cross(dvec3(view[3]), in_camera);
    out.translation -= in_camera;
  }
}

void Renderer::Impl::read_light_gradients(SceneGradient& gradient) {
  gradient.lights.resize(shade.lights());
  const std::size_t stride = std::size_t{frame.views} * frame.faces;
  // Without point lights one launch still finds the ambient light's gradient.
  for (std::size_t light = 0; light < std::max<std::size_t>(shade.lights(), 1); ++light) {
    shade.backward_light(shade_inputs(), aggregate.grad_color, light);
    const std::vector<float> sums =
        reduce.read(bin.pairs, k_light_channels, 1, stride, bin.pair_starts, shade.light_channels);
    const auto sum3 = [&](std::size_t channel) { return dvec3(sums[channel], sums[channel + 1], sums[channel + 2]); };
    gradient.ambient = sum3(9);
    if (light < shade.lights()) gradient.lights[light] = {sum3(0), sum3(3), sum3(6)};
  }
}

std::size_t Renderer::Impl::bytes() const {
  return (geometry ? geometry->bytes() : 0) + transform.bytes() + setup.bytes() + bin.bytes() + rasterize.bytes() +
         shade.bytes() + occupancy.bytes() + aggregate.bytes() + reduce.bytes() + device_views.cameras.capacity_bytes() +
         device_views.models.capacity_bytes() + view_vertex_starts.capacity_bytes() + all_pixels.capacity_bytes() +
         host_grad_images.capacity_bytes() + grad_ndc.capacity_bytes() + grad_world.capacity_bytes() +
         grad_colors.capacity_bytes();
}

Renderer::Renderer(Device device) : impl_(std::make_unique<Impl>(std::move(device))) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

void Renderer::set_scene(const Scene& scene) {
  validate(scene);
  Impl& m = *impl_;
  m.scene = scene;
  m.views.clear();
  m.rendered = false;
  m.geometry.emplace(m.device.impl(), scene);
  m.shade.set_lights(scene.lights);
  m.set_smoothing(scene.smoothing);
  View view{scene.camera, {}};
  for (const Instance& instance : scene.meshes) view.transforms.push_back(instance.transform);
  m.set_views(std::span(&view, 1));
}

void Renderer::set_views(std::span<const View> views) {
  impl_->require_scene("Renderer::set_views");
  impl_->set_views(views);
}

void Renderer::set_smoothing(const Smoothing& smoothing) {
  impl_->require_scene("Renderer::set_smoothing");
  validate(smoothing);
  impl_->set_smoothing(smoothing);
}

namespace {

/// Replaces a mesh's part of a joined buffer.
void write_range(Device::Impl& device, const Buffer<cl_float4>& buffer, std::size_t first,
                 std::span<const glm::vec3> values) {
  if (values.empty()) return;
  std::vector<cl_float4> rows;
  rows.reserve(values.size());
  for (const glm::vec3& v : values) rows.push_back(to_cl(v));
  check_cl(device.queue.enqueueWriteBuffer(buffer.cl_buffer(), CL_TRUE, first * sizeof(cl_float4),
                                           rows.size() * sizeof(cl_float4), rows.data()),
           "clEnqueueWriteBuffer");
}

void check_values(const std::string& name, std::span<const glm::vec3> values, std::size_t expected) {
  if (values.size() != expected) {
    throw InvalidArgument(name, std::to_string(values.size()) + " values", std::to_string(expected));
  }
  for (std::size_t i = 0; i < values.size(); ++i) checks::require_finite(values[i], checks::element(name, i));
}

}  // namespace

void Renderer::set_positions(std::size_t mesh, std::span<const glm::vec3> positions) {
  Impl& m = *impl_;
  m.require_scene("Renderer::set_positions");
  if (mesh >= m.scene.meshes.size()) {
    throw InvalidArgument("mesh", std::to_string(mesh), "below " + std::to_string(m.scene.meshes.size()));
  }
  check_values("positions", positions, m.scene.meshes[mesh].mesh.positions.size());
  m.scene.meshes[mesh].mesh.positions.assign(positions.begin(), positions.end());
  write_range(m.device.impl(), m.geometry->positions, m.geometry->meshes[mesh].first_vertex, positions);
  m.rendered = false;
}

void Renderer::set_colors(std::size_t mesh, std::span<const glm::vec3> colors) {
  Impl& m = *impl_;
  m.require_scene("Renderer::set_colors");
  if (mesh >= m.scene.meshes.size()) {
    throw InvalidArgument("mesh", std::to_string(mesh), "below " + std::to_string(m.scene.meshes.size()));
  }
  Mesh& target = m.scene.meshes[mesh].mesh;
  std::vector<glm::vec3>& values = target.vertex_colors.empty() ? target.face_colors : target.vertex_colors;
  check_values("colors", colors, values.size());
  values.assign(colors.begin(), colors.end());
  write_range(m.device.impl(), m.geometry->color_values, m.geometry->meshes[mesh].first_color, colors);
  m.rendered = false;
}

const Scene& Renderer::scene() const { return impl_->scene; }
std::span<const View> Renderer::views() const { return impl_->views; }
const Device& Renderer::device() const { return impl_->device; }

void Renderer::forward() { impl_->forward(); }

Image Renderer::image(std::size_t view) const {
  const Impl& m = *impl_;
  m.require_forward("Renderer::image");
  if (view >= m.views.size()) {
    throw InvalidArgument("view", std::to_string(view), "below " + std::to_string(m.views.size()));
  }
  Image image(m.scene.width, m.scene.height);
  std::vector<cl_float4> values(image.pixels.size());
  m.aggregate.image.download(values, view * values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    image.pixels[i] = glm::vec4(values[i].s[0], values[i].s[1], values[i].s[2], values[i].s[3]);
  }
  return image;
}

SceneGradient Renderer::backward(std::span<const Image> grad_images) {
  Impl& m = *impl_;
  m.require_forward("Renderer::backward");
  if (grad_images.size() != m.views.size()) {
    throw InvalidArgument("grad_images", std::to_string(grad_images.size()) + " images",
                          "one for each of the " + std::to_string(m.views.size()) + " views");
  }
  std::vector<cl_float4> values;
  for (const Image& image : grad_images) {
    if (image.width != m.scene.width || image.height != m.scene.height) {
      throw InvalidArgument("size (grad_images)", std::to_string(image.width) + "x" + std::to_string(image.height),
                            std::to_string(m.scene.width) + "x" + std::to_string(m.scene.height));
    }
    checks::require_pixels(image, "grad_images");
    for (const glm::vec4& p : image.pixels) values.push_back({{p.x, p.y, p.z, p.w}});
  }
  m.host_grad_images.upload(m.device.impl(), values);
  return m.backward(m.host_grad_images);
}

SceneGradient Renderer::backward(const ImageLoss& loss) {
  impl_->require_forward("Renderer::backward");
  if (loss.impl().frame_number != impl_->frame_number) {
    throw InvalidArgument("loss (Renderer::backward)", "the gradient of other images",
                          "a loss evaluated on this renderer's last forward()");
  }
  return impl_->backward(loss.impl().grad_image);
}

RenderStatistics Renderer::statistics() const {
  const Impl& m = *impl_;
  m.require_forward("Renderer::statistics");
  RenderStatistics s;
  s.faces = std::size_t{m.frame.views} * m.frame.faces;
  for (const shared::Triangle& triangle : m.setup.triangles.download()) {
    if (triangle.orientation == 0.0F) ++s.faces_dropped;
  }
  s.pairs = m.bin.pairs;
  s.fragments = m.rasterize.listed_fragments;
  s.device_bytes = m.bytes();
  return s;
}

cl::Buffer image_buffer(const Renderer& renderer) {
  renderer.impl().require_forward("image_buffer");
  return renderer.impl().aggregate.image.cl_buffer();
}

SceneGradient backward(Renderer& renderer, const cl::Buffer& grad_images) {
  Renderer::Impl& m = renderer.impl();
  m.require_forward("backward");
  const std::size_t count = m.aggregate.image.size();
  const std::size_t bytes = grad_images.getInfo<CL_MEM_SIZE>();
  if (bytes < count * sizeof(cl_float4)) {
    throw InvalidArgument("grad_images", std::to_string(bytes) + " bytes", std::to_string(count * sizeof(cl_float4)));
  }
  m.host_grad_images.resize(m.device.impl(), count);
  check_cl(m.device.impl().queue.enqueueCopyBuffer(grad_images, m.host_grad_images.cl_buffer(), 0, 0,
                                                   count * sizeof(cl_float4)),
           "clEnqueueCopyBuffer");
  return m.backward(m.host_grad_images);
}

}  // namespace dpr
