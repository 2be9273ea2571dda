// dpr pose: the pose of an object from one image.
#include <array>
#include <cstdio>
#include <memory>
#include <optional>
#include <utility>

#include "base/input_file.hpp"
#include "base/name_list.hpp"
#include "base/output_file.hpp"
#include "cli/bop.hpp"
#include "cli/commands.hpp"
#include "cli/file_options.hpp"
#include "cli/moving_meshes.hpp"
#include "cli/option_names.hpp"
#include "cli/picture_camera.hpp"
#include "cli/pose_options.hpp"
#include "cli/pose_pictures.hpp"
#include "cli/pose_report.hpp"
#include "cli/pose_views.hpp"
#include "cli/provenance.hpp"
#include "cli/text.hpp"
#include "dpr/error.hpp"
#include "solve/pose_body.hpp"

namespace dpr::cli {
namespace {

const char* const k_least_squares_group = "Least squares (--method least_squares, the default)";
const char* const k_descent_group =
    "Descent (--method descent; any of these, or of the smoothing's, implies it)";

struct PoseCommandOptions {
  std::string scene, views, camera, initial_rotation, loss = "mse", optimizer = "adam", schedule = "anneal",
                                                      output, report;
  std::vector<std::string> meshes;  // of each body
  PosePictureFiles pictures;
  BopOptions bop;  // no folder: a scene
  std::optional<std::string> method, box;
  bool search = false, moving = false, exif_focal = false;
  PoseOptions solver;
  LeastSquaresOptions least_squares;
  DescentOptions descent;
};

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
    options.solver.method = options.least_squares.method = read_least_squares(command, options.least_squares);
    return;
  }
  if (options.search || gives_any(command, k_least_squares_group)) {
    throw InvalidArgument("options (command line)",
                          options.search ? "--search beside options of the descent"
                                         : "options of least squares beside those of the descent",
                          "options of one method: --search is least squares', --method descent and all of "
                          "the smoothing are the descent's");
  }
  options.solver.method = options.descent.method = read_descent(command, options.descent);
}

const char* const k_turn = "--initial-rotation (command line)";

/// The poses of all bodies, [body], from that rotation if there is one.
std::vector<FoundBody> solve(const CLI::App& command, PoseCommandOptions& options,
                             const std::optional<glm::dmat3>& rotation, const Device& device,
                             const Scene& scene, const Image& target, const PoseBodies& bodies, bool quiet) {
  if (rotation && bodies.size() > 1)
    throw InvalidArgument(k_turn, "one beside several --mesh", "none, or one --mesh");
  const auto named = [&](const auto& work) {
    return with_option_names(command, k_least_squares_names, work);
  };
  PoseOptions first = options.solver;
  first.meshes = bodies.front();
  const PoseSolver solver = named([&] { return PoseSolver(device, scene, target, first); });
  if (!options.report.empty()) make_folder(options.report);
  const PoseSolver::Callback callback =
      progress_callback(solver.most_iterations(), quiet, bodies.size() > 1 ? "object" : "");
  if (bodies.size() > 1) {
    const auto find = options.search ? search_bodies : solve_bodies;
    std::vector<FoundBody> found;
    for (PoseResult& result :
         named([&] { return find(device, scene, target, bodies, options.solver, callback); }))
      found.push_back({bodies[found.size()], std::move(result)});
    return found;
  }
  if (options.search) return {{bodies.front(), solver.search(callback)}};
  Pose initial = solver.scene_pose();
  if (rotation) initial.rotation = *rotation;
  return {{bodies.front(), solver.solve(initial, callback)}};
}

/// Options that were not given and may help if the target is not explained.
std::string advice(const CLI::App& command, const PoseCommandOptions& options) {
  std::string text;
  const auto add = [&](const char* option, const char* why) {
    if (command.count(option) == 0) text += std::string(text.empty() ? "" : "; ") + option + " " + why;
  };
  add("--search", "forgets the start");
  if (!options.solver.solve_translation) add("--translation", "finds a displaced object");
  if (options.meshes.size() < 2) {
    add("--focal", "finds an unknown focal length");
    add("--distortion", "finds a lens");
  }
  if (!options.least_squares.method.unknown_background) add("--robust", "is for clutter and occlusion");
  if (!options.pictures.target.empty() && options.pictures.silhouette.empty())
    add("--unknown-background", "is for photographs");
  if (options.least_squares.light == name_of(PoseLight::fixed))
    text += (text.empty() ? "" : "; ") + std::string("--light harmonics for another light");
  return text.empty() ? "" : ": " + text;
}

