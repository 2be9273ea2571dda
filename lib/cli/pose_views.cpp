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

/// A picture's alpha is the silhouette in a views file.
Image silhouette_of(const ShapeView& view) {
  if (!view.has_alpha) return {};
  Image silhouette = view.image;
  for (glm::vec4& pixel : silhouette.pixels) pixel = glm::vec4(pixel.w);
  return silhouette;
}

std::vector<PoseView> pose_views(ShapeViews views, const std::string& file, bool takes_silhouettes) {
  std::vector<PoseView> result;
  for (ShapeView& view : views.views) {
    if (view.knowledge == CameraKnowledge::unknown) {
      throw InvalidArgument(checks::element("views", result.size()) + " (" + file + ")", "no camera",
                            "a \"camera\", or an \"initial_camera\" that is near");
    }
    Image silhouette = takes_silhouettes ? silhouette_of(view) : Image{};
    result.push_back({view.camera, std::move(view.image), std::move(view.mask), std::move(silhouette),
                      std::move(view.depth)});
  }
  return result;
}

/// What was found in the pictures.
struct FoundViews {
  bool moving;
  std::vector<Scene> scenes;       // [view] with its camera
  std::vector<FoundBody> found;    // [view]
  std::vector<FoundLight> lights;  // [view]
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

void print_moving(const FoundViews& views, const std::string& output) {
  std::size_t explained = 0;
  for (std::size_t i = 0; i < views.found.size(); ++i) {
    const PoseResult& result = views.found[i].result;
    explained += result.explained ? 1 : 0;
    if (!result.explained)
      std::printf("View %zu is not explained: %s. Its pose may be wrong.\n", i, doubt_text(result).c_str());
  }
  std::printf("%s: %zu of %zu views are explained\n", output.c_str(), explained, views.found.size());
}

void print_still(const PoseResult& result, const std::string& output) {
  std::printf("%s: loss %.6g after %u iterations, %.1f s\n", output.c_str(), result.loss, result.iterations,
              result.seconds);
  if (result.explained) return;
  std::printf("The views are not explained: %s. The pose may be wrong", doubt_text(result).c_str());
  if (!result.view_parts.empty()) {
    const auto worst = std::ranges::max_element(result.view_parts);
    std::printf("; view %td leaves most", worst - result.view_parts.begin());
  }
  std::printf(".\n");
}

/// The views' scene, of their size.
Scene read_scene_of(const PoseViewsOptions& options, const ShapeViews& views, const CommonOptions& common) {
  Scene scene = read_scene(options.scene, common, glm::ivec2(views.width, views.height));
  scene.width = views.width;
  scene.height = views.height;
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

void find_poses_in_views(const PoseViewsOptions& options, const CommonOptions& common) {
  Notes notes;
  ShapeViews read = parse_views_file(options.views, read_file(options.views), notes, common.encoding()).views;
  print_notes(notes, common);
  const Scene scene = read_scene_of(options, read, common);
  const PoseBodies bodies = parse_moving_meshes(options.meshes, scene);
  if (bodies.size() > 1)
    throw InvalidArgument("--mesh (command line)", "several beside --views", "one: the meshes of one object");
  PoseOptions solver = options.solver;
  solver.meshes = bodies.front();
  const bool is_alone = scene.meshes.size() == std::max<std::size_t>(1, solver.meshes.size());
  const std::vector<PoseView> views = pose_views(std::move(read), options.views, is_alone);
  const Device device = open_device(common);
  std::vector<PoseResult> results = solve(options, solver, device, scene, views, common.quiet);
  FoundViews found{options.moving, {}, {}, {}};
  for (std::size_t i = 0; i < views.size(); ++i) {
    Scene& own = found.scenes.emplace_back(scene);
    own.camera = views[i].camera;
    found.found.push_back({solver.meshes, std::move(results[i])});
    LeastSquares method = std::get<LeastSquares>(solver.method);
    method.mask = views[i].mask;
    found.lights.push_back(light_of(device, own, {&found.found.back(), 1}, views[i].target, method));
  }
  write_json(options.output, views_to_json(found));
  for (std::size_t i = 0; !options.report.empty() && i < views.size(); ++i) {
    const std::string title =
        format("The pose in view %zu of ", i) + std::filesystem::path(options.views).filename().string();
    write_pose_report(std::filesystem::path(options.report) / std::to_string(i),
                      page_source(title, common, {&device, 1}), device, found.scenes[i], {&found.found[i], 1},
                      views[i].target, found.lights[i], common.quiet);
  }
  if (common.quiet) return;
  if (options.moving) {
    print_moving(found, options.output);
  } else {
    print_still(found.found.front().result, options.output);
  }
}

}  // namespace dpr::cli
