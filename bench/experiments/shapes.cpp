// Shapes from views: a coloured mesh rendered rigidly from 24 cameras, fitted from a sphere, and compared
// with the truth in volume and in views that the fit has not seen; the paper's alternatives at the same
// budget, and cameras that are not where they are said to be.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <random>
#include <string>
#include <vector>

#include "cli/fit_report.hpp"
#include "dpr/pose.hpp"
#include "dpr/shape.hpp"
#include "dpr/voxels.hpp"
#include "experiment.hpp"
#include "mesh/bounding_box.hpp"
#include "mesh/isosurface.hpp"
#include "views.hpp"

namespace dpr::experiments {
namespace {

constexpr std::uint64_t k_seed = 1;
constexpr std::size_t k_views = 24, k_held_out = 12, k_shown = 6;
constexpr unsigned k_voxels = 64;
const Bounds k_box{glm::vec3(-1.1F), glm::vec3(1.1F)};

struct Shape {
  std::string name;
  Mesh mesh;  // longest side of its box [-1, 1]
};

/// A closed surface with bumps and dents.
Mesh make_blob() {
  Mesh mesh = make_icosphere(5);
  for (glm::vec3& p : mesh.positions)
    p *= 1 + 0.25F * std::sin(3 * p.x + 1) * std::cos(4 * p.y) + 0.15F * std::sin(5 * p.z);
  return mesh;
}

/// The part of a field from the surface of a box inwards.
float in_box(const glm::vec3& p, const glm::vec3& centre, const glm::vec3& half) {
  const glm::vec3 beyond = glm::abs(p - centre) - half;
  return -std::max({beyond.x, beyond.y, beyond.z});
}

/// A seat on four legs, with a back of two posts and two rails.
float chair(const glm::vec3& p) {
  const glm::vec3 side(std::abs(p.x), p.y, p.z);  // it is symmetric
  return std::max({in_box(side, {0, 0, 0}, {0.5F, 0.06F, 0.5F}),
                   in_box(side, {0.43F, -0.5F, 0.43F}, {0.07F, 0.5F, 0.07F}),
                   in_box(side, {0.43F, 0, -0.43F}, {0.07F, 1, 0.07F}),
                   in_box(side, {0, 0.9F, -0.43F}, {0.5F, 0.1F, 0.05F}),
                   in_box(side, {0, 0.5F, -0.43F}, {0.5F, 0.07F, 0.05F})});
}

/// A wall about a hollow, with a handle.
float mug(const glm::vec3& p) {
  const float radius = glm::length(glm::vec2(p.x, p.z));
  const float body = std::min(0.7F - radius, 0.9F - std::abs(p.y));
  const float hollow = std::min(0.58F - radius, p.y + 0.78F);
  const float ring = glm::length(glm::vec2(p.x - 0.7F, p.y)) - 0.42F;
  const float handle = std::min(0.1F - glm::length(glm::vec2(ring, p.z)), radius - 0.64F);
  return std::max(std::min(body, -hollow), handle);
}

float torus(const glm::vec3& p) {
  return 0.3F - glm::length(glm::vec2(glm::length(glm::vec2(p.x, p.y)) - 0.7F, p.z));
}

Mesh surface_of(float (*field)(const glm::vec3&)) {
  constexpr int k_cells = 96;
  constexpr double k_half = 1.3;
  ScalarGrid grid{glm::ivec3(k_cells + 1), glm::dvec3(-k_half), 2 * k_half / k_cells, {}};
  for (int z = 0; z <= k_cells; ++z) {
    for (int y = 0; y <= k_cells; ++y) {
      for (int x = 0; x <= k_cells; ++x) grid.values.push_back(field(glm::vec3(grid.position({x, y, z}))));
    }
  }
  return isosurface(grid);
}

void centre(Mesh& mesh) {
  const Bounds box = bounding_box(mesh.positions);
  const glm::vec3 size = box.high - box.low, middle = center(box);
  const float scale = 2 / std::max({size.x, size.y, size.z});
  for (glm::vec3& p : mesh.positions) p = scale * (p - middle);
}

/// Smoothly by position, with patches of one colour whose edges are sharp (to a triangle).
void paint(Mesh& mesh) {
  constexpr std::size_t k_patches = 6;
  constexpr float k_radius = 0.25F;
  const glm::vec3 palette[] = {{0.95F, 0.9F, 0.2F}, {0.1F, 0.1F, 0.15F}, {0.9F, 0.95F, 1}};
  std::mt19937_64 generator(k_seed);
  std::vector<glm::vec3> centres;
  for (std::size_t i = 0; i < k_patches; ++i)
    centres.push_back(mesh.positions[generator() % mesh.positions.size()]);
  mesh.vertex_colors.clear();
  for (const glm::vec3& p : mesh.positions) {
    glm::vec3 color = 0.5F + 0.4F * glm::sin(glm::vec3(3, 4, 3) * p + glm::vec3(1, 0, 2));
    for (std::size_t i = 0; i < k_patches; ++i) {
      if (glm::distance(p, centres[i]) < k_radius) color = palette[i % std::size(palette)];
    }
    mesh.vertex_colors.push_back(color);
  }
}

/// Spot and the fish, and things with holes; for a smoke test a shape of our own, which is coarser.
std::vector<Shape> make_shapes(bool smoke) {
  const std::filesystem::path folder = DPR_BENCH_DATA;
  std::vector<Shape> shapes;
  if (!smoke) {
    shapes.push_back({"spot", read_mesh(folder / "spot_low.obj")});
    shapes.push_back({"fish", read_mesh(folder / "fish_low.obj")});
    shapes.push_back({"torus", surface_of(torus)});
    shapes.push_back({"chair", surface_of(chair)});
    shapes.push_back({"mug", surface_of(mug)});
  } else {
    shapes.push_back({"blob", make_blob()});
  }
  for (Shape& shape : shapes) {
    centre(shape.mesh);
    paint(shape.mesh);
  }
  return shapes;
}

/// A way to fit, all with the same views and, but for one, the same iterations.
struct Method {
  std::string name;
  ShapeOptions options;
  std::string preset;  // of the smoothing, with the default's sigma and gamma; empty: the default
  bool are_cameras_off = false;
};

ShapeOptions default_options(bool smoke) {
  ShapeOptions options;
  if (smoke) {
    options.iterations = 40;
    options.remesh_interval = 10;
    options.learning_rate = 0.1;
    options.lambda = 2;  // a mesh this small is stiff
  }
  return options;
}

std::vector<Method> make_methods(bool smoke) {
  const ShapeOptions options = default_options(smoke);
  ShapeOptions adaptive = options;
  adaptive.schedule = ShapeSchedule::adaptive;
  ShapeOptions large = options;  // the reach of Nicolet et al., and the steps that it takes
  large.lambda = 16;
  large.iterations = smoke ? 40 : 400;
  large.batch = 8;
  large.remesh_interval = large.iterations / 8;
  ShapeOptions paper = options;  // its weights (74) and regulariser (77), Adam on the positions
  paper.steps = ShapeSteps::direct;
  paper.loss = {.l1 = 1, .silhouette = 1};
  paper.regularizers.laplacian = 3e-3F;
  paper.learning_rate = 0.01;
  ShapeOptions narrow = options;  // edges and seams of triangles are as wide as their noise
  narrow.blur = 0.5F;
  narrow.blur_end = 0.1F;
  return {{"default", options, ""},
          {"reach 16", large, ""},
          {"barrier", narrow, "gaussian"},
          {"joint", narrow, "joint_gaussian"},
          {"softras", narrow, "softras"},
          {"adaptive smoothing", adaptive, ""},
          {"direct steps, Laplacian", paper, ""}};
}

std::vector<Method> make_camera_methods(bool smoke) {
  const ShapeOptions options = default_options(smoke);
  ShapeOptions refined = options;
  refined.refine_cameras = true;
  return {{"right", options, ""},
          {"right, refined", refined, ""},
          {"off", options, "", true},
          {"off, refined", refined, "", true}};
}

/// Turns cameras about the origin and moves them, by half a degree and a hundredth of their distance in the root mean
/// square, or as many pixels of smaller images. The mean over the cameras is left out: it would turn and move the
/// object.
void disturb(std::vector<ShapeView>& views) {
  constexpr double k_width = 128, k_axes = 3;
  const double scale = k_width / views.front().image.width, degrees = 0.5 * scale, part = 0.01 * scale;
  std::mt19937_64 generator(k_seed);
  std::normal_distribution<double> normal;
  const auto errors = [&](double deviation) {
    std::vector<glm::dvec3> list(views.size());
    glm::dvec3 mean(0.0);
    for (glm::dvec3& error : list) {
      for (int k = 0; k < 3; ++k) error[k] = deviation / std::sqrt(k_axes) * normal(generator);
      mean += error / static_cast<double>(list.size());
    }
    for (glm::dvec3& error : list) error -= mean;
    return list;
  };
  const std::vector<glm::dvec3> turns = errors(glm::radians(degrees)), shifts = errors(part);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const glm::dmat4 view(views[i].camera.view);
    glm::dmat4 error(rotation_from_vector(turns[i]));
    error[3] = glm::dvec4(glm::length(glm::dvec3(view[3])) * shifts[i], 1.0);
    views[i].camera.view = glm::mat4(view * error);
  }
}

Image row_of(const std::vector<Image>& images) {
  std::vector<Image> shown(images.begin(), images.begin() + k_shown);
  for (Image& image : shown) image = opaque(std::move(image));
  return hstack(shown);
}

/// One shape, its views, and what is known of the truth.
class Trial {
 public:
  Trial(const Settings& settings, Shape shape)
      : settings_(settings),
        shape_(std::move(shape)),
        held_out_(cameras_around(k_held_out, 77)),
        volume_(voxelize(shape_.mesh, k_voxels, k_box)) {
    views_.width = views_.height = settings.smoke ? 32 : 128;
    const std::vector<Camera> cameras = cameras_around(k_views, 0);
    const std::vector<Image> images = render(shape_.mesh, cameras);
    for (std::size_t i = 0; i < k_views; ++i) views_.views.push_back({images[i], cameras[i]});
    targets_ = render(shape_.mesh, held_out_);
  }

