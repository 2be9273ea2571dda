// dpr render: a mesh or a scene to an image.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "cli/aov_files.hpp"
#include "cli/commands.hpp"
#include "cli/file_options.hpp"
#include "cli/lens_options.hpp"
#include "cli/option_names.hpp"
#include "cli/scene_file.hpp"
#include "cli/text.hpp"
#include "dpr/error.hpp"
#include "dpr/image.hpp"
#include "dpr/renderer.hpp"
#include "image/codec.hpp"
#include "mesh/bounding_box.hpp"
#include "scene/light_table.hpp"
#include "scene/scene_parts.hpp"
#include "scene/triangles_in_view.hpp"
#include "smoothing/option_fields.hpp"

namespace dpr::cli {
namespace {

struct RenderOptions {
  std::string mesh, scene, output, saved_scene;
  std::vector<std::string> aovs;
  bool rigid = false;
  std::optional<std::string> cull, shading;
  LensSubdivisionOptions lens;
  float elevation = 25, azimuth = 35;  // degrees: three sides of a box are in sight
};

struct Sphere {
  glm::vec3 center{0.0F};
  float radius = 0;
};

/// About the centre of the bounding box: not the smallest sphere, but never much larger.
Sphere bounding_sphere(const Mesh& mesh) {
  Sphere sphere{center(bounding_box(mesh.positions)), 0};
  for (const glm::vec3& p : mesh.positions) {
    sphere.radius = std::max(sphere.radius, glm::distance(p, sphere.center));
  }
  return sphere;
}

/// A camera from which the sphere fills the image but for a margin.
Camera fit_camera(const CLI::App& command, const Sphere& sphere, const RenderOptions& options, int width,
                  int height) {
  constexpr float k_margin = 1.05F;
  constexpr float k_fov_y_degrees = 40.0F;
  const float aspect = static_cast<float>(width) / static_cast<float>(height);
  const float half_tangent = std::tan(glm::radians(k_fov_y_degrees / 2)) * std::min(1.0F, aspect);
  // What numbers at that place cannot tell from a point is a point, which any camera suits.
  const float least = 1e-6F * glm::length(sphere.center);
  const float largest = std::max(sphere.radius, least);
  const float radius = k_margin * (largest > 0 ? largest : 1.0F);
  const float distance = radius / std::sin(std::atan(half_tangent));
  if (!std::isfinite(distance))
    throw IoError(options.mesh,
                  "a mesh as large as numbers can be, expected one that a camera can stand before");
  const OptionNames names{{"elevation_degrees", "--elevation"}, {"azimuth_degrees", "--azimuth"}};
  Camera camera = with_option_names(command, names, [&] {
    return orbit_camera(distance, options.elevation, options.azimuth, sphere.center);
  });
  camera.fov_y_degrees = k_fov_y_degrees;
  camera.znear = distance - radius;
  camera.zfar = distance + radius;
  return camera;
}

/// Smoothing of a picture: edges blurred by a quarter of a pixel. Flags that describe another member of the
/// family start from the triangles' noise, with as little noise in depth as seams allow.
Smoothing picture_smoothing(const SmoothingOptions& flags, glm::ivec2 size) {
  constexpr float k_blur_pixels = 0.25F, k_gamma_of_triangles = 1e-3F;
  const float blur = k_blur_pixels * 2 / static_cast<float>(std::min(size.x, size.y));  // NDC
  Smoothing smoothing;
  if (!says_nothing(flags) && flags.noise != Noise::pixel) {
    smoothing = smoothing_preset("gaussian");
    smoothing.gamma = k_gamma_of_triangles;
  }
  smoothing.sigma = blur * blur;
  return smoothing;
}

/// A soft light from above the camera's left shoulder.
Lights fit_lights(const Camera& camera, const Sphere& sphere) {
  const glm::mat4 to_world = glm::inverse(camera.view);
  const glm::vec3 shoulder(-2 * sphere.radius, 3 * sphere.radius, 0);
  PointLight light;
  light.position = glm::vec3(to_world * glm::vec4(shoulder, 1));
  light.diffuse = glm::vec3(0.65F);
  light.specular = glm::vec3(0.05F);
  Lights lights;
  lights.ambient = glm::vec3(0.15F);
  lights.point = {light};
  return lights;
}

Scene mesh_scene(const CLI::App& command, const RenderOptions& options, const CommonOptions& common) {
  constexpr int k_size = 256;
  Scene scene;
  scene.width = scene.height = k_size;
  Notes notes;
  scene.meshes.push_back({read_mesh(options.mesh, notes), glm::mat4(1.0F)});
  const std::string note = noise_note({}, common.smoothing);
  if (!note.empty()) notes.push_back(note);
  const glm::ivec2 size = common.size ? parse_size(*common.size) : glm::ivec2(k_size);
  scene.smoothing = picture_smoothing(common.smoothing, size);
  apply(common, scene);
  print_notes(notes, common);
  const Sphere sphere = bounding_sphere(scene.meshes.front().mesh);
  scene.camera = fit_camera(command, sphere, options, scene.width, scene.height);
  scene.lights = fit_lights(scene.camera, sphere);
  return scene;
}

void set_shading(Scene& scene, const std::string& word) {
  const Shading shading = parse_shading(word, "--shading");
  if (!scene.lights)
    throw InvalidArgument("--shading", "\"" + word + "\" for a scene without lights", "a scene with lights");
  scene.lights->shading = shading;
}

/// The triangles of all meshes, and those of them that the camera does not show.
std::pair<std::size_t, TrianglesInView> count_triangles(const Scene& scene) {
  std::size_t faces = 0;
  TrianglesInView sum;
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    faces += mesh_of(scene, i).faces.size();
    const TrianglesInView counts = triangles_in_view(scene, i);
    sum.without_area += counts.without_area;
    sum.near += counts.near;
    sum.far += counts.far;
    sum.outside += counts.outside;
  }
  return {faces, sum};
}

/// The reason for a picture without a fragment.
std::string why_empty(const Scene& scene) {
  const auto [faces, sum] = count_triangles(scene);
  const std::size_t in_view = faces - sum.not_shown();
  if (in_view == 0) return "no triangle is in front of the camera, within the image, between znear and zfar";
  return counted(in_view, "triangle") + " in view, " + (scene.cull == Cull::none ? "" : "culled, or ") +
         "too small to be seen or too large for single precision";
}

/// Prints the number of triangles, and of those that the camera does not show.
void print_triangles(const RenderOptions& options, const Scene& scene, const RenderStatistics& statistics) {
  const auto [faces, sum] = count_triangles(scene);
  std::printf("%s: %dx%d, %s", options.output.c_str(), scene.width, scene.height,
              counted(faces, "triangle").c_str());
  if (statistics.faces > faces) std::printf(", cut into %zu for the lens", statistics.faces);
  const char* separator = "; not shown: ";
  const auto print = [&](std::size_t count, const char* why) {
    if (count == 0) return;
    std::printf("%s%zu %s", separator, count, why);
    separator = ", ";
  };
  print(sum.near, "nearer than znear");
  print(sum.far, "beyond zfar");
  print(sum.outside, "outside the image");
  print(sum.without_area, "without area");
  std::printf("\n");
}

void run(const CLI::App& command, const RenderOptions& options, CommonOptions& common) {
  require_image_format(options.output);
  if (options.rigid) common.smoothing.preset = "rigid";
  Scene scene =
      options.scene.empty() ? mesh_scene(command, options, common) : read_scene(options.scene, common);
  if (options.shading) set_shading(scene, *options.shading);
  if (options.cull) scene.cull = parse_cull(*options.cull, "--cull");
  const AovFiles aovs(options.aovs, options.output, scene);
  std::vector<std::filesystem::path> outputs = aovs.files();
  outputs.emplace_back(options.output);
  if (!options.saved_scene.empty()) outputs.emplace_back(options.saved_scene);
  require_outputs(outputs);
  const SubdividedScene drawn = subdivide(command, scene, options.lens);
  Renderer renderer(open_device(common));
  renderer.set_scene(drawn.scene);
  renderer.forward();
  const Image image = renderer.image();
  const bool keeps_silhouette = std::filesystem::path(options.output).extension() == ".exr";
  const RenderStatistics statistics = renderer.statistics();  // before there is a file: it may fail
  write_image(options.output, keeps_silhouette ? image : opaque(image), common.encoding());
  const std::vector<std::string> files_beside = aovs.write(renderer, scene, drawn);
  if (!options.saved_scene.empty()) write_scene(options.saved_scene, scene, {options.mesh});
  if (statistics.fragments == 0) print_notes({"the picture is empty: " + why_empty(scene)}, common);
  if (!common.quiet) {
    print_triangles(options, scene, statistics);
    for (const std::string& file : files_beside) std::printf("%s\n", file.c_str());
  }
  if (common.verbose) {
    std::printf("%zu tile pairs, %zu fragments in %zu bands, %zu bytes on the device\n", statistics.pairs,
                statistics.fragments, statistics.bands, statistics.device_bytes);
    aovs.print_sampling_error(renderer);
  }
}

}  // namespace

