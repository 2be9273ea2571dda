// A template bent to a photograph: a face whose camera, light and shape are found, and how far its features
// are from where they were marked by hand, before and after.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/gtc/matrix_transform.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "base/input_file.hpp"
#include "cli/fit_report.hpp"
#include "dpr/dpr.hpp"
#include "experiment.hpp"
#include "mesh/bounding_box.hpp"
#include "views.hpp"

namespace dpr::experiments {
namespace {

constexpr int k_enlarged = 2;  // times, in the picture
constexpr float k_turn_degrees = 35;

/// A vertex and where the photograph shows it, pixels from its upper left corner.
struct Landmark {
  std::size_t vertex;
  glm::dvec2 place;
};

std::vector<Landmark> read_landmarks(const std::filesystem::path& file) {
  std::istringstream lines(read_file(file));
  std::string line;
  std::getline(lines, line);  // the head
  std::vector<Landmark> landmarks;
  Landmark mark{};
  char comma = 0;
  while (lines >> mark.vertex >> comma >> mark.place.x >> comma >> mark.place.y) landmarks.push_back(mark);
  return landmarks;
}

/// Projection of a point, in pixels from the upper left corner of an image of that size.
glm::dvec2 pixel_of(const Camera& camera, int width, int height, const glm::vec3& point) {
  const Projection p = projection(camera, width, height);
  const glm::dvec4 at = glm::dmat4(camera.view) * glm::dvec4(point, 1);
  const glm::dvec2 ndc = glm::dvec2(p.scale) * glm::dvec2(at) / -at.z + glm::dvec2(p.offset);
  const double half = 0.5 * std::min(width, height);
  return {0.5 * width + half * ndc.x, 0.5 * height - half * ndc.y};
}

/// Root mean square, pixels.
double landmark_error(const ShapeViews& views, const Mesh& mesh, const std::vector<Landmark>& landmarks) {
  double sum = 0;
  for (const Landmark& mark : landmarks) {
    const glm::vec3& point = mesh.positions.at(mark.vertex);
    const glm::dvec2 off = pixel_of(views.views[0].camera, views.width, views.height, point) - mark.place;
    sum += glm::dot(off, off);
  }
  return std::sqrt(sum / static_cast<double>(landmarks.size()));
}

Image render_on_white(const Settings& settings, const Mesh& mesh, const Camera& camera, int width,
                      int height) {
  return cli::render_rigidly(settings.device, mesh, {camera}, width, height, glm::vec3(1)).front();
}

/// The mesh with the photograph on it, from where it was taken.
Mesh textured(Mesh mesh, const Image& photograph, const Camera& camera) {
  mesh.vertex_colors.clear();
  Texture texture;
  texture.width = photograph.width;
  texture.height = photograph.height;
  texture.wrap = Wrap::clamp;
  for (const glm::vec4& pixel : photograph.pixels) texture.texels.emplace_back(pixel);
  mesh.textures = {texture};
  for (const glm::vec3& p : mesh.positions) {
    const glm::dvec2 at = pixel_of(camera, photograph.width, photograph.height, p);
    mesh.texcoords.emplace_back(at.x / photograph.width, 1 - at.y / photograph.height);
  }
  mesh.face_texcoords = mesh.faces;
  return mesh;
}

/// The photograph with more pixels, interpolated between its own.
Image enlarged(const Settings& settings, const Image& photograph) {
  constexpr float k_distance = 2;
  const float aspect = static_cast<float>(photograph.width) / static_cast<float>(photograph.height);
  Mesh square;
  square.positions = {{-aspect, -1, 0}, {aspect, -1, 0}, {aspect, 1, 0}, {-aspect, 1, 0}};
  square.faces = {{0, 1, 2}, {0, 2, 3}};
  Camera camera = orbit_camera(k_distance, 0, 0);
  camera.fov_y_degrees = glm::degrees(2 * std::atan(1 / k_distance));
  return render_on_white(settings, textured(square, photograph, camera), camera,
                         k_enlarged * photograph.width, k_enlarged * photograph.height);
}

/// The mesh's edges on the picture, which the camera took.
Image with_edges(Image picture, const Mesh& mesh, const Camera& camera) {
  constexpr float k_opacity = 0.3F;
  const glm::vec4 green(0.05F, 0.9F, 0.1F, 1);
  for (const glm::uvec3& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      const glm::dvec2 a = pixel_of(camera, picture.width, picture.height, mesh.positions[face[k]]);
      const glm::dvec2 b = pixel_of(camera, picture.width, picture.height, mesh.positions[face[(k + 1) % 3]]);
      const int steps = static_cast<int>(std::ceil(glm::distance(a, b))) + 1;
      for (int step = 0; step < steps; ++step) {
        const glm::ivec2 at(glm::floor(glm::mix(a, b, (step + 0.5) / steps)));
        if (at.x < 0 || at.y < 0 || at.x >= picture.width || at.y >= picture.height) continue;
        picture.at(at.x, at.y) = glm::mix(picture.at(at.x, at.y), green, k_opacity);
      }
    }
  }
  return picture;
}

/// The shape as the camera would see it had it gone around it by so many degrees.
Camera gone_around(Camera camera, const Mesh& mesh, float degrees) {
  const glm::vec3 middle = center(bounding_box(mesh.positions));
  const glm::mat4 turn = glm::rotate(glm::mat4(1), glm::radians(degrees), glm::vec3(0, 1, 0));
  camera.view =
      camera.view * glm::translate(glm::mat4(1), middle) * turn * glm::translate(glm::mat4(1), -middle);
  return camera;
}

/// Agreement of the colours where the photograph counts, in decibels.
double psnr_inside(const Settings& settings, const ShapeViews& views, const Mesh& mesh) {
  const ShapeView& view = views.views[0];
  Image image = cli::render_rigidly(settings.device, mesh, {view.camera}, views.width, views.height,
                                    views.background, views.lights)
                    .front();
  Image target = view.image;
  for (std::size_t i = 0; i < target.pixels.size(); ++i) target.pixels[i].a *= view.mask.pixels[i].x;
  constexpr float k_inside = 0.99F;
  return psnr({image}, {target}, k_inside);
}

Image photograph_sheet(const Settings& settings, const ShapeViews& views, const Image& photograph,
                       const ShapeResult& result) {
  const Camera& camera = views.views[0].camera;
  const int width = k_enlarged * views.width, height = k_enlarged * views.height;
  const Image large = enlarged(settings, photograph);
  const Mesh shown = textured(result.mesh, photograph, camera);
  return hstack(
      {large, with_edges(large, result.start, camera), with_edges(large, result.mesh, camera),
       render_on_white(settings, shown, gone_around(camera, shown, k_turn_degrees), width, height)});
}

}  // namespace