void print(const CLI::App& command, const PoseCommandOptions& options, const std::vector<FoundBody>& found) {
  for (const FoundBody& body : found) {
    const PoseResult& result = body.result;
    std::printf("%s%s: loss %.6g after %u iterations, %.1f s\n", options.output.c_str(),
                suffix_of(body, found.size()).c_str(), result.loss, result.iterations, result.seconds);
    if (!result.explained) {
      std::printf("The target is not explained: %s. The pose may be wrong%s.\n", doubt_text(result).c_str(),
                  advice(command, options).c_str());
    } else if (result.equals.size() > 1) {
      std::printf("%zu poses that explain the target equally well are in the file.\n", result.equals.size());
    }
  }
}

/// What an image of BOP's brings for options that are not given.
BopImage begin_bop(const CLI::App& command, PoseCommandOptions& options) {
  for (const char* const needed : {"--image", "--object"}) {
    if (command.count(needed) == 0)
      throw InvalidArgument(std::string(needed) + " (command line)", "none", "its number, beside --bop");
  }
  BopImage image = read_bop_image(options.bop);
  PosePictureFiles& files = options.pictures;
  if (files.target.empty() && files.silhouette.empty() && files.depth.empty())
    files.target = bop_picture(options.bop);
  if (!files.depth.empty() && !files.depth_scale) files.depth_scale = image.depth_scale;
  options.solver.solve_translation = true;
  return image;
}

bool writes_csv(const PoseCommandOptions& options) { return lower_case_extension(options.output) == ".csv"; }

void check_scene_options(const CLI::App& command, const PoseCommandOptions& options) {
  if (options.scene.empty() == options.bop.folder.empty()) {
    throw InvalidArgument("--scene (command line)", options.scene.empty() ? "none" : "one beside --bop",
                          "a scene file, or a folder of BOP's with --bop");
  }
  for (const char* const of_bop : {"--image", "--object", "--models"})
    if (options.bop.folder.empty() && command.count(of_bop) > 0)
      throw InvalidArgument(std::string(of_bop) + " (command line)", "no --bop",
                            "the folder of its data set");
  if (!writes_csv(options)) return;
  if (options.bop.folder.empty())
    throw InvalidArgument("--output (command line)", "a .csv without --bop", "a .json file");
  bop_scene_number(options.bop.folder);
}

/// The box of --box, which is in pixels of the picture as given, in the scene's.
PoseBox scaled_box(const std::string& text, glm::ivec2 picture, const Scene& scene) {
  const glm::vec4 box = parse_box(text, "--box (command line)");
  const glm::vec2 factor = glm::vec2(scene.width, scene.height) / glm::vec2(picture);
  return {box.x * factor.x, box.y * factor.y, box.z * factor.x, box.w * factor.y};
}

/// The scene in the pictures' size, with the camera that took them; the pictures are scaled to its size.
Scene read_photographed_scene(PoseCommandOptions& options, const std::optional<BopImage>& bop,
                              const CommonOptions& common, ObservedPictures& pictures) {
  const glm::ivec2 picture = pictures.size();
  Notes notes;
  Scene scene;
  if (bop) {
    scene = bop_scene(options.bop, *bop, picture, !options.search, notes);
    apply(common, scene);
  } else {
    scene = read_scene(options.scene, common, picture);
  }
  if (!options.camera.empty()) take_opencv_camera(scene, options.camera, picture);
  if (options.exif_focal) take_exif_focal(scene, pictures.focal_35mm, options.pictures.target, notes);
  scale_pictures(pictures, options.pictures, scene, notes);
  print_notes(notes, common);
  if (options.box)
    std::get<LeastSquares>(options.solver.method).box = scaled_box(*options.box, picture, scene);
  return scene;
}

/// Hands what is compared beside colours to the method, and returns the image of colours, empty without one.
Image observe(ObservedPictures pictures, PoseCommandOptions& options) {
  if (auto* method = std::get_if<LeastSquares>(&options.solver.method)) {
    if (method->unknown_background && pictures.target.pixels.empty())
      throw InvalidArgument("--unknown-background (command line)", "no --target",
                            "one, whose background it is");
    method->mask = std::move(pictures.mask);
    method->silhouette.image = std::move(pictures.silhouette);
    method->depth.image = std::move(pictures.depth);
    options.least_squares.method = *method;
  }
  if (pictures.target.pixels.empty() && !options.report.empty())
    throw InvalidArgument("--report (command line)", "no --target", "one, which it shows beside the result");
  return std::move(pictures.target);
}

