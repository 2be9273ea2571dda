// Numbers, pictures and plots of a shape.
#include "cli/fit_report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "base/output_file.hpp"
#include "cli/folder.hpp"
#include "cli/page.hpp"
#include "cli/plot.hpp"
#include "cli/progress.hpp"
#include "dpr/renderer.hpp"
#include "mesh/bounding_box.hpp"

namespace dpr::cli {
namespace {

constexpr std::size_t k_strip_length = 8;

Image strip_of(std::vector<Image> images) {
  for (Image& image : images) image = opaque(std::move(image));
  return hstack(images);
}

/// Some of the views, at equal distances.
std::vector<const ShapeView*> some_of(const std::vector<ShapeView>& views) {
  const std::size_t count = std::min(k_strip_length, views.size());
  std::vector<const ShapeView*> chosen;
  for (std::size_t i = 0; i < count; ++i) chosen.push_back(&views[i * views.size() / count]);
  return chosen;
}

/// Cameras around the mesh, which fills most of the short side of their pictures.
std::vector<Camera> turntable(const Mesh& mesh, std::size_t count, int width, int height) {
  constexpr float k_elevation_degrees = 20, k_fov_degrees = 40, k_margin = 1.15F;
  const Bounds box = bounding_box(mesh.positions);
  const float radius = 0.5F * glm::length(box.high - box.low);
  const float half_angle = glm::radians(0.5F * k_fov_degrees);
  const float distance = k_margin * radius / std::sin(half_angle);
  const float tall = static_cast<float>(height) / static_cast<float>(std::min(width, height));
  std::vector<Camera> cameras;
  for (std::size_t i = 0; i < count; ++i) {
    const float azimuth = 360.0F * static_cast<float>(i) / static_cast<float>(count);
    Camera camera = orbit_camera(distance, k_elevation_degrees, azimuth, center(box));
    camera.fov_y_degrees = glm::degrees(2 * std::atan(tall * std::tan(half_angle)));
    camera.znear = distance - 1.1F * radius;
    camera.zfar = distance + 1.1F * radius;
    cameras.push_back(camera);
  }
  return cameras;
}

bool plot_history(const std::filesystem::path& file, const std::vector<ShapeIteration>& history) {
  constexpr double k_smallest = 1e-12;  // zero has no place on a logarithmic axis
  std::vector<double> x;
  Curve image{"images", {}}, mesh{"regularisers", {}}, sigma{"sigma", {}}, gamma{"gamma", {}},
      vertices{"vertices", {}};
  for (const ShapeIteration& step : history) {
    x.push_back(step.iteration);
    image.y.push_back(std::max(step.image_loss, k_smallest));
    mesh.y.push_back(std::max(step.mesh_loss, k_smallest));
    sigma.y.push_back(number(step.smoothing.sigma));
    gamma.y.push_back(number(step.smoothing.gamma));
    vertices.y.push_back(static_cast<double>(step.vertices));
  }
  std::vector<Curve> losses{image};
  const bool is_regularised =
      std::ranges::any_of(history, [](const auto& step) { return step.mesh_loss > 0; });
  if (is_regularised) losses.push_back(mesh);
  return plot(file, "iteration", x,
              {{"loss", true, losses}, {"smoothing", true, {sigma, gamma}}, {"vertices", false, {vertices}}});
}

Json to_json(const ShapeResult& result) {
  Json history = Json::array();
  for (const ShapeIteration& step : result.history) {
    history.push_back({{"iteration", step.iteration},
                       {"level", step.level},
                       {"loss", step.loss},
                       {"image_loss", step.image_loss},
                       {"mesh_loss", step.mesh_loss},
                       {"sigma", number(step.smoothing.sigma)},
                       {"gamma", number(step.smoothing.gamma)},
                       {"width", step.width},
                       {"height", step.height},
                       {"vertices", step.vertices},
                       {"faces", step.faces}});
  }
  return {{"finished", result.finished},
          {"seconds", result.seconds},
          {"vertices", result.mesh.positions.size()},
          {"faces", result.mesh.faces.size()},
          {"history", history}};
}

void write_page(const std::filesystem::path& file, const ShapeResult& result, bool has_iterations,
                bool has_plot) {
  write_whole_file(file, [&](std::ostream& out) {
    write_page_head(out, "Shape");
    out << "<table>\n";
    write_row(out, "vertices", std::to_string(result.mesh.positions.size()));
    write_row(out, "triangles", std::to_string(result.mesh.faces.size()));
    if (!result.history.empty()) write_row(out, "loss", format("%.4g", result.history.back().loss));
    write_row(out, "iterations", std::to_string(result.history.size()));
    write_row(out, "seconds", format("%.1f", result.seconds));
    out << "</table>\n<h2>Images, and the shape from there</h2>\n";
    write_wide_picture(out, "targets.png", "images");
    write_wide_picture(out, "results.png", "the shape as the same cameras see it");
    out << "<h2>Turntable</h2>\n";
    write_wide_picture(out, "turntable.png", "turntable");
    if (has_iterations || has_plot) out << "<h2>On the way</h2>\n";
    if (has_iterations) write_wide_picture(out, "iterations.png", "iterations");
    if (has_plot) write_wide_picture(out, "plot.png", "loss, smoothing and vertices");
    write_page_end(out);
  });
}

}  // namespace

FitObserver::FitObserver(unsigned iterations, bool quiet, bool keeps_meshes)
    : iterations_(iterations), quiet_(quiet), keeps_meshes_(keeps_meshes) {}

ShapeSolver::Callback FitObserver::callback() {
  const auto progress = std::make_shared<Progress>(iterations_, quiet_);
  return [this, progress](const ShapeIteration& step, const Mesh& mesh) {
    progress->update(step.iteration + 1,
                     format("level %u  %dx%d  %zu vertices  loss %.4e  sigma %.1e", step.level + 1,
                            step.width, step.height, step.vertices, step.loss, number(step.smoothing.sigma)));
    // The last iteration of each of as many parts of the run as the strip is long.
    const auto part = [&](unsigned i) { return std::size_t{i} * k_strip_length / iterations_; };
    if (keeps_meshes_ && part(step.iteration + 1) != part(step.iteration)) kept_.push_back(mesh);
    return true;
  };
}

std::vector<Image> render_rigidly(const Device& device, const Mesh& mesh, const std::vector<Camera>& cameras,
                                  int width, int height, glm::vec3 background) {
  Scene scene;
  scene.width = width;
  scene.height = height;
  scene.background = background;
  scene.camera = cameras.front();
  scene.meshes.push_back({mesh});
  scene.smoothing = rigid_smoothing();
  std::vector<View> views;
  for (const Camera& camera : cameras) views.push_back({camera, {glm::mat4(1.0F)}});
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.set_views(views);
  renderer.forward();
  std::vector<Image> images;
  for (std::size_t i = 0; i < views.size(); ++i) images.push_back(renderer.image(i));
  return images;
}

void write_fit_report(const std::filesystem::path& folder, const Device& device, const ShapeViews& views,
                      const ShapeResult& result, const std::vector<Mesh>& kept, bool quiet) {
  make_folder(folder);
  std::vector<Image> targets, stages;
  std::vector<Camera> cameras;
  for (const ShapeView* view : some_of(views.views)) {
    targets.push_back(view->image);
    cameras.push_back(view->camera);
  }
  const auto render = [&](const Mesh& mesh, const std::vector<Camera>& from) {
    return render_rigidly(device, mesh, from, views.width, views.height, views.background);
  };
  for (const Mesh& mesh : kept) stages.push_back(render(mesh, {cameras.front()}).front());
  write_image(folder / "targets.png", strip_of(targets));
  write_image(folder / "results.png", strip_of(render(result.mesh, cameras)));
  write_image(
      folder / "turntable.png",
      strip_of(render(result.mesh, turntable(result.mesh, k_strip_length, views.width, views.height))));
  if (!stages.empty()) write_image(folder / "iterations.png", strip_of(stages));
  const bool is_plotted = !result.history.empty() && plot_history(folder / "plot.png", result.history);
  if (!is_plotted && !quiet) std::printf("plot.png is left out: gnuplot is not installed\n");
  write_json(folder / "fit.json", to_json(result));
  write_page(folder / "index.html", result, !stages.empty(), is_plotted);
}

}  // namespace dpr::cli
