#include "renderer/finite.hpp"

#include <cmath>
#include <string>

#include "base/checks.hpp"

namespace dpr {
namespace {

void check(double value, const std::string& name) {
  if (std::isfinite(value)) return;
  throw InvalidArgument("gradient of " + name + " (backward)", checks::text(value),
                        "a finite number; the scene's lengths or the smoothing are beyond single precision");
}

template <typename Vector>
void check_vector(const Vector& v, const std::string& name) {
  for (int axis = 0; axis < 3; ++axis) check(static_cast<double>(v[axis]), name);
}

void check_all(const std::vector<glm::vec3>& values, const std::string& name) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!checks::is_finite(values[i])) check_vector(values[i], checks::element(name, i));
  }
}

void check_pose(const PoseGradient& pose, const std::string& name) {
  check_vector(pose.rotation, name + ".rotation");
  check_vector(pose.translation, name + ".translation");
}

}  // namespace

void require_scales(const Camera& camera, const Smoothing& smoothing, bool lit) {
  constexpr float k_largest = 1e36F, k_largest_length = 1e9F;
  const float range = camera.zfar - camera.znear;
  if (!(range <= k_largest && 1 / range <= k_largest)) {
    throw InvalidArgument("zfar - znear (camera)", checks::text(range),
                          "a length from 1e-36 to 1e36, whose inverse single precision holds");
  }
  if (!(1 / range / smoothing.gamma <= k_largest)) {
    throw InvalidArgument(
        "gamma (smoothing)", checks::text(smoothing.gamma),
        "at least " + checks::text(1 / range / k_largest) +
            " with these clipping planes: single precision holds 1 / (gamma (zfar - znear))");
  }
  if (lit && (camera.znear > k_largest_length || camera.zfar < 1 / k_largest_length)) {
    throw InvalidArgument(
        "znear to zfar (camera)",
        checks::text(camera.znear) + " to " + checks::text(camera.zfar) + " with lights",
        "lengths from 1e-9 to 1e9, whose powers single precision holds: another unit of length");
  }
}

void require_finite(const SceneGradient& gradient) {
  for (std::size_t m = 0; m < gradient.meshes.size(); ++m) {
    const std::string mesh = checks::element("meshes", m);
    check_all(gradient.meshes[m].positions, mesh + ".positions");
    check_all(gradient.meshes[m].colors, mesh + ".colors");
  }
  check_all(gradient.shapes.positions, "shapes.positions");
  check_all(gradient.shapes.colors, "shapes.colors");
  for (std::size_t v = 0; v < gradient.views.size(); ++v) {
    const std::string view = checks::element("views", v);
    const CameraGradient& camera = gradient.views[v].camera;
    check_pose(camera.view, view + ".camera");
    check(camera.fov_y_degrees, view + ".camera.fov_y_degrees");
    for (const double value : camera.intrinsics) check(value, view + ".camera.intrinsics");
    for (std::size_t m = 0; m < gradient.views[v].transforms.size(); ++m) {
      check_pose(gradient.views[v].transforms[m], checks::element(view + ".transforms", m));
    }
  }
  check_vector(gradient.ambient, "lights.ambient");
  for (std::size_t l = 0; l < gradient.lights.size(); ++l) {
    const std::string light = checks::element("lights.point", l);
    check_vector(gradient.lights[l].position, light + ".position");
    check_vector(gradient.lights[l].diffuse, light + ".diffuse");
    check_vector(gradient.lights[l].specular, light + ".specular");
  }
  check(gradient.sigma, "sigma");
  check(gradient.gamma, "gamma");
  check(gradient.alpha, "alpha");
  check_vector(gradient.background, "background");
}

}  // namespace dpr
