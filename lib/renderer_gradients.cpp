// From what the stages' backward passes left on the device to the gradients on the host.
#include <array>
#include <cmath>

#include "renderer_impl.hpp"

namespace dpr {

using glm::dvec3;

void Renderer::Impl::read_smoothing_gradients(SceneGradient& gradient) {
  const std::size_t pixels = std::size_t{frame.views} * frame.width * frame.height;
  if (scene.gradients.smoothing || scene.gradients.background) {
    const std::vector<float> sums =
        reduce.read(pixels, DPR_PIXEL_CHANNELS, 1, 1, all_pixels, aggregate.channels);
    if (scene.gradients.smoothing) {
      gradient.gamma = sums[DPR_CHANNEL_GAMMA];
      gradient.alpha = sums[DPR_CHANNEL_ALPHA];
    }
    if (scene.gradients.background) {
      gradient.background = dvec3(sums[DPR_CHANNEL_BACKGROUND], sums[DPR_CHANNEL_BACKGROUND + 1],
                                  sums[DPR_CHANNEL_BACKGROUND + 2]);
    }
  }
  if (scene.gradients.smoothing && aggregate.perturbs_distances()) {
    gradient.sigma = reduce.read(pixels, 1, 1, 1, all_pixels, aggregate.grad_sigma)[0];
  } else if (scene.gradients.smoothing) {
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
    gather.over_views(frame, geometry->colors, bin, geometry->color_corners, shade.grad_corner_colors,
                      grad_colors);
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
  const std::vector<float> sums = reduce.read(std::size_t{frame.views} * frame.vertices, DPR_POSE_CHANNELS,
                                              segments, 1, view_vertex_starts, transform.channels);
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
        gradient.views[v].transforms[m] = {sum3(DPR_CHANNEL_MODEL, segment),
                                           sum3(DPR_CHANNEL_MODEL + 3, segment)};
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

/// Highlights move with the camera's centre c = -A^-1 t: dc = A^-1 (r x t) for a rotation, -A^-1 dt for a
/// translation.
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
    const auto sum3 = [&](std::size_t channel) {
      return dvec3(sums[channel], sums[channel + 1], sums[channel + 2]);
    };
    gradient.ambient = sum3(9);
    if (light < shade.lights()) gradient.lights[light] = {sum3(0), sum3(3), sum3(6)};
  }
}

}  // namespace dpr