void add_render_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand("render", "Renders a mesh or a scene");
  const auto options = std::make_shared<RenderOptions>();
  auto* mesh = command->add_option(
      "MESH", options->mesh,
      "Mesh file (OBJ, PLY, OFF, STL, glTF); camera, light and a blur of a quarter of a pixel are fitted to "
      "it");
  mesh->type_name("");
  command->add_option("--scene", options->scene, "Scene file, instead of MESH")
      ->type_name("S.json")
      ->excludes(mesh);
  command->add_option("-o,--output", options->output, "Image to write; .exr keeps float RGBA")
      ->required()
      ->type_name("OUT.png");
  command
      ->add_option("--save-scene", options->saved_scene,
                   "Scene file to write, which shows MESH as the image does: the start for dpr gradient and "
                   "dpr pose")
      ->type_name("S.json");
  command->add_flag("--rigid", options->rigid,
                    "The nearest triangle wins, without any smoothing: --preset rigid");
  command
      ->add_option("--cull", options->cull,
                   "Leaves out faces that wind clockwise in the image (back), the others (front), or none")
      ->type_name("none|back|front");
  command
      ->add_option("--shading", options->shading,
                   "Evaluation of light: by face (flat), vertex (gouraud) or pixel (phong, the default, "
                   "blinn and microfacet); instead of the scene's")
      ->type_name("flat|gouraud|phong|blinn|microfacet");
  command
      ->add_option("--elevation", options->elevation,
                   "Degrees above the horizon of the camera fitted to MESH; 25 by default")
      ->type_name("FLOAT");
  command
      ->add_option("--azimuth", options->azimuth,
                   "Degrees from +z towards +x of the camera fitted to MESH; 35 by default")
      ->type_name("FLOAT");
  command
      ->add_option(
          "--aov", options->aovs,
          "Auxiliary outputs to write beside the image, as OUT.NAME.exr: depth, normal, face_id, "
          "barycentrics, uv, effective_faces; standard_error and gradient_standard_error of Monte Carlo")
      ->delimiter(',')
      ->allow_extra_args(false)  // what follows is MESH
      ->type_name("NAME[,NAME]");
  add_lens_options(*command, options->lens);
  add_common_options(*command, common);
  for (CLI::Option* smoothing : command->get_options()) {
    if (smoothing->get_group() == k_smoothing_group) command->get_option("--rigid")->excludes(smoothing);
  }
  for (const char* const fitted : {"--elevation", "--azimuth", "--save-scene"}) {
    command->get_option(fitted)->excludes(command->get_option("--scene"));
  }
  command->footer("Example: dpr render bunny.obj -o bunny.png --size 512x512 --rigid");
  command->callback([command, options, &common] {
    if (options->mesh.empty() && options->scene.empty())
      throw InvalidArgument("arguments (dpr render)", "neither MESH nor --scene", "one of the two");
    run(*command, *options, common);
  });
}

}  // namespace dpr::cli
