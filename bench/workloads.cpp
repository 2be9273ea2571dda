#include "workloads.hpp"

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>
#include <utility>

#include "dpr/error.hpp"
#include "dpr/mesh.hpp"

namespace dpr::bench {
namespace {

constexpr std::uint32_t k_exact = 0;  // in a list of sample counts

/// Changes to the scene's mesh. inside: the camera is inside, so that faces cross the near plane. facets: every face has
/// a colour of its own, so that every edge in sight is a contour.
enum class Scenery { plain, inside, textured, lit, facets };

struct Definition {
  std::string_view name;
  unsigned subdivisions;  // of the icosphere; 0: the cube
  int size;
  float sigma, gamma;
  std::vector<std::uint32_t> samples;
  bool softras, own;  // rows of SoftRas' priors; of the joint composition and of the library's defaults
  unsigned views;
  float pixel_sigma = 0;  // of a row with noise of the pixel; 0: none
  Scenery scenery = Scenery::plain;
};

/// Noise of the pixel's rows: a blur of four pixels at 256x256, whatever the size.
constexpr float k_pixel_sigma = 1e-3F;

constexpr std::string_view k_sweep = "sweep-";

void add_sweeps(std::vector<Definition>& list) {
  constexpr float k_sigma = 1e-4F, k_gamma = 1e-3F;
  for (const unsigned subdivisions : {1U, 2U, 3U, 4U, 5U, 6U, 7U}) {
    list.push_back({"sweep-triangles", subdivisions, 256, k_sigma, k_gamma, {k_exact}, false, false, 1});
  }
  for (const unsigned subdivisions : {1U, 2U, 3U, 4U, 5U, 6U, 7U}) {
    list.push_back({"sweep-tessellation", subdivisions, 256, k_sigma, k_gamma, {}, false, false, 1, k_sigma});
  }
  for (const float sigma : {1e-5F, 1e-4F, 1e-3F, 1e-2F}) {
    list.push_back({"sweep-sigma", 6, 512, k_sigma, k_gamma, {}, false, false, 1, sigma});
  }
  for (const int size : {64, 128, 256, 512, 1024}) {
    list.push_back({"sweep-pixels", 3, size, k_sigma, k_gamma, {k_exact}, false, false, 1});
  }
  list.push_back(
      {"sweep-samples", 3, 128, k_sigma, k_gamma, {1, 2, 4, 8, 16, 32, 64, 128, 256}, false, false, 1});
  for (const unsigned views : {1U, 2U, 4U, 8U, 16U, 32U, 64U}) {
    list.push_back({"sweep-views", 3, 128, k_sigma, k_gamma, {k_exact}, false, false, views});
  }
}

const std::vector<Definition>& definitions() {
  static const std::vector<Definition> all = [] {
    std::vector<Definition> list{
        {"cube128", 0, 128, 1e-3F, 1e-2F, {k_exact, 8, 32, 128}, false, true, 1, k_pixel_sigma},
        {"sphere64", 3, 64, 1e-4F, 1e-3F, {k_exact, 8, 32}, true, true, 1},
        {"sphere128", 3, 128, 1e-4F, 1e-3F, {k_exact, 8, 32}, true, true, 1},
        {"sphere256", 3, 256, 1e-4F, 1e-3F, {k_exact, 8, 32}, true, true, 1, k_pixel_sigma},
        {"room256", 3, 256, 1e-4F, 1e-3F, {k_exact, 8}, false, true, 1, k_pixel_sigma, Scenery::inside},
        {"textured256", 3, 256, 1e-4F, 1e-3F, {k_exact}, false, true, 1, k_pixel_sigma, Scenery::textured},
        {"lit256", 3, 256, 1e-4F, 1e-3F, {k_exact}, false, true, 1, k_pixel_sigma, Scenery::lit},
        {"views24", 3, 128, 1e-4F, 1e-3F, {k_exact, 8, 32}, true, true, 24},
        {"sphere20k", 5, 256, 1e-4F, 1e-3F, {k_exact, 8}, false, true, 1, k_pixel_sigma},
        {"facets20k", 5, 256, 1e-4F, 1e-3F, {}, false, true, 1, k_pixel_sigma, Scenery::facets},
        {"sphere80k", 6, 512, 1e-4F, 1e-3F, {k_exact, 8}, false, true, 1, k_pixel_sigma},
        {"million", 8, 1024, 1e-6F, 1e-3F, {k_exact, 8}, false, true, 1, k_pixel_sigma}};
    add_sweeps(list);
    return list;
  }();
  return all;
}

/// A map of longitudes and latitudes, of a checkered pattern of 256x256 texels.
void add_texture(Mesh& mesh) {
  constexpr int k_size = 256, k_square = 16;
  Texture texture;
  texture.width = texture.height = k_size;
  texture.filter = Filter::trilinear;
  for (int i = 0; i < k_size * k_size; ++i) {
    const bool dark = (i / k_size / k_square + i % k_size / k_square) % 2 == 0;
    texture.texels.emplace_back(dark ? 0.2F : 0.8F);
  }
  for (const glm::vec3& p : mesh.positions) {
    mesh.texcoords.emplace_back(std::atan2(p.x, p.z) / glm::two_pi<float>() + 0.5F,
                                std::asin(std::clamp(p.y, -1.0F, 1.0F)) / glm::pi<float>() + 0.5F);
  }
  mesh.face_texcoords = mesh.faces;
  mesh.textures = {std::move(texture)};
}

/// A light of each of three kinds.
Lights make_lights() {
  Lights lights;
  lights.point = {{.position = {2, 4, 5}}};
  lights.directional = {DirectionalLight{}};
  lights.harmonics.assign(9, glm::vec3(0.1F));
  return lights;
}

Scene make_scene(const Definition& d) {
  // The published program's blur radius, and the cameras of its demos.
  constexpr float k_blur_radius_in_sigma = 9.21F;
  constexpr float k_cube_distance = 6.7F, k_sphere_distance = 2.7F;
  // Nearer to the wall behind than the near plane is to the camera.
  constexpr float k_room_distance = 0.8F, k_room_near = 0.3F;
  Scene scene;
  scene.width = scene.height = d.size;
  const bool cube = d.subdivisions == 0;
  scene.meshes.push_back({cube ? make_cube() : make_icosphere(d.subdivisions)});
  scene.camera = orbit_camera(cube ? k_cube_distance : k_sphere_distance, 30.0F, 120.0F);
  scene.smoothing = smoothing_preset("gaussian");
  if (d.scenery == Scenery::inside) {
    scene.camera = orbit_camera(k_room_distance, 30.0F, 120.0F);
    scene.camera.znear = k_room_near;
  } else if (d.scenery == Scenery::textured) {
    add_texture(scene.meshes[0].mesh);
    scene.gradients.texture = scene.gradients.texcoords = true;
  } else if (d.scenery == Scenery::lit) {
    scene.lights = make_lights();
    scene.gradients.lights = true;
  } else if (d.scenery == Scenery::facets) {
    Mesh& mesh = scene.meshes[0].mesh;
    const std::vector<glm::vec3> colors = std::exchange(mesh.vertex_colors, {});
    for (const glm::uvec3& f : mesh.faces)
      mesh.face_colors.push_back((colors[f.x] + colors[f.y] + colors[f.z]) / 3.0F);
  }
  scene.smoothing.sigma = d.sigma;
  scene.smoothing.gamma = d.gamma;
  scene.smoothing.blur_radius = k_blur_radius_in_sigma * d.sigma;
  scene.smoothing.variance_reduction = VarianceReduction::rigid;
  return scene;
}

std::vector<View> make_views(const Definition& d, const Scene& scene) {
  constexpr float k_full_turn = 360.0F;
  std::vector<View> views;
  for (unsigned i = 0; i < d.views; ++i) {
    Camera camera = scene.camera;
    if (d.views > 1) {
      camera = orbit_camera(2.7F, 30.0F, k_full_turn * static_cast<float>(i) / static_cast<float>(d.views));
    }
    views.push_back({camera, {scene.meshes[0].transform}});
  }
  return views;
}

std::vector<Variant> make_variants(const Definition& d, const Smoothing& published) {
  const float half_a_pixel = 1.0F / static_cast<float>(d.size);  // NDC, of which sigma is the square
  std::vector<Variant> list;
  for (const std::uint32_t samples : d.samples) {
    Smoothing smoothing = published;
    if (samples != k_exact) {
      smoothing.occupancy_estimator = smoothing.aggregation_estimator = Estimator::monte_carlo;
      smoothing.samples = samples;
    }
    list.push_back({"gaussian", smoothing});
  }
  if (d.softras) {
    Smoothing smoothing = published;
    smoothing.occupancy_prior = Prior::logistic;
    smoothing.depth_prior = Prior::gumbel;
    list.push_back({"softras", smoothing});
  }
  if (d.own) {
    Smoothing smoothing = published;
    smoothing.composition = Composition::joint;
    list.push_back({"gaussian", smoothing});
    // The scales are the scene's; all else is the library's choice.
    Smoothing defaults;
    defaults.sigma = d.sigma;
    defaults.gamma = d.gamma;
    list.push_back({"default", defaults});
  }
  if (d.pixel_sigma > 0) {
    Smoothing smoothing = smoothing_preset("pixel", d.size, d.size);
    smoothing.sigma = d.pixel_sigma;
    list.push_back({"pixel", smoothing});
    if (d.own) {
      list.push_back({"pixel", smoothing, Moves::camera});
      smoothing.sigma = half_a_pixel * half_a_pixel;
      list.push_back({"pixel-sharp", smoothing});
    }
  }
  if (d.pixel_sigma > 0 && d.own && d.scenery == Scenery::plain) {
    for (const Composition composition : {Composition::barrier, Composition::joint}) {
      Smoothing smoothing = smoothing_preset("gaussian");
      smoothing.sigma = half_a_pixel * half_a_pixel;
      smoothing.composition = composition;
      // The barrier is what is held against z-buffers, to which a far side does not count.
      if (composition == Composition::barrier) smoothing.gamma = 1e-4F;
      list.push_back({"sharp", smoothing});
    }
  }
  return list;
}

std::vector<std::string_view> names_where(bool sweeps) {
  std::vector<std::string_view> names;
  for (const Definition& d : definitions()) {
    if (d.name.starts_with(k_sweep) != sweeps) continue;
    if (names.empty() || names.back() != d.name) names.push_back(d.name);
  }
  return names;
}

}  // namespace

std::vector<std::string_view> workload_names() { return names_where(false); }
std::vector<std::string_view> sweep_names() { return names_where(true); }

std::string_view describe(std::string_view name) {
  struct Line {
    std::string_view name, text;
  };
  static constexpr Line k_lines[] = {
      {"cube128", "coloured cube, 12 triangles, 128x128; exact, M = 8, 32, 128"},
      {"sphere64", "1,280 triangles, 64x64; exact, M = 8, 32, SoftRas"},
      {"sphere128", "the same, 128x128"},
      {"sphere256", "the same, 256x256"},
      {"room256", "sphere256 from within, through the near plane; exact, M = 8"},
      {"textured256", "sphere256 with a trilinear texture of 256x256 texels; exact"},
      {"lit256", "sphere256 with a point light, a directional one and harmonics, Phong; exact"},
      {"views24", "sphere128 from 24 cameras in one batch"},
      {"sphere20k", "20,480 triangles, 256x256; exact, M = 8"},
      {"facets20k", "sphere20k with colours of faces; exact"},
      {"sphere80k", "81,920 triangles, 512x512; exact, M = 8"},
      {"million", "1,310,720 triangles, 1024x1024; exact, M = 8"},
      {"sweep-triangles", "spheres of 80 to 327,680 triangles, 256x256, exact"},
      {"sweep-tessellation", "the same with noise of the pixel"},
      {"sweep-sigma", "sphere80k with noise of the pixel, sigma 1e-5 to 1e-2"},
      {"sweep-pixels", "1,280 triangles, 64x64 to 1024x1024, exact"},
      {"sweep-samples", "sphere128, M = 1 to 256"},
      {"sweep-views", "sphere128, exact, 1 to 64 views in a batch"}};
  const auto* const line = std::ranges::find(k_lines, name, &Line::name);
  return line == std::end(k_lines) ? std::string_view() : line->text;
}

void require_workload(std::string_view name) {
  std::string names;
  for (const Definition& d : definitions()) {
    if (d.name == name) return;
    if (!names.ends_with(d.name)) names += (names.empty() ? "" : ", ") + std::string(d.name);
  }
  throw InvalidArgument("--workload (command line)", "\"" + std::string(name) + "\"", "one of " + names);
}

std::vector<Workload> make_workloads(std::string_view name) {
  require_workload(name);
  std::vector<Workload> list;
  for (const Definition& d : definitions()) {
    if (d.name != name) continue;
    const Scene scene = make_scene(d);
    list.push_back({std::string(name), scene, make_views(d, scene), make_variants(d, scene.smoothing)});
  }
  return list;
}

}  // namespace dpr::bench
