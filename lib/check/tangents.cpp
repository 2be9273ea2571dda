// Self-test of forward mode: against backward, whose transpose it is.
#include "check/adjoint.hpp"
#include "check/check_log.hpp"

namespace dpr::check {
namespace {

constexpr double k_adjoint = 1e-5;

/// Compares directions of all kinds but gamma's, whose sum cancels.
void log_adjoint(const Device& device, const Scene& scene, const char* compared, CheckLog& log) {
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  Random random(11);
  const std::vector<Image> weights = random_images(renderer, random);
  SceneGradient gradient = renderer.backward(weights);
  std::vector<Way> ways = random_ways(gradient, scene.smoothing.noise != Noise::pixel, random);
  std::erase_if(ways, [](const Way& way) { return way.name == "gamma"; });
  Largest worst;
  for (const double error : errors_of(renderer, weights, ways)) worst.add(error);
  log.add("tangents", compared, worst.value(), k_adjoint);
}

Scene with(Scene scene, const char* preset, const std::optional<Lights>& lights) {
  const Smoothing own = scene.smoothing;
  scene.smoothing = smoothing_preset(preset, scene.width, scene.height);
  scene.smoothing.gamma = own.gamma;
  scene.smoothing.background_depth = own.background_depth;
  scene.lights = lights;
  return scene;
}

}  // namespace

void check_tangents(const Device& device, CheckLog& log) {
  const Scene textured =
      textured_scene(make_icosphere(1), random_texture(8, 8, Wrap::repeat, Filter::trilinear), 24, 20);
  const Scene cut = scene_cut_open(welded_cube(), 24, 20);
  log_adjoint(device, with(textured, "joint_gaussian", every_light(Shading::phong)),
              "joint, texture, Phong: relative", log);
  Scene rough = scene_of(make_icosphere(1), 24, 20);
  rough.meshes[0].mesh.materials = materials_for(Shading::microfacet);
  log_adjoint(device, with(rough, "joint_gaussian", every_light(Shading::microfacet)),
              "joint, rough metal: relative", log);
  log_adjoint(device, with(cut, "gaussian", std::nullopt), "barrier, near plane: relative", log);
  log_adjoint(device, with(cut, "pixel", two_lights(Shading::gouraud)),
              "noise on the pixel, near plane, Gouraud: relative", log);
}

}  // namespace dpr::check
