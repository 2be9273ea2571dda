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

/// What was found in each of the pictures.
struct FoundViews {
  std::vector<Scene> scenes;  // with the views' cameras
  std::vector<FoundBody> found;
  std::vector<FoundLight> lights;
};

Json views_to_json(const FoundViews& views) {
  Json json{{"width", views.scenes.front().width}, {"height", views.scenes.front().height}};
  json["explained"] = std::ranges::all_of(views.found, [](const FoundBody& f) { return f.result.explained; });
  json["focal_scale"] = views.found.front().result.focal_scale;
  Json& pictures = json["views"] = Json::array();
  for (std::size_t i = 0; i < views.scenes.size(); ++i) {
    Json own = poses_to_json(views.scenes[i], {&views.found[i], 1});
    add_light(own, views.lights[i]);
    for (const char* const shared : {"width", "height"}) own.erase(shared);
    pictures.push_back(std::move(own));
  }
  return json;
}

void print_explained(const FoundViews& views, const std::string& output) {
  std::size_t explained = 0;
  for (std::size_t i = 0; i < views.found.size(); ++i) {
    const PoseResult& result = views.found[i].result;
    explained += result.explained ? 1 : 0;
    if (!result.explained)
      std::printf("View %zu is not explained: %s.\n", i, doubt_text(result).c_str());
  }
  std::printf("%s: %zu of %zu views are explained\n", output.c_str(), explained, views.found.size());
}

}  // namespace

void find_poses_in_views(const PoseViewsOptions& options, const CommonOptions& common) {
  Notes notes;
  ShapeViews read = parse_views_file(options.views, read_file(options.views), notes, common.encoding()).views;
  Scene scene = read_scene(options.scene, common, glm::ivec2(read.width, read.height));
  print_notes(notes, common);
  scene.width = read.width;
  scene.height = read.height;
  const PoseBodies bodies = parse_moving_meshes(options.meshes, scene);
  if (bodies.size() > 1)
    throw InvalidArgument("--mesh (command line)", "several beside --views", "one: the meshes of one object");
  PoseOptions solver = options.solver;
  solver.meshes = bodies.front();
  const bool is_alone = scene.meshes.size() == std::max<std::size_t>(1, solver.meshes.size());
  const std::vector<PoseView> views = pose_views(std::move(read), options.views, is_alone);
  if (!options.report.empty()) make_folder(options.report);
  const Device device = open_device(common);
  const PoseSolver::Callback callback = [](const PoseIteration&) { return true; };
  std::vector<PoseResult> results = solve_moving(device, scene, views, solver, options.start, callback);
  FoundViews found;
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
                      page_source(title, common, {&device, 1}), device, found.scenes[i],
                      {&found.found[i], 1}, views[i].target, found.lights[i], common.quiet);
  }
  if (!common.quiet) print_explained(found, options.output);
}

}  // namespace dpr::cli