/// What belongs to a single picture, beside --views.
void run_views(const CLI::App& command, PoseCommandOptions& options, const CommonOptions& common) {
  for (const char* const other : {"--target", "--mask", "--silhouette", "--depth", "--depth-scale", "--box",
                                  "--camera", "--exif-focal", "--bop", "--initial-rotation", "--size"}) {
    if (command.count(other) > 0) {
      throw InvalidArgument(std::string(other) + " (command line)", "one beside --views",
                            "none: the views file has pictures, cameras, masks and depths");
    }
  }
  choose_method(command, options);
  const SceneOfViews in = read_scene_of_views(options.scene, options.views, common);
  require_outputs({options.output}, options.report);
  with_option_names(command, k_least_squares_names, [&] {
    find_poses_in_views({options.views, options.output, options.report, options.meshes, options.moving,
                         options.search ? PoseStart::unknown : PoseStart::scene, options.solver},
                        in, common);
  });
}

void run(const CLI::App& command, PoseCommandOptions& options, const CommonOptions& common) {
  check_scene_options(command, options);
  if (!options.views.empty()) return run_views(command, options, common);
  if (options.moving)
    throw InvalidArgument("--moving (command line)", "one without --views", "--views, which names pictures");
  std::optional<glm::dmat3> rotation;
  if (!options.initial_rotation.empty())
    rotation = rotation_from_vector(parse_vector(options.initial_rotation, k_turn));
  std::optional<BopImage> bop;
  if (!options.bop.folder.empty()) bop = begin_bop(command, options);
  choose_method(command, options);
  options.pictures.mask = options.least_squares.mask;
  ObservedPictures pictures = read_pictures(options.pictures, options.descent.method.loss, common.encoding());
  const Scene scene = read_photographed_scene(options, bop, common, pictures);
  const Image target = observe(std::move(pictures), options);
  const PoseBodies bodies = parse_moving_meshes(options.meshes, scene);
  require_outputs({options.output}, options.report);
  const Device device = open_device(common);
  const std::vector<FoundBody> found =
      solve(command, options, rotation, device, scene, target, bodies, common.quiet);
  const BopInstance* const truth = bop ? nearest_instance(*bop, found.front().result.pose) : nullptr;
  const std::optional<glm::dmat3> true_rotation =
      truth != nullptr ? std::optional(truth->pose.rotation) : std::nullopt;
  const PoseTarget observed{target, options.least_squares.method};
  const bool is_table = writes_csv(options);
  FoundLight light;
  if (!is_table || !options.report.empty()) light = light_of(device, scene, found, observed);
  if (is_table) {
    write_bop_result(options.output, options.bop, found.front().result);
  } else {
    Json json = poses_to_json(scene, found, true_rotation);
    add_light(json, light);
    if (truth != nullptr) json["gt_id"] = truth->gt_id;
    write_json(options.output, json);
  }
  if (!options.report.empty()) {
    const auto source = bop ? bop_scene_folder(options.bop.folder) : std::filesystem::path(options.scene);
    const std::string title = "The pose of " + source.filename().string();
    write_pose_report(options.report, page_source(title, common, {&device, 1}), device, scene, found,
                      observed, light, common.quiet, true_rotation);
  }
  if (common.quiet) return;
  print(command, options, found);
  if (truth != nullptr) print_reference(*bop, *truth, found.front().result.pose);
}

