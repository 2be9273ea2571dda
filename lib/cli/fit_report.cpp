// Numbers, pictures and plots of a shape.
#include "cli/fit_report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "base/output_file.hpp"
#include "cli/difference.hpp"
#include "cli/fit_explained.hpp"
#include "cli/plot.hpp"
#include "cli/progress.hpp"
#include "cli/scene_file.hpp"
#include "cli/text.hpp"
#include "dpr/aov.hpp"
#include "dpr/error.hpp"
#include "dpr/renderer.hpp"
#include "mesh/bounding_box.hpp"

namespace dpr::cli {
namespace {

constexpr std::size_t k_most_views = 8, k_most_worst = 3, k_iterations_kept = 11, k_turntable_views = 16;

/// Some of the views, at equal distances.
std::vector<std::size_t> some_of(std::size_t views) {
  const std::size_t count = std::min(k_most_views, views);
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < count; ++i) chosen.push_back(i * views / count);
  return chosen;
}

/// Those that are not explained, or the worst of all; not many.
std::vector<std::size_t> worst_of(const std::vector<ViewExplanation>& views) {
  const auto count = static_cast<std::size_t>(std::ranges::count(views, false, &ViewExplanation::explained));
  std::vector<std::size_t> order = worst_first(views);
  order.resize(std::clamp(count, std::size_t{1}, std::min(k_most_worst, views.size())));
  return order;
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

Plot shape_plot(const std::vector<ShapeIteration>& history) {
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
  return {"iteration",
          x,
          {{"Loss at the level's resolution", "loss", true, losses},
           {"Smoothing", "scale", true, {sigma, gamma}},
           {"Vertices of the mesh", "vertices", false, {vertices}}}};
}

/// The shape, and the cameras of its views before it.
Model shape_model(const ShapeResult& result, const ShapeViews& views, const std::vector<std::string>& names) {
  constexpr float k_depth = 0.15F;  // of the way to the shape
  Model model;
  model.heading = "The shape, to turn by hand";
  add_mesh(model, result.mesh);
  model.pivot = center(bounding_box(model.positions));
  bool are_all_explained = true;
  for (std::size_t i = 0; i < views.views.size(); ++i) {
    const bool is_explained = result.explanations[i].explained;
    are_all_explained = are_all_explained && is_explained;
    const Camera& camera = views.views[i].camera;
    const float distance = glm::length(glm::vec3(camera.view * glm::vec4(model.pivot, 1)));
    model.cameras.push_back(
        {.camera = camera,
         .width = views.width,
         .height = views.height,
         .depth = k_depth * distance,
         .label = std::to_string(i),
         .name = "image " + std::to_string(i) + ", " + names[i] + (is_explained ? "" : ", not explained"),
         .stands_out = !is_explained});
  }
  model.caption = "The shape and the cameras of its images; pointing at a camera names its image.";
  if (!are_all_explained) model.caption += " Those whose image is not explained are red.";
  model.up = common_up(model.cameras);
  model.start = overview(model);
  return model;
}

/// As scenes and views have them.
Json cameras_to_json(const ShapeViews& views) {
  Json list = Json::array();
  for (const ShapeView& view : views.views) list.push_back(camera_with_view(view.camera));
  return list;
}

Json shape_to_json(const ShapeResult& result) {
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

std::vector<TableRow> facts(const ShapeResult& result, const MeasuredDifferences& differences,
                            const std::optional<ShapeTexture>& texture) {
  std::vector<TableRow> rows{{"vertices", std::to_string(result.mesh.positions.size())},
                             {"triangles", std::to_string(result.mesh.faces.size())}};
  if (!result.history.empty()) rows.push_back({"loss", format("%.4g", result.history.back().loss)});
  rows.push_back({"iterations", std::to_string(result.history.size())});
  if (differences.depth) rows.push_back({"depths off by, mean", format("%.4g", *differences.depth)});
  if (differences.normal)
    rows.push_back({"normals' components off by, mean", format("%.4g", *differences.normal)});
  if (texture) {
    rows.push_back({"texture", format("%dx%d texels, mean squared difference %.4g", texture->side,
                                      texture->side, texture->difference)});
  }
  rows.push_back({"time of this run", format("%.1f seconds", result.seconds)});
  return rows;
}

/// Rows of one picture each.
std::vector<std::vector<Picture>> one_by_one(const std::vector<Picture>& pictures) {
  std::vector<std::vector<Picture>> rows;
  for (const Picture& picture : pictures) rows.push_back({picture});
  return rows;
}

/// Relative to the report's folder.
std::string iteration_file(unsigned iteration) { return format("iterations/%05u.png", iteration); }

}  // namespace

FitObserver::FitObserver(unsigned iterations, bool quiet, ShapeSolver::Callback keep)
    : iterations_(iterations), quiet_(quiet), keep_(std::move(keep)) {}

ShapeSolver::Callback FitObserver::callback() {
  const auto progress = std::make_shared<Progress>(iterations_, quiet_);
  return [this, progress](const ShapeIteration& step, const Mesh& mesh) {
    progress->update(step.iteration + 1,
                     format("level %u  %dx%d  %zu vertices  loss %.4e  sigma %.1e", step.level + 1,
                            step.width, step.height, step.vertices, step.loss, number(step.smoothing.sigma)));
    // The last iteration of each of as many parts of the run as are kept.
    const auto part = [&](unsigned i) { return std::size_t{i} * k_iterations_kept / iterations_; };
    return !keep_ || part(step.iteration + 1) == part(step.iteration) || keep_(step, mesh);
  };
}

namespace {

Scene rigid_scene(const Mesh& mesh, const Camera& camera, int width, int height) {
  Scene scene;
  scene.width = width;
  scene.height = height;
  scene.camera = camera;
  scene.meshes.push_back({mesh});
  scene.smoothing = rigid_smoothing();
  return scene;
}

/// Mean absolute difference of a view's measured numbers, by channel, where the shape is seen.
struct MeanDifference {
  double sum = 0, weight = 0;

  void add(const Image& found, const Image& measured, int channels) {
    for (std::size_t i = 0; i < measured.pixels.size(); ++i) {
      const double counts = static_cast<double>(measured.pixels[i].w * found.pixels[i].w);
      const glm::vec4 difference = glm::abs(found.pixels[i] - measured.pixels[i]);
      for (int k = 0; k < channels; ++k) sum += counts * static_cast<double>(difference[k]);
      weight += counts * channels;
    }
  }
  std::optional<double> mean() const { return weight > 0 ? std::optional(sum / weight) : std::nullopt; }
};

}  // namespace

std::vector<Image> render_rigidly(const Device& device, const Mesh& mesh, const std::vector<Camera>& cameras,
                                  int width, int height, glm::vec3 background,
                                  const std::optional<Lights>& lights) {
  Scene scene = rigid_scene(mesh, cameras.front(), width, height);
  scene.background = background;
  scene.lights = lights;
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

FitReport::FitReport(std::filesystem::path folder, std::vector<Device> devices, const ShapeViews& views,
                     std::vector<std::string> names)
    : folder_(std::move(folder)), devices_(std::move(devices)), views_(views), names_(std::move(names)) {
  make_folder(folder_ / "iterations");
}

void FitReport::keep(unsigned iteration, const Mesh& mesh) const {
  const std::vector<Image> images = render(mesh, {views_.views.front().camera});
  write_picture(folder_ / iteration_file(iteration), images.front(), "");
}

template <class Work>
auto FitReport::on_any_device(const Work& on) const {
  for (std::size_t d = 0; d + 1 < devices_.size(); ++d) {
    try {
      return on(devices_[d]);
    } catch (const DeviceError&) {  // lost: the next may not be
    } catch (const BuildError&) {
    }
  }
  return on(devices_.back());
}

std::vector<Image> FitReport::render(const Mesh& mesh, const std::vector<Camera>& cameras) const {
  return on_any_device([&](const Device& device) {
    return render_rigidly(device, mesh, cameras, views_.width, views_.height, views_.background,
                          views_.lights);
  });
}

MeasuredDifferences FitReport::measured_differences(const Mesh& mesh) const {
  const auto measures = [](const ShapeView& view) {
    return !view.depth.pixels.empty() || !view.normal.pixels.empty();
  };
  if (std::ranges::none_of(views_.views, measures)) return {};
  return on_any_device([&](const Device& device) -> MeasuredDifferences {
    Renderer renderer(device);
    renderer.set_scene(rigid_scene(mesh, views_.views.front().camera, views_.width, views_.height));
    MeanDifference depth, normal;
    for (const ShapeView& view : views_.views) {
      const View seen{view.camera, {glm::mat4(1.0F)}};
      renderer.set_views({&seen, 1});
      renderer.forward();
      const AuxiliaryOutputs outputs = auxiliary_outputs(renderer);
      depth.add(aov_image(outputs, Aov::depth), view.depth, 1);
      normal.add(aov_image(outputs, Aov::normal), view.normal, 3);
    }
    return {depth.mean(), normal.mean()};
  });
}

/// The start, and the iterations of which there are pictures.
std::vector<Picture> FitReport::frames(const ShapeResult& result) const {
  const Image start = render(result.start, {views_.views.front().camera}).front();
  std::vector<Picture> pictures{write_picture(folder_ / "start.png", start, "start")};
  for (const ShapeIteration& step : result.history) {
    const std::string file = iteration_file(step.iteration);
    if (!std::filesystem::exists(folder_ / file)) continue;
    pictures.push_back(
        {file, format("iteration %u, level %u, %zu vertices", step.iteration, step.level + 1, step.vertices),
         start.width, start.height});
  }
  return pictures;
}

std::vector<std::vector<Picture>> FitReport::compare_views(const ShapeResult& result,
                                                           const std::vector<std::size_t>& views,
                                                           const std::string& prefix) const {
  std::vector<Image> images;
  std::vector<Camera> cameras;
  std::vector<std::string> numbers, explanations;
  for (const std::size_t view : views) {
    images.push_back(views_.views[view].image);
    cameras.push_back(views_.views[view].camera);
    numbers.push_back("image " + std::to_string(view) + ", " + names_[view]);
    explanations.push_back("the shape from there: " + explanation_text(result.explanations[view]));
  }
  const std::vector<Image> results = render(result.mesh, cameras);
  const Differences difference = differences(results, images);
  const std::vector<std::string> captions(images.size(), difference.caption());
  const std::vector<Picture> targets = write_strip(folder_ / (prefix + "targets.png"), images, numbers);
  const std::vector<Picture> shapes = write_strip(folder_ / (prefix + "results.png"), results, explanations);
  const std::vector<Picture> gaps =
      write_strip(folder_ / (prefix + "differences.png"), difference.images, captions);
  std::vector<std::vector<Picture>> rows;
  for (std::size_t i = 0; i < targets.size(); ++i) rows.push_back({targets[i], shapes[i], gaps[i]});
  return rows;
}

void FitReport::write(const PageSource& source, const ShapeResult& result,
                      const std::optional<ShapeTexture>& texture, bool quiet) const {
  const std::vector<Camera> around = turntable(result.mesh, k_turntable_views, views_.width, views_.height);
  std::vector<std::string> sides;
  for (std::size_t i = 0; i < around.size(); ++i)
    sides.push_back(
        format("%.0f degrees", 360.0 * static_cast<double>(i) / static_cast<double>(around.size())));
  // The page comes last: what it shows is there.
  const auto compared = compare_views(result, some_of(views_.views.size()), "");
  const auto worst = compare_views(result, worst_of(result.explanations), "worst_");
  const Picture target = write_picture(folder_ / "target.png", views_.views.front().image, "image 0");
  const std::vector<Picture> iterations = frames(result);
  const std::vector<Picture> turns =
      write_strip(folder_ / "turntable.png", render(result.mesh, around), sides);
  const Plot curves = shape_plot(result.history);
  const bool is_plotted = !result.history.empty() && plot(folder_ / "plot.png", curves);
  if (!is_plotted && !quiet) std::printf("plot.png is left out: gnuplot is not installed\n");
  Json numbers = shape_to_json(result);
  numbers["cameras"] = cameras_to_json(views_);
  add_explanations(numbers, result.explanations, names_);
  const MeasuredDifferences differences = measured_differences(result.mesh);
  if (differences.depth) numbers["depth_difference"] = *differences.depth;
  if (differences.normal) numbers["normal_difference"] = *differences.normal;
  if (views_.lights) add_found_light(numbers, *views_.lights);
  write_json(folder_ / "fit.json", numbers);

  Page page(source);
  page.add_heading("Images, and the shape from there");
  if (compared.size() < views_.views.size()) {
    page.add_paragraph(format("%zu of the %zu images.", compared.size(), views_.views.size()));
  }
  page.add_player({}, compared);
  page.add_heading("Images that are explained worst");
  for (const std::vector<Picture>& row : worst) page.add_pictures(row);
  page.add_heading("How well the shape explains each image");
  if (texture) page.add_paragraph("These numbers are of the shape before its texture.");
  page.add_table(explanation_rows(result.explanations, names_));
  page.add_heading("From the start to the end");
  page.add_player({target}, one_by_one(iterations));
  page.add_model(shape_model(result, views_, names_));
  page.add_heading("All around");
  page.add_player({}, one_by_one(turns));
  page.add_heading("Result");
  page.add_facts(facts(result, differences, texture));
  if (is_plotted) page.add_plot("plot.png", "loss, smoothing and vertices by iteration", curves);
  page.write(folder_ / "index.html");
}

}  // namespace dpr::cli
