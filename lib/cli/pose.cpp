// dpr pose: the pose of an object from one image.
#include <array>
#include <cstdio>
#include <memory>
#include <optional>

#include "base/name_list.hpp"
#include "base/output_file.hpp"
#include "cli/commands.hpp"
#include "cli/option_names.hpp"
#include "cli/pose_report.hpp"
#include "cli/provenance.hpp"
#include "cli/target.hpp"
#include "cli/text.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

const char* const k_least_squares_group = "Least squares (--method least_squares, the default)";
const char* const k_descent_group =
    "Descent (--method descent; any of these, or of the smoothing's, implies it)";

/// Iterations of the paper's schedule, which shrinks the smoothing by a tenth every 50 iterations.
constexpr unsigned k_adaptive_iterations = 800;

struct PoseCommandOptions {
  std::string scene, target, initial_rotation, mask, silhouette, depth,
      loss = "mse", optimizer = "adam", schedule = "anneal", light = "harmonics", output, report;
  std::optional<std::string> method;
  std::optional<float> depth_scale;
  bool search = false;
  PoseOptions solver;
  LeastSquares least_squares;
  Descent descent;
};

PoseLight parse_light(const std::string& word) {
  return static_cast<PoseLight>(position_of(word, light_names(), "--light (command line)"));
}

OptimizerKind parse_optimizer(const std::string& word) {
  static constexpr std::array<std::string_view, 2> names{"adam", "sgd"};
  return std::array{OptimizerKind::adam,
                    OptimizerKind::sgd}[position_of(word, names, "--optimizer (command line)")];
}

/// The method that is asked for, by name or by an option that only one of them has.
bool wants_descent(const CLI::App& command, const std::optional<std::string>& method) {
  const bool descends = gives_any(command, k_descent_group) || gives_any(command, k_smoothing_group);
  if (!method) return descends;
  if (*method != "least_squares" && *method != "descent") {
    throw InvalidArgument("--method (command line)", "\"" + *method + "\"", "least_squares or descent");
  }
  if (*method == "least_squares" && descends) {
    throw InvalidArgument("--method (command line)", "least_squares with an option of the descent's",
                          "--method descent, or none of its options");
  }
  return *method == "descent";
}

void choose_method(const CLI::App& command, PoseCommandOptions& options) {
  if (!wants_descent(command, options.method)) {
    if (!options.mask.empty())
      options.least_squares.mask = read_image(options.mask, nullptr, Encoding::linear);
    options.least_squares.robust = command.count("--robust") > 0;
    options.least_squares.light = parse_light(options.light);
    options.solver.method = options.least_squares;
    return;
  }
  if (options.search || gives_any(command, k_least_squares_group)) {
    throw InvalidArgument(
        "options (command line)",
        options.search ? "--search with those of the descent"
                       : "those of least squares with those of the descent",
        "those of one method: all of the smoothing are the descent's, --search is least squares'");
  }
  options.descent.loss = LossWeights::only(parse_loss(options.loss, "--loss"));
  options.descent.optimizer.kind = parse_optimizer(options.optimizer);
  if (is_adaptive_schedule(options.schedule)) {
    options.descent.schedule = AdaptiveSchedule{};
    if (command.count("--iterations") == 0) options.descent.iterations = k_adaptive_iterations;
  }
  options.solver.method = options.descent;
}

PoseResult solve(const PoseSolver& solver, const std::optional<glm::dmat3>& rotation, bool search,
                 bool quiet) {
  const PoseSolver::Callback callback = progress_callback(solver.most_iterations(), quiet);
  if (search) return solver.search(callback);
  Pose initial = solver.scene_pose();
  if (rotation) initial.rotation = *rotation;
  return solver.solve(initial, callback);
}

/// Options that were not given and may help if the target is not explained.
std::string advice(const CLI::App& command, const PoseCommandOptions& options) {
  std::string text;
  const auto add = [&](const char* option, const char* why) {
    if (command.count(option) == 0) text += std::string(text.empty() ? "" : "; ") + option + " " + why;
  };
  add("--search", "forgets the start");
  add("--translation", "finds a displaced object");
  add("--focal", "an unknown focal length");
  add("--distortion", "a lens");
  add("--robust", "is for clutter and occlusion");
  if (options.light == name_of(PoseLight::fixed))
    text += (text.empty() ? "" : "; ") + std::string("--light harmonics for another light");
  return text.empty() ? "" : ": " + text;
}