/// Those that are a single image's beside the shared ones.
void add_least_squares_options(CLI::App& command, PoseCommandOptions& options) {
  add_least_squares_options(command, k_least_squares_group, options.least_squares);
  LeastSquares& method = options.least_squares.method;
  const auto add = [&](const char* name, auto& value, const char* description, const char* type) {
    return command.add_option(name, value, description)->group(k_least_squares_group)->type_name(type);
  };
  add("--blur-end", method.blur_end, "The blur at the very end; 0.1 by default", "FLOAT");
  add("--box", options.box,
      "Box about the object in the picture, in pixels as given, from its upper left corner: what lies "
      "further away than a quarter of the larger side is not looked at, and with --translation poses are "
      "tried that fill the box",
      "X,Y,W,H");
  add("--silhouette", options.pictures.silhouette,
      "Image of where the object is, 1, and where it is not, 0, which the render's coverage should match: in "
      "its alpha, if that is below 1 anywhere, or else in its first channel. Beside --target, or without",
      "IMAGE");
  add("--depth", options.pictures.depth,
      "Image whose first channel is the distance along the camera's axis, as --aov depth of dpr render "
      "--preset rigid writes it; 0 or NaN where it is not known. Beside --target, or without: then of the "
      "object alone, and 0 elsewhere",
      "DEPTH.exr");
  add_observation_weights(command, k_least_squares_group, method, options.pictures.depth_scale);
  command
      .add_flag("--focal", options.solver.solve_focal, "Look for a factor on the camera's focal length too")
      ->group(k_least_squares_group);
  command
      .add_flag("--distortion", options.solver.solve_distortion,
                "Look for the lens' k1 and k2 too, from the scene's or none")
      ->group(k_least_squares_group);
}

void add_camera_options(CLI::App& command, PoseCommandOptions& options) {
  CLI::Option* camera =
      command
          .add_option(
              "--camera", options.camera,
              "Camera matrix and distortion, in place of the scene's, as OpenCV's calibration writes them "
              "(YAML)")
          ->type_name("CAMERA.yml");
  command
      .add_flag("--exif-focal", options.exif_focal,
                "Focal length as the target's file says (Exif's for 35-mm film), in place of the scene's")
      ->excludes(camera);
}

}  // namespace

void add_pose_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand(
      "pose", "Finds the pose of an object from one image, a silhouette or depths");
  const auto options = std::make_shared<PoseCommandOptions>();
  command->add_option("--scene", options->scene, "Scene file")->type_name("S.json");
  command
      ->add_option(
          "--target", options->pictures.target,
          "Image that shows the pose; may be left out with --silhouette or --depth. Pictures larger than "
          "the scene are scaled to its size (masks and depths by medians), a scene without width and height "
          "takes the picture's size")
      ->type_name("T.exr");
  command
      ->add_option(
          "--mesh", options->meshes,
          "Numbers of the scene's meshes, from 0, that move together as one object: the pose is that of the "
          "first. Given several times, each is an object with a pose of its own. The rest stand still as the "
          "scene has them, in front of the objects or behind them. Needed where the scene has several meshes")
      ->allow_extra_args(false)
      ->type_name("N[,N...]");
  command
      ->add_option(
          "--views", options->views,
          "Pictures in place of --target, with cameras, masks, depths and silhouettes, in the format of "
          "dpr fit: all show the object in the same pose")
      ->type_name("V.json");
  command->add_flag(
      "--moving", options->moving,
      "The object has a pose of its own in each of the views: it begins where the scene has it, before that "
      "view's camera. --focal and --distortion look for one focal length and lens of all");
  add_camera_options(*command, *options);
  CLI::Option* initial =
      command
          ->add_option(
              "--initial-rotation", options->initial_rotation,
              "Rotation vector of the object-to-world rotation to start from, in radians (default: the "
              "rotation of the scene's transform); of poses that explain the target equally well the "
              "nearest to it is the result")
          ->type_name("RX,RY,RZ");
  command
      ->add_flag(
          "--search", options->search,
          "Nothing is known of the rotation, nor with --translation of the place: the object may be "
          "anywhere in the picture, where it differs from the scene's background first, at half to twice "
          "the distance of the scene's, or with --box, --silhouette or --mask where it fills these")
      ->excludes(initial);
  command->add_flag("--translation", options->solver.solve_translation, "Look for the translation too");
  command->add_option("--method", options->method, "Method that finds the pose; least_squares by default")
      ->type_name("least_squares|descent");
  command->add_option("-o,--output", options->output, "Pose to write")->required()->type_name("P.json");
  command
      ->add_option("--report", options->report,
                   "Folder for pictures, plots and a page that shows them beside --target; of --views one "
                   "for each picture")
      ->type_name("DIR");
  add_bop_options(*command, options->bop);
  add_least_squares_options(*command, *options);
  add_descent_options(*command, k_descent_group, options->descent);
  add_common_options(*command, common);
  command->footer(
      "Example: dpr pose --scene scene.json --target target.exr --search -o pose.json --report report");
  command->callback([command, options, &common] { run(*command, *options, common); });
}

}  // namespace dpr::cli