void run_photograph(const Settings& settings) {
  const std::filesystem::path folder = std::filesystem::path(DPR_BENCH_DATA) / "face";
  ShapeViews views = read_views(folder / "views.json");
  const Image photograph = read_image(folder / "astronaut.png");
  const std::vector<Landmark> landmarks = read_landmarks(folder / "landmarks.csv");
  PoseResult pose;
  if (settings.smoke) {
    views.views[0].knowledge = CameraKnowledge::known;  // it is not far from it
  } else {
    PoseOptions options;
    options.solve_focal = true;
    std::get<LeastSquares>(options.method).robust =
        true;  // shadows, and a mouth that the template has closed
    pose = find_camera(settings.device, views, 0, options);
  }
  ShapeOptions bending = template_shape_options();
  bending.loss.l1 = 0;
  bending.loss.robust = 20;
  views.lights = find_light(settings.device, views, bending.loss.robust_scale);
  if (settings.smoke) bending.iterations = 10;
  const ShapeResult result = ShapeSolver(settings.device, views, bending).solve();
  const double before = landmark_error(views, result.start, landmarks);
  const double after = landmark_error(views, result.mesh, landmarks);
  if (!settings.quiet)
    std::printf(
        "landmarks: %.2f pixels off before, %.2f after; %.1f s for the camera, %.1f s for the shape\n",
        before, after, pose.seconds, result.seconds);
  const glm::dmat4 to_world = glm::inverse(glm::dmat4(views.views[0].camera.view));
  write_data(settings, "photograph",
             {{"pixels", views.width},
              {"vertices", result.mesh.positions.size()},
              {"landmarks", landmarks.size()},
              {"start_landmark_error_pixels", before},
              {"landmark_error_pixels", after},
              {"start_psnr", psnr_inside(settings, views, result.start)},
              {"psnr", psnr_inside(settings, views, result.mesh)},
              {"strain", std::sqrt(result.history.back().mesh_loss / static_cast<double>(bending.rigidity))},
              {"field_of_view_degrees", cli::number(views.views[0].camera.fov_y_degrees)},
              {"camera_position", cli::to_json(glm::dvec3(to_world[3]))},
              {"camera_seconds", pose.seconds},
              {"shape_seconds", result.seconds}});
  write_image(settings.folder / "photograph.png",
              opaque(photograph_sheet(settings, views, photograph, result)));
  announce(settings, "photograph.png");
}

}  // namespace dpr::experiments
