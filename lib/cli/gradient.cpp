// dpr gradient: the loss against a target, and every gradient the scene asks for.
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "cli/commands.hpp"
#include "cli/file_options.hpp"
#include "cli/json.hpp"
#include "cli/lens_options.hpp"
#include "cli/target.hpp"
#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/renderer.hpp"
#include "scene/gradient_table.hpp"

namespace dpr::cli {
namespace {

struct GradientOptions {
  std::string scene, target, loss = "mse", output;
  LensSubdivisionOptions lens;
};

Json array_to_json(const GradientArray& array) {
  if (double* const* value = std::get_if<double*>(&array)) return **value;
  return std::visit(
      [](const auto* list) -> Json {
        if constexpr (std::is_same_v<decltype(list), const double*>) {
          return *list;
        } else {
          return to_json(*list);
        }
      },
      array);
}

/// The member of a path like "camera.rotation".
Json& member(Json& json, std::string_view path) {
  const std::size_t dot = path.find('.');
  Json& first = json[std::string(path.substr(0, dot))];
  return dot == std::string_view::npos ? first : member(first, path.substr(dot + 1));
}

/// The arrays of a row, in the first view.
void add_row(Json& json, const GradientRow& row, SceneGradient& gradient) {
  constexpr std::string_view k_list = "[].";
  const std::size_t end_of_list = row.path.find(k_list);
  if (end_of_list == std::string_view::npos) {
    member(json, row.path) = array_to_json(row.array(gradient, {}));
    return;
  }
  Json& list = member(json, row.path.substr(0, end_of_list));
  if (list.is_null()) list = Json::array();
  const std::size_t count = count_arrays(row, gradient).item;
  while (list.size() < count) list.push_back(Json::object());
  for (std::size_t i = 0; i < count; ++i) {
    member(list[i], row.path.substr(end_of_list + k_list.size())) =
        array_to_json(row.array(gradient, {0, i}));
  }
}

Json gradient_to_json(const Scene& scene, double loss, SceneGradient gradient) {
  Json json;
  json["loss"] = loss;
  json["meshes"] = std::vector<Json>(scene.meshes.size(), Json::object());
  for (const GradientRow& row : gradient_rows()) {
    const bool exists = row.exists == nullptr || row.exists(scene);
    if (scene.gradients.*row.wanted && exists && row.of != GradientOf::all_views)
      add_row(json, row, gradient);
  }
  return json;
}

void run(const CLI::App& command, const GradientOptions& options, const CommonOptions& common) {
  const Scene scene = read_scene(options.scene, common);
  const SubdividedScene drawn = subdivide(command, scene, options.lens);
  const LossWeights weights = LossWeights::only(parse_loss(options.loss, "--loss"));
  const Image target = read_target(options.target, weights, common.encoding(), scene);
  require_outputs({options.output});
  const Device device = open_device(common);
  Renderer renderer(device);
  ImageLoss image_loss(device, weights, {&target, 1});
  renderer.set_scene(drawn.scene);
  renderer.forward();
  const double loss = image_loss.evaluate(renderer);
  if (!std::isfinite(loss)) {
    throw InvalidArgument("loss (dpr gradient)", checks::text(loss),
                          "a finite number; the image's or the target's colours are beyond single precision");
  }
  SceneGradient gradient = pull_back(scene, drawn, renderer.backward(image_loss));
  write_json(options.output, gradient_to_json(scene, loss, std::move(gradient)));
  if (!common.quiet) std::printf("%s: %s loss %.6g\n", options.output.c_str(), options.loss.c_str(), loss);
}

}  // namespace

void add_gradient_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command =
      application.add_subcommand("gradient", "Computes a loss and every gradient that the scene asks for");
  const auto options = std::make_shared<GradientOptions>();
  command->add_option("--scene", options->scene, "Scene file")->required()->type_name("S.json");
  command->add_option("--target", options->target, "Image to compare with")->required()->type_name("T.exr");
  command->add_option("--loss", options->loss, "Loss; mse by default")->type_name(joined(loss_names()));
  command->add_option("-o,--output", options->output, "Gradients to write")->required()->type_name("G.json");
  add_lens_options(*command, options->lens);
  add_common_options(*command, common);
  command->footer("Example: dpr gradient --scene scene.json --target target.exr --loss l1 -o gradient.json");
  command->callback([command, options, &common] { run(*command, *options, common); });
}

}  // namespace dpr::cli
