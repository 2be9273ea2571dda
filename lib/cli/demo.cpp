// dpr demo: the pose of the coloured cube, found from 50 degrees away.
#include <cstdio>
#include <memory>
#include <random>

#include "base/output_file.hpp"
#include "base/uniform_number.hpp"
#include "cli/commands.hpp"
#include "cli/fit_report.hpp"
#include "cli/pose_report.hpp"
#include "cli/provenance.hpp"
#include "cli/scene_file.hpp"
#include "dpr/renderer.hpp"
#include "solve/polar.hpp"

namespace dpr::cli {
namespace {

constexpr double k_start_degrees = 50;
constexpr std::uint64_t k_axis_seed = 1;

/// The coloured cube with its colours at the vertices, which an OBJ file can hold: no two sides share one.
Mesh demo_cube() {
  Mesh cube = make_cube();
  cube.vertex_colors.resize(cube.positions.size());
  for (std::size_t face = 0; face < cube.faces.size(); ++face) {
    for (int corner = 0; corner < 3; ++corner) {
      cube.vertex_colors[cube.faces[face][corner]] = cube.face_colors[face];
    }
  }
  cube.face_colors.clear();
  return cube;
}

/// The scene of the paper's pose experiments, with the camera near enough that the cube fills the image in
/// any pose, and the light where the camera sees what it does.
Scene cube_scene() {
  constexpr float k_distance = 3.7F;  // the sphere about the cube spans 97% of the short side
  Scene scene;
  scene.camera = orbit_camera(k_distance, 30, 120);
  scene.meshes.push_back({demo_cube(), glm::mat4(1.0F)});
  Lights lights;
  lights.point = {{.position = {3, 5, -4}, .diffuse = glm::vec3(0.5F), .specular = glm::vec3(0.1F)}};
  scene.lights = lights;
  scene.smoothing = smoothing_preset("joint_gaussian");
  return scene;
}

Image rigid_image(const Device& device, Scene scene) {
  scene.smoothing = rigid_smoothing();
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  return renderer.image();
}

/// Uniform on the sphere, by rejection.
glm::dvec3 random_axis(std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  const auto uniform = [&] { return 2 * uniform_number(generator) - 1; };
  for (;;) {
    const glm::dvec3 v{uniform(), uniform(), uniform()};  // braces: drawn in this order
    const double length = glm::length(v);
    if (length > 0.1 && length <= 1) return v / length;
  }
}

/// A scene file of the demo's scene, with the cube in a pose. It leaves the smoothing to the commands.
Json scene_to_json(Scene scene, const Pose& pose) {
  scene.meshes.front().transform = affine(pose.rotation, pose.translation);
  return scene_without_smoothing(scene, {"cube.obj"});
}

/// Two rings of cameras about the cube, one above it and one below.
std::vector<Camera> cameras_around() {
  std::vector<Camera> cameras;
  for (const float elevation : {35.0F, -35.0F}) {
    for (int i = 0; i < 6; ++i) {
      Camera camera = orbit_camera(5, elevation, 60.0F * static_cast<float>(i));
      camera.fov_y_degrees = 45;
      camera.zfar = 10;
      cameras.push_back(camera);
    }
  }
  return cameras;
}

/// Images of the cube's colours, without its light, and the views file for `dpr fit`.
void write_demo_views(const std::filesystem::path& folder, const Device& device, const Mesh& cube) {
  constexpr int k_size = 64;
  const std::vector<Camera> cameras = cameras_around();
  const std::vector<Image> images = render_rigidly(device, cube, cameras, k_size, k_size);
  make_folder(folder / "views");
  Json views = Json::array();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const std::string file = "views/" + std::to_string(i) + ".exr";
    write_image(folder / file, images[i]);
    views.push_back({{"image", file}, {"camera", camera_with_view(cameras[i])}});
  }
  write_json(folder / "views.json", {{"width", k_size}, {"height", k_size}, {"views", views}});
}

/// Writes files on which the other commands can be tried.
void write_inputs(const std::filesystem::path& folder, const Device& device, const Scene& scene,
                  const Pose& truth, const Pose& start, const Image& target) {
  write_mesh(folder / "cube.obj", scene.meshes.front().mesh);
  write_json(folder / "truth.json", scene_to_json(scene, truth));
  write_json(folder / "scene.json", scene_to_json(scene, start));
  write_image(folder / "target.exr", target);
  write_demo_views(folder, device, scene.meshes.front().mesh);
}

void run(const CLI::App& command, const std::string& folder, const CommonOptions& common) {
  make_folder(folder);
  Scene scene = cube_scene();
  apply(common, scene);
  const Device device = open_device(common);
  const Image target = rigid_image(device, scene);
  PoseOptions options;
  if (gives_any(command, k_smoothing_group)) options.method = Descent{};  // least squares brings its own
  const PoseSolver solver(device, scene, target, options);
  const Pose truth = solver.scene_pose();

  const glm::dvec3 turn = glm::radians(k_start_degrees) * random_axis(common.seed.value_or(k_axis_seed));
  const Pose start{rotation_from_vector(turn) * truth.rotation, truth.translation};
  const PoseResult result = solver.solve(start, progress_callback(solver.most_iterations(), common.quiet));
  write_inputs(folder, device, scene, truth, start, target);
  const FoundBody found{{}, result};
  write_json(std::filesystem::path(folder) / "pose.json", poses_to_json(scene, {&found, 1}, truth.rotation));
  write_pose_report(folder, page_source("A cube's pose, found from 50 degrees away", common, {&device, 1}),
                    device, scene, {&found, 1}, {target, LeastSquares()}, {}, common.quiet, truth.rotation);
  if (!common.quiet) {
    std::printf("%s: from %.1f to %.2f degrees from the truth in %u iterations, %.1f s\n", folder.c_str(),
                angle_degrees(start.rotation, truth.rotation),
                angle_degrees(result.pose.rotation, truth.rotation), result.iterations, result.seconds);
  }
}

}  // namespace

void add_demo_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand(
      "demo", "Finds the pose of a built-in cube from 50 degrees away, with pictures");
  const auto folder = std::make_shared<std::string>();
  command->add_option("-o,--output", *folder, "Folder for the pictures and pose.json")
      ->required()
      ->type_name("DIR");
  add_common_options(*command, common);
  command->footer("Example: dpr demo -o demo-output");
  command->callback([command, folder, &common] { run(*command, *folder, common); });
}

}  // namespace dpr::cli