void print(const CLI::App& command, const PoseCommandOptions& options, const PoseResult& result) {
  std::printf("%s: loss %.6g after %u iterations, %.1f s\n", options.output.c_str(), result.loss,
              result.iterations, result.seconds);
  if (!result.explained) {
    std::printf(
        "The target is not explained: the loss stayed above %s of what wrong poses leave, or a picture "
        "without the object, or another pose leaves little more. The pose may be wrong%s.\n",
        command.count("--robust") == 0 ? "a tenth" : "a third", advice(command, options).c_str());
  } else if (result.equals.size() > 1) {
    std::printf("%zu poses that explain the target equally well are in the file.\n", result.equals.size());
  }
}

/// Reads what is compared beside colours; returns the image of these, empty without one.
Image read_observations(PoseCommandOptions& options, const CommonOptions& common, const Scene& scene) {
  if (options.depth_scale && options.depth.empty())
    throw InvalidArgument("--depth-scale (command line)", "no --depth", "the file whose unit it is");
  if (auto* method = std::get_if<LeastSquares>(&options.solver.method)) {
    if (!options.silhouette.empty()) method->silhouette.image = read_silhouette(options.silhouette, scene);
    if (!options.depth.empty()) method->depth.image = read_depth(options.depth, options.depth_scale, scene);
  }
  if (!options.target.empty())
    return read_target(options.target, options.descent.loss, common.encoding(), scene);
  if (options.silhouette.empty() && options.depth.empty()) {
    throw InvalidArgument("--target (command line)", "none",
                          "an image that shows the pose, or --silhouette, or --depth");
  }
  if (!options.report.empty())
    throw InvalidArgument("--report (command line)", "no --target", "one, which it shows beside the result");
  return {};
}

void run(const CLI::App& command, PoseCommandOptions& options, const CommonOptions& common) {
  // The outputs are checked before the work.
  require_writable(options.output);
  std::optional<glm::dmat3> rotation;
  if (!options.initial_rotation.empty()) {
    rotation =
        rotation_from_vector(parse_vector(options.initial_rotation, "--initial-rotation (command line)"));
  }
  choose_method(command, options);
  const Scene scene = read_scene(options.scene, common);
  const Image target = read_observations(options, common, scene);
  const Device device = open_device(common);
  const PoseSolver solver = with_option_names(command, {{"iterations", "--level-iterations"}}, [&] {
    return PoseSolver(device, scene, target, options.solver);
  });
  if (!options.report.empty()) make_folder(options.report);
  const PoseResult result = solve(solver, rotation, options.search, common.quiet);
  Json json = pose_to_json(scene, result);
  add_light(json, device, scene, target, result, options.least_squares);
  write_json(options.output, json);
  if (!options.report.empty()) {
    const std::string title = "The pose of " + std::filesystem::path(options.scene).filename().string();
    write_pose_report(options.report, page_source(title, common, {&device, 1}), device, scene, target, result,
                      common.quiet);
  }
  if (!common.quiet) print(command, options, result);
}

