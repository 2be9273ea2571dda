#include "probes.hpp"

#include <glm/gtc/matrix_transform.hpp>

#include "dpr/renderer.hpp"

namespace dpr::experiments {
namespace {

// A camera at the origin with a field of view of 90 degrees sees NDC = position / depth; one pixel, at NDC 0.
constexpr float k_near = 1, k_far = 3, k_depth = 2;
constexpr float k_fov_degrees = 90;
/// Half the length of the triangles' borders: far outside what the noise reaches.
constexpr float k_extent = 200;

Scene pixel_scene(const Smoothing& smoothing) {
  Scene scene;
  scene.width = scene.height = 1;
  scene.camera.fov_y_degrees = k_fov_degrees;
  scene.camera.znear = k_near;
  scene.camera.zfar = k_far;
  scene.smoothing = smoothing;
  scene.smoothing.distance = DistanceMetric::euclidean;
  scene.smoothing.sigma = 1;
  return scene;
}

/// The half plane x < border, as far as the pixel can tell, at the origin's depth.
Mesh half_plane(float border, glm::vec3 color) {
  Mesh mesh;
  mesh.positions = {{border, -k_extent, 0}, {border, k_extent, 0}, {border - k_extent, 0, 0}};
  mesh.faces = {{0, 1, 2}};
  mesh.face_colors = {color};
  return mesh;
}

glm::mat4 moved(float x, float z) { return glm::translate(glm::mat4(1), glm::vec3(x, 0, z)); }

/// Renders the views, and sends `grad` back from each.
std::vector<ViewGradient> gradients(Renderer& renderer, std::span<const View> views, glm::vec4 grad) {
  renderer.set_views(views);
  renderer.forward();
  const std::vector<Image> grads(views.size(), Image(1, 1, grad));
  return renderer.backward(grads).views;
}

}  // namespace

Response heaviside(const Device& device, const Smoothing& smoothing, std::span<const double> x) {
  Scene scene = pixel_scene(smoothing);
  scene.smoothing.blur_radius = k_extent / 8;
  scene.meshes.push_back({half_plane(0, glm::vec3(1))});
  std::vector<View> views;
  for (const double value : x) {
    views.push_back({scene.camera, {moved(static_cast<float>(value) * k_depth, -k_depth)}});
  }
  Renderer renderer(device);
  renderer.set_scene(scene);
  const auto grads = gradients(renderer, views, {0, 0, 0, 1});
  Response response;
  for (std::size_t i = 0; i < x.size(); ++i) {
    response.value.push_back(static_cast<double>(renderer.image(i).pixels[0].a));
    response.derivative.push_back(grads[i].transforms[0].translation.x * static_cast<double>(k_depth));
  }
  return response;
}

Response arg_max(const Device& device, const Smoothing& smoothing, std::span<const double> beta) {
  constexpr float k_gamma = 0.05F, k_fixed_betas[] = {0, -2};
  constexpr float k_never = -1e3F;  // normalised depth of a background that no noise brings forward
  const auto at_beta = [](double b) {
    return moved(0, -k_depth + static_cast<float>(b) * k_gamma * (k_far - k_near));
  };
  Scene scene = pixel_scene(smoothing);
  scene.smoothing.gamma = k_gamma;
  scene.smoothing.background_depth = k_never;
  for (const glm::vec3 color : {glm::vec3(1, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1)}) {
    scene.meshes.push_back({half_plane(k_extent / 4, color)});
  }
  std::vector<View> views;
  for (const double b : beta) {
    views.push_back({scene.camera,
                     {at_beta(b), at_beta(static_cast<double>(k_fixed_betas[0])),
                      at_beta(static_cast<double>(k_fixed_betas[1]))}});
  }
  Renderer renderer(device);
  renderer.set_scene(scene);
  const auto grads = gradients(renderer, views, {1, 0, 0, 0});
  Response response;
  for (std::size_t i = 0; i < beta.size(); ++i) {
    response.value.push_back(static_cast<double>(renderer.image(i).pixels[0].r));
    response.derivative.push_back(grads[i].transforms[0].translation.z *
                                  static_cast<double>(k_gamma * (k_far - k_near)));
  }
  return response;
}

}  // namespace dpr::experiments
