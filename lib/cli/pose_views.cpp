// dpr pose --views: reads the pictures, finds the poses, writes them.
#include "cli/pose_views.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "base/output_file.hpp"
#include "cli/moving_meshes.hpp"
#include "cli/pose_report.hpp"
#include "cli/provenance.hpp"
#include "cli/scene_file.hpp"
#include "cli/text.hpp"
#include "dpr/error.hpp"
#include "solve/shape_views.hpp"

namespace dpr::cli {
namespace {

/// A silhouette tells in the colours alone: the picture is laid on the background where it says so.
std::vector<PoseView> pose_views(ShapeViews views, const std::string& file) {
  std::vector<PoseView> result;
  for (ShapeView& view : views.views) {
    if (view.knowledge == CameraKnowledge::unknown) {
      throw InvalidArgument(checks::element("views", result.size()) + " (" + file + ")", "no camera",
                            "a \"camera\", or an \"initial_camera\" that is near");
    }
    result.push_back({view.camera, std::move(view.image), std::move(view.mask), {}, std::move(view.depth)});
  }
  return result;
}

/// What was found in the pictures.
struct FoundViews {
  bool moving;
  std::vector<Scene> scenes;          // [view] with its camera
  std::vector<FoundBody> found;       // [view]
  std::vector<FoundLight> lights;     // [view]
  std::vector<LeastSquares> methods;  // [view] with its mask
};

/// Of a moving object a pose for each view; otherwise that of a single picture, and each view's camera and light.
Json views_to_json(const FoundViews& views) {
  const PoseResult& first = views.found.front().result;
  Json json;
  if (views.moving) {
    json = {{"width", views.scenes.front().width},
            {"height", views.scenes.front().height},
            {"focal_scale", first.focal_scale}};
    json["explained"] =
        std::ranges::all_of(views.found, [](const FoundBody& found) { return found.result.explained; });
  } else {
    json = poses_to_json(views.scenes.front(), {views.found.data(), 1});
    json.erase("camera");
  }
  for (std::size_t i = 0; i < views.scenes.size(); ++i) {
    const Scene& scene = views.scenes[i];
    Json own;
    if (views.moving) {
      own = poses_to_json(scene, {&views.found[i], 1});
      for (const char* const shared : {"width", "height"}) own.erase(shared);
    } else {
      own["camera"] = camera_with_view(calibrated(scene.camera, first.focal_scale, first.radial));
      if (i < first.view_parts.size()) own["part_of_blank"] = first.view_parts[i];
    }
    add_light(own, views.lights[i]);
    json["views"].push_back(std::move(own));
  }
  return json;
}

/// What may help views that are not explained, after a full stop.
const char* advice(const PoseOptions& solver) {
  return solver.solve_translation ? "" : " --translation looks for places too.";
}

void print_moving(const FoundViews& views, const std::string& output, const PoseOptions& solver) {
  std::size_t explained = 0;
  for (std::size_t i = 0; i < views.found.size(); ++i) {
    const PoseResult& result = views.found[i].result;
    explained += result.explained ? 1 : 0;
    if (!result.explained)
      std::printf("View %zu is not explained: %s. Its pose may be wrong.\n", i, doubt_text(result).c_str());
  }
  const bool are_all = explained == views.found.size();
  std::printf("%s: %zu of %zu views are explained.%s\n", output.c_str(), explained, views.found.size(),
              are_all ? "" : advice(solver));
}

void print_still(const PoseResult& result, const std::string& output, const PoseOptions& solver) {
  std::printf("%s: loss %.6g after %u iterations, %.1f s\n", output.c_str(), result.loss, result.iterations,
              result.seconds);
  if (result.explained) return;
  std::string parts;
  for (const double part : result.view_parts) parts += (parts.empty() ? "" : ", ") + format("%.3g", part);
  std::printf("The views are not explained: %s. The pose, or the camera of a view, may be wrong.%s\n",
              doubt_text(result).c_str(), advice(solver));
  if (!parts.empty())
    std::printf("Errors of the views, in parts of a picture without the object: %s\n", parts.c_str());
}

/// The scene in the views' size, and before their background if they have one.
Scene read_scene_of(const std::string& file, const ShapeViews& views, bool has_background,
                    const CommonOptions& common) {
  Scene scene = read_scene(file, common, glm::ivec2(views.width, views.height));
  scene.width = views.width;
  scene.height = views.height;
  if (has_background) scene.background = views.background;
  return scene;
}

/// [view]
std::vector<PoseResult> solve(const PoseViewsOptions& options, const PoseOptions& solver,
                              const Device& device, const Scene& scene, const std::vector<PoseView>& views,
                              bool quiet) {
  const PoseSolver all = PoseSolver::of_views(device, scene, views, solver);
  if (!options.report.empty()) make_folder(options.report);
  const PoseSolver::Callback callback =
      progress_callback(all.most_iterations(), quiet, options.moving ? "view" : "");
  if (options.moving) return solve_moving(device, scene, views, solver, options.start, callback);
  const PoseResult result =
      options.start == PoseStart::unknown ? all.search(callback) : all.solve(all.scene_pose(), callback);
  return std::vector<PoseResult>(views.size(), result);
}

}  // namespace

SceneOfViews read_scene_of_views(const std::string& scene_file, const std::string& views_file,
                                 const CommonOptions& common) {
  Notes notes;
  const std::string text = read_file(views_file);
  ShapeViews views = parse_views_file(views_file, text, notes, common.encoding()).views;
  print_notes(notes, common);
  const bool has_background = Json::parse(text).contains("background");
  Scene scene = read_scene_of(scene_file, views, has_background, common);
  return {std::move(scene), pose_views(std::move(views), views_file)};
}

void find_poses_in_views(const PoseViewsOptions& options, const SceneOfViews& in,
                         const CommonOptions& common) {
  const auto& [scene, views] = in;
  const PoseBodies bodies = parse_moving_meshes(options.meshes, scene);
  if (bodies.size() > 1)
    throw InvalidArgument("--mesh (command line)", "several beside --views", "one: the meshes of one object");
  PoseOptions solver = options.solver;
  solver.meshes = bodies.front();
  const Device device = open_device(common);
  std::vector<PoseResult> results = solve(options, solver, device, scene, views, common.quiet);
  FoundViews found{options.moving, {}, {}, {}, {}};
  for (std::size_t i = 0; i < views.size(); ++i) {
    Scene& own = found.scenes.emplace_back(scene);
    own.camera = views[i].camera;
    found.found.push_back({solver.meshes, std::move(results[i])});
    LeastSquares& method = found.methods.emplace_back(std::get<LeastSquares>(solver.method));
    method.mask = views[i].mask;
    found.lights.push_back(light_of(device, own, {&found.found.back(), 1}, {views[i].target, method}));
  }
  write_json(options.output, views_to_json(found));
  for (std::size_t i = 0; !options.report.empty() && i < views.size(); ++i) {
    const std::string title =
        format("The pose in view %zu of ", i) + std::filesystem::path(options.views).filename().string();
    write_pose_report(std::filesystem::path(options.report) / std::to_string(i),
                      page_source(title, common, {&device, 1}), device, found.scenes[i], {&found.found[i], 1},
                      {views[i].target, found.methods[i]}, found.lights[i], common.quiet);
  }
  if (common.quiet) return;
  if (options.moving) {
    print_moving(found, options.output, solver);
  } else {
    print_still(found.found.front().result, options.output, solver);
  }
}

}  // namespace dpr::cli
