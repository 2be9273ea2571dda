// dpr gradient: the loss against a target, and every gradient the scene asks for.
#include <cmath>
#include <cstdio>
#include <memory>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "cli/commands.hpp"
#include "cli/json.hpp"
#include "cli/target.hpp"
#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/renderer.hpp"

namespace dpr::cli {
namespace {

struct GradientOptions {
  std::string scene, target, loss = "mse", output;
};

Json meshes_to_json(const GradientRequest& request, const SceneGradient& gradient) {
  Json meshes = Json::array();
  const ViewGradient& view = gradient.views.front();
  for (std::size_t i = 0; i < gradient.meshes.size(); ++i) {
    Json mesh = Json::object();
    if (request.positions) mesh["positions"] = to_json(gradient.meshes[i].positions);
    if (request.colors) mesh["colors"] = to_json(gradient.meshes[i].colors);
    if (request.transform) {
      mesh["rotation"] = to_json(view.transforms[i].rotation);
      mesh["translation"] = to_json(view.transforms[i].translation);
    }
    meshes.push_back(mesh);
  }
  return meshes;
}

Json camera_to_json(const Camera& camera, const CameraGradient& gradient) {
  Json json;
  json["rotation"] = to_json(gradient.view.rotation);
  json["translation"] = to_json(gradient.view.translation);
  if (camera.intrinsics) {
    const auto& [fx, fy, cx, cy] = gradient.intrinsics;
    json["intrinsics"] = {{"fx", fx}, {"fy", fy}, {"cx", cx}, {"cy", cy}};
  } else {
    json["fov_y_degrees"] = gradient.fov_y_degrees;
  }
  return json;
}

Json lights_to_json(const SceneGradient& gradient) {
  Json point = Json::array();
  for (const PointLightGradient& light : gradient.lights) {
    point.push_back({{"position", to_json(light.position)},
                     {"diffuse", to_json(light.diffuse)},
                     {"specular", to_json(light.specular)}});
  }
  return {{"ambient", to_json(gradient.ambient)}, {"point", point}};
}

Json gradient_to_json(const Scene& scene, double loss, const SceneGradient& gradient) {
  const GradientRequest& request = scene.gradients;
  Json json;
  json["loss"] = loss;
  json["meshes"] = meshes_to_json(request, gradient);
  if (request.camera) json["camera"] = camera_to_json(scene.camera, gradient.views.front().camera);
  if (request.lights && scene.lights) json["lights"] = lights_to_json(gradient);
  if (request.smoothing) {
    json["sigma"] = gradient.sigma;
    json["gamma"] = gradient.gamma;
    json["alpha"] = gradient.alpha;
  }
  if (request.background) json["background"] = to_json(gradient.background);
  return json;
}

void run(const GradientOptions& options, const CommonOptions& common) {
  const Scene scene = read_scene(options.scene, common);
  const LossWeights weights = LossWeights::only(parse_loss(options.loss, "--loss"));
  const Image target = read_target(options.target, weights);
  const Device device = open_device(common);
  Renderer renderer(device);
  ImageLoss image_loss(device, weights, {&target, 1});
  renderer.set_scene(scene);
  renderer.forward();
  const double loss = image_loss.evaluate(renderer);
  if (!std::isfinite(loss)) {
    throw InvalidArgument("loss (dpr gradient)", checks::text(loss),
                          "a finite number; the image's or the target's colours are beyond single precision");
  }
  write_json(options.output, gradient_to_json(scene, loss, renderer.backward(image_loss)));
  if (!common.quiet) std::printf("%s: %s loss %.6g\n", options.output.c_str(), options.loss.c_str(), loss);
}

}  // namespace

void add_gradient_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command =
      application.add_subcommand("gradient", "Computes a loss and every gradient that the scene asks for");
  const auto options = std::make_shared<GradientOptions>();
  command->add_option("--scene", options->scene, "Scene file")->required()->type_name("S.json");
  command->add_option("--target", options->target, "Image to compare with")->required()->type_name("T.exr");
  command->add_option("--loss", options->loss, "Which loss; mse by default")->type_name(joined(loss_names()));
  command->add_option("-o,--output", options->output, "Gradients to write")->required()->type_name("G.json");
  add_common_options(*command, common);
  command->footer("Example: dpr gradient --scene scene.json --target target.exr --loss l1 -o gradient.json");
  command->callback([options, &common] { run(*options, common); });
}

}  // namespace dpr::cli