void add_least_squares_options(CLI::App& command, PoseCommandOptions& options) {
  LeastSquares& method = options.least_squares;
  const auto add = [&](const char* name, auto& value, const char* description, const char* type) {
    return command.add_option(name, value, description)->group(k_least_squares_group)->type_name(type);
  };
  add("--rotations", method.rotations,
      "Rotations tried at the coarsest level; 0: only the initial one; 1152 by default", "N");
  add("--coarsest", method.coarsest, "Pixels on the short side of the coarsest level; 16 by default", "N");
  add("--level-iterations", method.iterations,
      "Steps a level, more while the best pose still improves; 10 by default", "N");
  add("--blur", method.blur, "Blur of the edges, in pixels of the level; 0.25 by default", "FLOAT");
  add("--blur-end", method.blur_end, "The same at the very end; 0.1 by default", "FLOAT");
  add("--robust", method.robust_scale,
      "Weighs pixels of other colours (clutter, occlusion) hardly at all; a number is the colour difference "
      "from which on, else the residuals tell",
      "[FLOAT]")
      ->expected(0, 1);
  command
      .add_option(
          "--light", options.light,
          "Light of the target: harmonics, by default, finds any distant light, gain one that differs in "
          "colour "
          "and brightness alone, where the scene's own light does not explain the target; fixed does not "
          "look")
      ->group(k_least_squares_group)
      ->type_name("harmonics|gain|fixed");
  add("--mask", options.mask,
      "Image whose first channel is the weight of every pixel, in [0, 1], in all comparisons: what lies "
      "outside is not looked at",
      "MASK.png");
  add("--silhouette", options.silhouette,
      "Image of where the object is, 1, and where it is not, 0, which the render's coverage should match: in "
      "its alpha, if that is below 1 anywhere, or else in its first channel. Beside --target, or without",
      "IMAGE");
  add("--silhouette-weight", method.silhouette.weight,
      "Factor on the weight that the residuals give it, their inverse variance; 1 by default", "FLOAT");
  add("--depth", options.depth,
      "Image whose first channel is the distance along the camera's axis, as --aov depth of dpr render "
      "writes it; 0 or NaN where it is not known. Beside --target, or without",
      "DEPTH.exr");
  add("--depth-scale", options.depth_scale,
      "Length of a 1 of that file, in the scene's units: 0.001 for a 16-bit PNG of millimetres and a scene "
      "in metres; files of whole numbers need one",
      "FLOAT");
  add("--depth-weight", method.depth.weight, "Factor on the weight that the residuals give it; 1 by default",
      "FLOAT");
  command
      .add_flag("--focal", options.solver.solve_focal, "Look for a factor on the camera's focal length too")
      ->group(k_least_squares_group);
  command
      .add_flag("--distortion", options.solver.solve_distortion,
                "Look for the lens' k1 and k2 too, from the scene's or none")
      ->group(k_least_squares_group);
}

void add_descent_options(CLI::App& command, PoseCommandOptions& options) {
  Descent& method = options.descent;
  const auto add = [&](const char* name, auto& value, const char* description, const char* type) {
    return command.add_option(name, value, description)->group(k_descent_group)->type_name(type);
  };
  add("--loss", options.loss, "Loss that is made small; mse by default", joined(loss_names()).c_str());
  add("--iterations", method.iterations, "Steps; 200 by default, 800 with --schedule adaptive", "N");
  add("--restarts", method.restarts, "Further descents while the target is not explained; 6 by default", "N");
  add("--optimizer", options.optimizer, "Optimizer of the steps; adam by default", "adam|sgd");
  add("--schedule", options.schedule,
      "Way the smoothing shrinks: in fixed steps from coarse to fine, or by the paper's adaptive schedule; "
      "anneal by "
      "default",
      "anneal|adaptive");
  add("--learning-rate", method.optimizer.learning_rate, "Size of the first steps; 0.05 by default", "FLOAT");
}

}  // namespace

void add_pose_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand(
      "pose", "Finds the pose of a scene's only mesh from one image, a silhouette or depths");
  const auto options = std::make_shared<PoseCommandOptions>();
  command->add_option("--scene", options->scene, "Scene file")->required()->type_name("S.json");
  command
      ->add_option("--target", options->target,
                   "Image that shows the pose; may be left out with --silhouette or --depth")
      ->type_name("T.exr");
  CLI::Option* initial =
      command
          ->add_option(
              "--initial-rotation", options->initial_rotation,
              "Rotation vector of the object-to-world rotation to start from, in radians (default: the "
              "rotation of the scene's transform); of poses that explain the target equally well the "
              "nearest to it is the result")
          ->type_name("RX,RY,RZ");
  command->add_flag("--search", options->search, "Nothing is known of the rotation")->excludes(initial);
  command->add_flag("--translation", options->solver.solve_translation, "Look for the translation too");
  command->add_option("--method", options->method, "Method that finds the pose; least_squares by default")
      ->type_name("least_squares|descent");
  command->add_option("-o,--output", options->output, "Pose to write")->required()->type_name("P.json");
  command->add_option("--report", options->report, "Folder for pictures, plots and a page that shows them")
      ->type_name("DIR");
  add_least_squares_options(*command, *options);
  add_descent_options(*command, *options);
  add_common_options(*command, common);
  command->footer(
      "Example: dpr pose --scene scene.json --target target.exr --search -o pose.json --report report");
  command->callback([command, options, &common] { run(*command, *options, common); });
}

}  // namespace dpr::cli