  Json run(const Method& method) {
    ShapeViews views = views_;
    if (method.are_cameras_off) disturb(views.views);
    if (!method.preset.empty()) {
      const Smoothing finest = finest_smoothing(views, method.options);
      views.smoothing = scaled_smoothing(method.preset, finest.sigma, finest.gamma);
    }
    const ShapeSolver solver(settings_.device, views, method.options);
    const std::clock_t start = std::clock();
    cli::FitObserver observer(solver.most_iterations(), settings_.quiet);
    const ShapeResult result = solver.solve(observer.callback());
    const double cpu_seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    result_ = result.mesh;
    const std::vector<Image> images = render(result.mesh, held_out_);
    const double intersection_over_union = iou(voxelize(result.mesh, k_voxels, k_box), volume_);
    const double start_iou = iou(voxelize(result.start, k_voxels, k_box), volume_);
    if (!settings_.quiet) {
      std::printf("%s, %s: IoU %.4f, PSNR %.2f dB, %.1f s, %.1f CPU s\n", shape_.name.c_str(),
                  method.name.c_str(), intersection_over_union, psnr(images, targets_), result.seconds,
                  cpu_seconds);
    }
    return {{"shape", shape_.name},
            {"method", method.name},
            {"iou", intersection_over_union},
            {"start_iou", start_iou},
            {"held_out_psnr", psnr(images, targets_)},
            {"start_held_out_psnr", psnr(render(result.start, held_out_), targets_)},
            {"seconds", result.seconds},
            {"cpu_seconds", cpu_seconds},
            {"iterations", result.history.size()},
            {"vertices", result.mesh.positions.size()}};
  }

