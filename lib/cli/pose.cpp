// dpr pose: the pose of an object from one image.
#include <cstdio>
#include <memory>
#include <optional>

#include "cli/commands.hpp"
#include "cli/pose_report.hpp"
#include "cli/text.hpp"
#include "dpr/error.hpp"
#include "scene/temporary_file.hpp"

namespace dpr::cli {
namespace {

struct PoseCommandOptions {
  std::string scene, target, initial_rotation, loss = "mse", optimizer = "adam", schedule = "anneal", output,
                                               report;
  PoseOptions solver;
};

OptimizerKind parse_optimizer(const std::string& word) {
  if (word == "adam") return OptimizerKind::adam;
  if (word == "sgd") return OptimizerKind::sgd;
  throw InvalidArgument("--optimizer (command line)", "\"" + word + "\"", "adam or sgd");
}

std::variant<AnnealSchedule, AdaptiveSchedule> parse_schedule(const std::string& word) {
  if (word == "anneal") return AnnealSchedule{};
  if (word == "adaptive") return AdaptiveSchedule{};
  throw InvalidArgument("--schedule (command line)", "\"" + word + "\"", "anneal or adaptive");
}

void run(PoseCommandOptions& options, const CommonOptions& common) {
  // What can be wrong about the output is found out before the work, not after it.
  { const TemporaryFile writable(options.output); }
  if (!options.report.empty()) make_folder(options.report);
  std::optional<glm::dmat3> rotation;
  if (!options.initial_rotation.empty()) {
    rotation =
        rotation_from_vector(parse_vector(options.initial_rotation, "--initial-rotation (command line)"));
  }
  const Scene scene = read_scene(options.scene, common);
  const Image target = read_image(options.target);
  options.solver.loss = LossWeights::only(parse_loss(options.loss, "--loss"));
  options.solver.optimizer.kind = parse_optimizer(options.optimizer);
  options.solver.schedule = parse_schedule(options.schedule);

  const Device device = open_device(common);
  const PoseSolver solver(device, scene, target, options.solver);
  Pose initial = solver.scene_pose();
  if (rotation) initial.rotation = *rotation;
  const PoseResult result = solver.solve(initial, progress_callback(options.solver.iterations, common.quiet));
  write_json(options.output, pose_to_json(result));
  if (!options.report.empty()) write_pose_report(options.report, device, scene, target, result, common.quiet);
  if (!common.quiet) {
    std::printf("%s: %s loss %.6g after %u iterations, %.1f s\n", options.output.c_str(),
                options.loss.c_str(), result.loss, result.iterations, result.seconds);
    if (!result.explained) {
      std::printf("The target is not explained: the loss stayed above %g of the initial pose's.\n",
                  options.solver.explained);
    }
  }
}

void add_solver_options(CLI::App& command, PoseCommandOptions& options) {
  PoseOptions& solver = options.solver;
  command.add_flag("--translation", solver.solve_translation, "Look for the translation too");
  command.add_option("--loss", options.loss, "What is made small; mse by default")
      ->type_name("mse|l1|silhouette");
  command.add_option("--iterations", solver.iterations, "How many steps; 200 by default")->type_name("N");
  command
      .add_option("--restarts", solver.restarts,
                  "Further descents while the target is not explained; 6 by default")
      ->type_name("N");
  command.add_option("--optimizer", options.optimizer, "How steps are made; adam by default")
      ->type_name("adam|sgd");
  command
      .add_option("--schedule", options.schedule,
                  "How the smoothing shrinks: in fixed steps from coarse to fine, or by the paper's adaptive "
                  "schedule; anneal by default")
      ->type_name("anneal|adaptive");
  command
      .add_option("--learning-rate", solver.optimizer.learning_rate,
                  "Size of the first steps; 0.05 by default")
      ->type_name("FLOAT");
}

}  // namespace

void add_pose_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command =
      application.add_subcommand("pose", "Finds the pose of a scene's only mesh from one image");
  const auto options = std::make_shared<PoseCommandOptions>();
  command->add_option("--scene", options->scene, "Scene file")->required()->type_name("S.json");
  command->add_option("--target", options->target, "Image that shows the pose")
      ->required()
      ->type_name("T.exr");
  command
      ->add_option("--initial-rotation", options->initial_rotation,
                   "Rotation vector of the object-to-world rotation to start from, in radians (default: the "
                   "rotation of the scene's transform)")
      ->type_name("RX,RY,RZ");
  command->add_option("-o,--output", options->output, "Pose to write")->required()->type_name("P.json");
  command->add_option("--report", options->report, "Folder for pictures and plots")->type_name("DIR");
  add_solver_options(*command, *options);
  add_common_options(*command, common);
  command->footer(
      "Example: dpr pose --scene scene.json --target target.exr --initial-rotation 0.5,0,0 -o pose.json");
  command->callback([options, &common] { run(*options, common); });
}

}  // namespace dpr::cli
