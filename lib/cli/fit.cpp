// dpr fit: a mesh with vertex colours from several images with known cameras, or a template bent to
// photographs whose cameras are found first.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <memory>
#include <optional>

#include "base/checks.hpp"
#include "base/clock.hpp"
#include "base/input_file.hpp"
#include "cli/commands.hpp"
#include "cli/file_options.hpp"
#include "cli/fit_explained.hpp"
#include "cli/fit_report.hpp"
#include "cli/option_names.hpp"
#include "cli/progress.hpp"
#include "cli/provenance.hpp"
#include "cli/text.hpp"
#include "cli/views_file.hpp"
#include "dpr/error.hpp"
#include "dpr/photographs.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/texture_atlas.hpp"
#include "scene/scene_json.hpp"
#include "solve/resample.hpp"
#include "solve/shape_views.hpp"

namespace dpr::cli {
namespace {

const char* const k_solver_group = "Solver";
const char* const k_loss_group = "Loss (weights)";

struct FitCommandOptions {
  std::string views, initial, output, saved_views, report, checkpoint, steps = "large", schedule = "anneal",
                                                                       light;
  std::optional<int> texture;  // texels on a side
  ShapeOptions solver;
};

ShapeSteps parse_steps(const std::string& word) {
  if (word == "large") return ShapeSteps::large_steps;
  if (word == "direct") return ShapeSteps::direct;
  throw InvalidArgument("--steps (command line)", "\"" + word + "\"", "large or direct");
}

void resize(ShapeViews& views, glm::ivec2 size) {
  if (std::int64_t{size.x} * views.height != std::int64_t{size.y} * views.width) {
    throw InvalidArgument(
        "--size (command line)", checks::size(size.x, size.y),
        "the proportions of the views, " + checks::size(views.width, views.height) + ", which are resampled");
  }
  for (ShapeView& view : views.views) {
    if (!view.mask.pixels.empty()) view.mask = resample(view.mask, size.x, size.y);
    for (Image* measured : {&view.depth, &view.normal}) {
      if (!measured->pixels.empty()) *measured = resample_weighted(std::move(*measured), size.x, size.y);
    }
    view.camera = resample(view.camera, views.width, views.height, size.x, size.y);
    view.image = resample(view.image, size.x, size.y);
  }
  views.width = size.x;
  views.height = size.y;
}

/// The views that the file's text describes, with --size, --seed and the smoothing flags in the place of its values.
/// The smoothing is the solver's if neither the file nor the options name one.
ShapeViews read_views(const CLI::App& command, const std::string& text, const FitCommandOptions& options,
                      const CommonOptions& common) {
  Notes notes;
  ViewsFile file = parse_views_file(options.views, text, notes, common.encoding(), options.initial.empty());
  ShapeViews& views = file.views;
  if (!options.initial.empty()) views.initial = read_mesh(options.initial, notes);
  if (std::ranges::none_of(views.views, &ShapeView::has_alpha)) {
    notes.push_back(
        "no image says where the object is, so colours alone are compared and thin parts may be lost: images "
        "with alpha, or \"silhouette\" in the views file, find them");
  }
  print_notes(notes, common);
  if (common.size) resize(views, parse_size(*common.size));
  const SmoothingOptions flags = smoothing_options(common);
  if (file.smoothing) {
    with_keys_of(options.views, *file.smoothing, flags, [&] {
      views.smoothing = resolve_smoothing(overlay(*file.smoothing, flags), views.width, views.height);
    });
  } else if (common.seed || gives_any(command, k_smoothing_group)) {
    Smoothing otherwise = finest_smoothing(views, options.solver);
    if (!says_nothing(flags)) otherwise.noise = Noise::triangle;
    views.smoothing = resolve_smoothing(flags, views.width, views.height, otherwise);
  }
  return std::move(views);
}

/// A weight for images that no view has says nothing.
void require_measured(const CLI::App& command, const char* name, float weight, const ShapeViews& views,
                      Image ShapeView::*image, const std::string& key) {
  const auto has_one = [&](const ShapeView& view) { return !(view.*image).pixels.empty(); };
  if (command.count(name) == 0 || weight == 0 || std::ranges::any_of(views.views, has_one)) return;
  throw InvalidArgument(std::string(name) + " (command line)", "views without a \"" + key + "\"",
                        "an image of one beside every view's, in the views file");
}

/// Throws for an option that changes nothing without another one.
void require_used(const CLI::App& command, const char* name, bool is_used, const std::string& other) {
  if (command.count(name) == 0 || is_used) return;
  throw InvalidArgument(std::string(name) + " (command line)", "one without " + other, other + " beside it");
}

void check_options(const CLI::App& command, const FitCommandOptions& options) {
  require_used(command, "--camera-learning-rate", options.solver.refine_cameras, "--refine-cameras");
  require_used(command, "--robust-scale", options.solver.loss.robust > 0, "--robust");
  require_used(command, "--checkpoint-interval", !options.checkpoint.empty(), "--checkpoint");
  const std::string extension = std::filesystem::path(options.output).extension().string();
  if (extension != ".obj" && extension != ".ply" && extension != ".glb") {
    throw InvalidArgument("--output (command line)", "\"" + options.output + "\"",
                          "a file .obj, .ply or .glb");
  }
  if (options.texture && extension == ".ply")
    throw InvalidArgument("--texture (command line)", "an output .ply, which holds no texture",
                          "a file .obj or .glb");
}

/// Checks the outputs before the work.
void check_outputs(const FitCommandOptions& options) {
  std::vector<std::filesystem::path> files = written_files(options.output, options.texture ? 1 : 0);
  for (const std::string& file : {options.checkpoint, options.saved_views}) {
    if (!file.empty()) files.emplace_back(file);
  }
  require_outputs(files, options.report);
}

/// Finds the cameras of the views that have none. Reports unlikely results.
void find_cameras(const Device& device, ShapeViews& views, bool robust, const CommonOptions& common) {
  PoseOptions options;
  options.solve_focal = true;
  std::get<LeastSquares>(options.method).robust = robust;
  for (std::size_t i = 0; i < views.views.size(); ++i) {
    if (views.views[i].knowledge == CameraKnowledge::known) continue;
    if (!common.quiet) std::printf("image %zu: looking for its camera\n", i);
    const PoseResult found = find_camera(device, views, i, options);
    if (common.quiet) continue;
    std::printf("image %zu: loss %.4g, %.1f s%s\n", i, found.loss, found.seconds,
                found.explained ? "" : "; much is left unexplained, look at the result");
  }
}

/// True if the light is looked for. Known cameras mean that colours are shown without light.
bool finds_light(const std::string& word, bool is_photographed) {
  if (word.empty()) return is_photographed;
  if (word != "harmonics" && word != "fixed")
    throw InvalidArgument("--light (command line)", "\"" + word + "\"", "harmonics or fixed");
  return word == "harmonics";
}

/// Defaults for a template, which keeps its faces, its colours and much of its shape.
void bend_template(const CLI::App& command, FitCommandOptions& options) {
  const ShapeOptions bending = template_shape_options();
  const auto take = [&](const char* name, auto ShapeOptions::*member) {
    if (command.count(name) == 0) options.solver.*member = bending.*member;
  };
  take("--iterations", &ShapeOptions::iterations);
  take("--batch", &ShapeOptions::batch);
  take("--remesh-interval", &ShapeOptions::remesh_interval);
  take("--rigidity", &ShapeOptions::rigidity);
  take("--color-learning-rate", &ShapeOptions::color_learning_rate);
  take("--learning-rate", &ShapeOptions::learning_rate);
  take("--lambda", &ShapeOptions::lambda);
  if (command.count("--ssim") == 0) options.solver.loss.ssim = bending.loss.ssim;
}

/// Finds what photographs lack: cameras, then the light.
void complete_photographs(const CLI::App& command, FitCommandOptions& options, const Device& device,
                          ShapeViews& views, const CommonOptions& common) {
  const bool is_photographed = !std::ranges::all_of(
      views.views, [](const ShapeView& view) { return view.knowledge == CameraKnowledge::known; });
  const bool is_light_unknown = finds_light(options.light, is_photographed);
  if (is_photographed) bend_template(command, options);
  const LossWeights& loss = options.solver.loss;
  find_cameras(device, views, loss.robust > 0, common);
  if (is_light_unknown) views.lights = find_light(device, views, loss.robust > 0 ? loss.robust_scale : 0);
}

/// Tells where silhouettes were of no use for the start.
void tell_of_start(const ShapeSolver& solver, const ShapeViews& views, const CommonOptions& common) {
  const bool has_silhouettes = std::ranges::any_of(views.views, &ShapeView::has_alpha);
  if (views.initial || solver.begins_with_hull() || !has_silhouettes) return;
  print_notes(
      {"silhouettes and depths bound no shape, so the fit begins with a ball: there are too few, or one of "
       "them or a camera is wrong"},
      common);
}

/// Gives the mesh a texture in the place of its colours, and writes it.
ShapeTexture write_textured(const FitCommandOptions& options, const std::vector<Device>& devices,
                            const ShapeViews& views, Mesh& mesh, const CommonOptions& common) {
  const auto start = Clock::now();
  const int side = std::max(*options.texture, TextureAtlas::least_side(mesh.faces.size()));
  if (side > *options.texture) {
    print_notes({format("--texture: %d texels a side, the least for %zu triangles", side, mesh.faces.size())},
                common);
  }
  double last = 0;
  {
    Progress progress(k_texture_iterations, common.quiet);
    const auto watch = [&](unsigned iteration, double loss) {
      last = loss;
      progress.update(iteration + 1, format("texture  mean squared difference %.4e", loss));
      return true;
    };
    mesh = find_texture(devices, views, mesh, side, watch);
  }
  write_mesh(options.output, mesh);
  if (!common.quiet) {
    std::printf("%s: texture of %dx%d texels, mean squared difference %.4g, %.1f s\n", options.output.c_str(),
                side, side, last, seconds_since(start));
  }
  return {side, last};
}

void run(const CLI::App& command, FitCommandOptions& options, const CommonOptions& common) {
  check_options(command, options);
  options.solver.steps = parse_steps(options.steps);
  if (is_adaptive_schedule(options.schedule)) options.solver.schedule = ShapeSchedule::adaptive;
  const std::string text = read_file(options.views);
  ShapeViews views = read_views(command, text, options, common);
  require_measured(command, "--depth", options.solver.depth, views, &ShapeView::depth, "depth");
  require_measured(command, "--normal", options.solver.normal, views, &ShapeView::normal, "normal");
  check_outputs(options);
  const std::vector<Device> devices = open_devices(common);
  complete_photographs(command, options, devices.front(), views, common);
  const ShapeSolver solver = with_option_names(command, {{"edge_pixels", "--edge"}},
                                               [&] { return ShapeSolver(devices, views, options.solver); });
  tell_of_start(solver, views, common);
  std::optional<FitReport> report;
  const std::vector<std::string> names = image_names(text);
  if (!options.report.empty()) report.emplace(options.report, devices, views, names);
  std::exception_ptr report_failed;  // told once there is a mesh
  const auto keep = [&](const ShapeIteration& step, const Mesh& mesh) {
    try {
      if (report && !report_failed) report->keep(step.iteration, mesh);
    } catch (const IoError&) {
      report_failed = std::current_exception();
    }
    return true;
  };
  FitObserver observer(solver.most_iterations(), common.quiet, keep);
  const auto watch = [&, show = observer.callback()](const ShapeIteration& step, const Mesh& mesh) {
    print_notes(step.notes, common);
    return show(step, mesh);
  };
  ShapeResult result = solver.solve(watch, options.checkpoint);
  write_mesh(options.output, result.mesh);
  for (std::size_t i = 0; i < views.views.size(); ++i) views.views[i].camera = result.cameras[i];
  if (!options.saved_views.empty()) write_views(options.saved_views, {options.views, text}, views);
  if (!common.quiet) {
    std::printf("%s: %zu vertices, %zu triangles, loss %.4g after %zu iterations, %.1f s\n",
                options.output.c_str(), result.mesh.positions.size(), result.mesh.faces.size(),
                result.history.back().loss, result.history.size(), result.seconds);
    const std::string unexplained = unexplained_text(result.explanations, names);
    if (!unexplained.empty()) {
      std::printf("%s. The image, its camera or the shape is wrong there%s.\n", unexplained.c_str(),
                  options.solver.refine_cameras || names.size() < 2
                      ? ""
                      : ": --refine-cameras is for cameras a few pixels off");
    }
  }
  std::optional<ShapeTexture> texture;
  if (options.texture) texture = write_textured(options, devices, views, result.mesh, common);
  if (report_failed) std::rethrow_exception(report_failed);
  if (report) {
    const std::string views_file = std::filesystem::path(options.views).filename().string();
    report->write(page_source("The shape in " + views_file, common, devices), result, texture, common.quiet);
  }
}

void add_solver_options(CLI::App& command, FitCommandOptions& options) {
  ShapeOptions& solver = options.solver;
  const auto add = [&](const char* name, auto& value, const char* description, const char* type) {
    command.add_option(name, value, description)
        ->group(k_solver_group)
        ->type_name(type)
        ->capture_default_str();
  };
  add("--levels", solver.levels, "Levels of resolution, each with half the pixels of the next on a side",
      "N");
  add("--iterations", solver.iterations, "Steps a level; 0: 100 where silhouettes give the start, else 160",
      "N");
  add("--batch", solver.batch, "Views that a step looks at, in turn", "N");
  add("--chunk", solver.chunk,
      "Views that a device renders together; 0: all of a step on one device, a twelfth on several. The last "
      "bits depend on it",
      "N");
  add("--edge", solver.edge_pixels, "Length of the mesh's edges, in pixels of the level", "FLOAT");
  add("--remesh-interval", solver.remesh_interval,
      "Steps between two remeshings, in the first half of a level; 0: the faces stay", "N");
  add("--blur", solver.blur,
      "Blur of the edges at a level's beginning, in its pixels; with a smoothing given, it begins blur / "
      "blur-end times as wide",
      "FLOAT");
  add("--blur-end", solver.blur_end, "The same at its end", "FLOAT");
  add("--schedule", options.schedule,
      "Way the blur shrinks: steadily, or while a smaller blur means less loss", "anneal|adaptive");
  add("--steps", options.steps, "Motion of vertices: with their neighbours, or each on its own",
      "large|direct");
  add("--lambda", solver.lambda, "Reach over which large steps take neighbours along", "FLOAT");
  add("--learning-rate", solver.learning_rate, "Size of the steps of vertices, in radii of the common view",
      "FLOAT");
  add("--learning-rate-end", solver.learning_rate_end,
      "Size of all steps at a level's end over that at its beginning", "FLOAT");
  add("--color-learning-rate", solver.color_learning_rate, "Size of the steps of colours", "FLOAT");
  command
      .add_flag("--refine-cameras", solver.refine_cameras,
                "Moves cameras that are a few pixels off, in the second half of each level")
      ->group(k_solver_group);
  add("--camera-learning-rate", solver.camera_learning_rate,
      "Size of the steps of cameras, in radians and in radii of the common view", "FLOAT");
  add("--rigidity", solver.rigidity,
      "Weight of the mean squared strain against the start; with --remesh-interval 0", "FLOAT");
  add("--checkpoint-interval", solver.checkpoint_interval, "Steps between two checkpoints", "N");
}

void add_loss_options(CLI::App& command, ShapeOptions& solver) {
  const auto add = [&](const char* name, auto& value, const char* description) {
    command.add_option(name, value, description)
        ->group(k_loss_group)
        ->type_name("FLOAT")
        ->capture_default_str();
  };
  add("--silhouette", solver.loss.silhouette, "1 - IoU of the silhouettes");
  add("--l1", solver.loss.l1, "Mean absolute difference of colours");
  add("--mse", solver.loss.mse, "Mean squared difference of colours");
  add("--robust", solver.loss.robust,
      "Squared difference of colours that leaves pixels of other colours out");
  add("--robust-scale", solver.loss.robust_scale,
      "Colour difference from which on --robust leaves pixels out");
  add("--ssim", solver.loss.ssim, "1 - structural similarity; the smallest level needs 11x11 pixels");
  add("--depth", solver.depth,
      "Mean absolute difference of depths, in radii of the common view, where views have them");
  add("--normal", solver.normal, "Mean absolute difference of normals, where views have them");
  add("--laplacian", solver.regularizers.laplacian,
      "Sum of squared distances of vertices from their neighbours' mean");
  add("--edge-length", solver.regularizers.edge_length, "Mean squared length of edges");
  add("--normal-consistency", solver.regularizers.normal_consistency,
      "Mean of 1 - cos between neighbours' normals");
  add("--flatness", solver.regularizers.flatness, "Mean of its square");
}

}  // namespace

void add_fit_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand(
      "fit",
      "Finds a mesh with colours from several images; their cameras are known or, with "
      "--initial, found too");
  const auto options = std::make_shared<FitCommandOptions>();
  command->add_option("--views", options->views, "Images and their cameras")->required()->type_name("V.json");
  command
      ->add_option("--initial", options->initial,
                   "Mesh to begin with, in the place of the views file's; bent to the images where their "
                   "cameras are not known")
      ->type_name("MESH.obj");
  command
      ->add_option(
          "--light", options->light,
          "harmonics: look for one distant light in which the initial mesh explains the images; fixed: "
          "colours are as they show. By default harmonics where a camera is not known")
      ->type_name("harmonics|fixed");
  command->add_option("-o,--output", options->output, "Mesh to write, OBJ, PLY or GLB")
      ->required()
      ->type_name("MESH.obj");
  command
      ->add_option(
          "--texture", options->texture,
          "Texels a side of a texture that takes the place of the colours of vertices; OBJ and GLB. More "
          "where two triangles would share less than 4x4")
      ->check(CLI::Range(1, TextureAtlas::k_most_side))
      ->type_name("SIZE");
  command
      ->add_option("--save-views", options->saved_views,
                   "Views file to write: --views with the cameras that were found or refined")
      ->type_name("V.json");
  command->add_option("--report", options->report, "Folder for pictures, plots and a page that shows them")
      ->type_name("DIR");
  command
      ->add_option("--checkpoint", options->checkpoint,
                   "File to go on from, if it exists, and to leave checkpoints in")
      ->type_name("FILE");
  add_solver_options(*command, *options);
  add_loss_options(*command, options->solver);
  add_common_options(*command, common);
  allow_several_devices(*command);
  command->footer(
      "Example: dpr fit --views views.json -o mesh.obj --report report --checkpoint fit.checkpoint");
  command->callback([command, options, &common] { run(*command, *options, common); });
}

}  // namespace dpr::cli
