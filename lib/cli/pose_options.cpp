// Options of the methods.
#include "cli/pose_options.hpp"

#include <array>

#include "base/name_list.hpp"
#include "cli/option_names.hpp"
#include "cli/pose_report.hpp"
#include "cli/text.hpp"
#include "dpr/image.hpp"

namespace dpr::cli {

void add_least_squares_options(CLI::App& command, const char* group, LeastSquaresOptions& options) {
  LeastSquares& method = options.method;
  const auto add = [&](const char* name, auto& value, const char* description, const char* type) {
    return command.add_option(name, value, description)->group(group)->type_name(type);
  };
  add("--rotations", method.rotations,
      "Rotations all around that are tried at the coarsest level, beside the initial one; 0: none; 1152 by "
      "default",
      "N");
  add("--coarsest", method.coarsest, "Pixels on the short side of the coarsest level; 16 by default", "N");
  add("--level-iterations", method.iterations,
      "Steps a level, more while the best pose still improves; 10 by default", "N");
  add("--blur", method.blur, "Blur of the edges, in pixels of the level; 0.25 by default", "FLOAT");
  add("--robust", method.robust_scale,
      "Weighs pixels of other colours (clutter, occlusion) hardly at all: those that differ by more than the "
      "number; without one it follows from the residuals",
      "[FLOAT]")
      ->expected(0, 1);
  command
      .add_flag(
          "--unknown-background", method.unknown_background,
          "Anything may lie behind the object, as in a photograph: nothing is compared with the scene's "
          "background. With --box, colours that are seen beside the box alone are the background's. Implies "
          "--robust")
      ->group(group);
  add("--light", options.light,
      "Light of the target: harmonics, by default, finds any distant light, gain one that differs in colour "
      "and brightness alone, where the scene's own light does not explain the target; fixed does not look",
      "harmonics|gain|fixed");
  add("--mask", options.mask,
      "Image whose first channel is the weight of every pixel, in [0, 1], in all comparisons: what lies "
      "outside is not looked at",
      "MASK.png");
}

void add_observation_weights(CLI::App& command, const char* group, LeastSquares& method,
                             std::optional<float>& depth_scale) {
  const auto add = [&](const char* name, auto& value, const char* description) {
    command.add_option(name, value, description)->group(group)->type_name("FLOAT");
  };
  add("--silhouette-weight", method.silhouette.weight,
      "Factor on the weight that the residuals give silhouettes, their inverse variance; 1 by default");
  add("--depth-scale", depth_scale,
      "Length of a 1 of depth files, in the scene's units: 0.001 for 16-bit PNGs of millimetres and a scene "
      "in metres; files of whole numbers need one");
  add("--depth-weight", method.depth.weight,
      "Factor on the weight that the residuals give depths; 1 by default");
}

LeastSquares read_least_squares(const CLI::App& command, const LeastSquaresOptions& options) {
  const auto is_given = [&](const std::string& name) {
    const CLI::Option* const option = command.get_option_no_throw(name);
    return option != nullptr && option->count() > 0;
  };
  for (const std::string image : {"--silhouette", "--depth"}) {
    if (is_given(image + "-weight") && !is_given(image) && !is_given("--views"))
      throw InvalidArgument(image + "-weight (command line)", "no " + image, "the images that it weighs");
  }
  LeastSquares method = options.method;
  method.robust = command.count("--robust") > 0 || method.unknown_background;
  method.light = static_cast<PoseLight>(position_of(options.light, light_names(), "--light (command line)"));
  return method;
}

void add_descent_options(CLI::App& command, const char* group, DescentOptions& options) {
  Descent& method = options.method;
  const auto add = [&](const char* name, auto& value, const char* description, const char* type) {
    return command.add_option(name, value, description)->group(group)->type_name(type);
  };
  add("--loss", options.loss, "Loss that is made small; mse by default", joined(loss_names()).c_str());
  add("--iterations", method.iterations, "Steps; 200 by default, 800 with --schedule adaptive", "N");
  add("--restarts", method.restarts, "Further descents while the target is not explained; 6 by default", "N");
  add("--optimizer", options.optimizer, "Optimizer of the steps; adam by default", "adam|sgd");
  add("--schedule", options.schedule,
      "Way the smoothing shrinks: in fixed steps from coarse to fine, or by the paper's adaptive schedule; "
      "anneal by default",
      "anneal|adaptive");
  add("--learning-rate", method.optimizer.learning_rate, "Size of the first steps; 0.05 by default", "FLOAT");
}

Descent read_descent(const CLI::App& command, const DescentOptions& options) {
  static constexpr std::array<std::string_view, 2> k_optimizers{"adam", "sgd"};
  constexpr unsigned k_adaptive_iterations = 800;  // the paper's schedule takes a tenth off every 50
  Descent method = options.method;
  method.loss = LossWeights::only(parse_loss(options.loss, "--loss"));
  const std::size_t optimizer = position_of(options.optimizer, k_optimizers, "--optimizer (command line)");
  method.optimizer.kind = std::array{OptimizerKind::adam, OptimizerKind::sgd}[optimizer];
  if (is_adaptive_schedule(options.schedule)) {
    method.schedule = AdaptiveSchedule{};
    if (command.count("--iterations") == 0) method.iterations = k_adaptive_iterations;
  }
  return method;
}

}  // namespace dpr::cli