  /// Truth above the last result, from views held out.
  Image picture() const { return vstack({row_of(targets_), row_of(render(result_, held_out_))}); }
  const std::string& name() const { return shape_.name; }
  const Mesh& result() const { return result_; }

 private:
  std::vector<Image> render(const Mesh& mesh, const std::vector<Camera>& cameras) const {
    return cli::render_rigidly(settings_.device, mesh, cameras, views_.width, views_.height);
  }

  const Settings& settings_;
  Shape shape_;
  std::vector<Camera> held_out_;
  VoxelGrid volume_;
  ShapeViews views_;
  std::vector<Image> targets_;
  Mesh result_;
};

}  // namespace

void run_shapes(const Settings& settings) {
  const std::vector<Method> methods = make_methods(settings.smoke);
  Json rows = Json::array();
  std::vector<Image> pictures;
  std::vector<Trial> trials;
  std::vector<Shape> shapes = make_shapes(settings.smoke);
  const auto run = [&](Trial& trial, const Method& method) {
    rows.push_back(trial.run(method));
    // After each: what has been measured is not lost with what is still to come.
    write_data(settings, "shapes",
               {{"views", k_views}, {"held_out", k_held_out}, {"voxels", k_voxels}, {"rows", rows}});
  };
  for (Shape& shape : shapes) {
    write_mesh(settings.folder / (shape.name + ".truth.obj"), shape.mesh);
    Trial& trial = trials.emplace_back(settings, std::move(shape));
    run(trial, methods.front());
    pictures.push_back(trial.picture());
    write_mesh(settings.folder / (trial.name() + ".ply"), trial.result());
  }
  write_image(settings.folder / "shapes.png", vstack(pictures, 8));
  announce(settings, "shapes.png");
  for (Trial& trial : trials) {
    for (std::size_t i = 1; i < methods.size(); ++i) run(trial, methods[i]);
  }
}

void run_cameras(const Settings& settings) {
  Json rows = Json::array();
  for (Shape& shape : make_shapes(settings.smoke)) {
    Trial trial(settings, std::move(shape));
    for (const Method& method : make_camera_methods(settings.smoke)) rows.push_back(trial.run(method));
  }
  write_data(settings, "cameras",
             {{"views", k_views}, {"held_out", k_held_out}, {"voxels", k_voxels}, {"rows", rows}});
}

}  // namespace dpr::experiments
