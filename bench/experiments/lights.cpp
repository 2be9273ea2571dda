// Lights from images: the lights of a known shape, every kind, found from wrong ones by the gradients of six
// noisy 8-bit views, and how far what was found is from the truth.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "dpr/dpr.hpp"
#include "experiment.hpp"
#include "scene/gradient_table.hpp"
#include "scene/light_table.hpp"
#include "views.hpp"

namespace dpr::experiments {
namespace {

constexpr std::uint64_t k_seed = 1;
constexpr float k_noise = 0.01F;  // standard deviation of the target's, beside that of 8 bits
constexpr double k_first_rate = 0.1, k_last_rate = 1e-3;
// Steps of an angle and of a position where a colour or a direction moves by 1.
constexpr double k_degrees_of_a_step = 20, k_length_of_a_step = 4;

/// Uniform numbers that are the same with every standard library.
class Random {
 public:
  float operator()(float low, float high) {
    return low + (high - low) * static_cast<float>(static_cast<double>(engine_()) / 4294967296.0);
  }
  glm::vec3 vector(float low, float high) {
    const float x = (*this)(low, high), y = (*this)(low, high);
    return {x, y, (*this)(low, high)};
  }
  /// A unit vector above the horizon and in front.
  glm::vec3 towards_light() {
    const float x = (*this)(-1, 1), y = (*this)(0.1F, 1);
    return glm::normalize(glm::vec3(x, y, (*this)(0.3F, 1)));
  }
  float gaussian() {
    const auto radius = std::sqrt(-2 * std::log((*this)(1e-7F, 1)));
    return radius * std::cos((*this)(0, 2 * std::numbers::pi_v<float>));
  }

 private:
  std::mt19937 engine_{k_seed};
};

/// A grey surface with bumps, seen from all sides.
Scene make_scene(bool smoke) {
  Scene scene;
  scene.width = scene.height = smoke ? 24 : 64;
  scene.camera = orbit_camera(4, 20, -25);
  scene.camera.fov_y_degrees = 40;
  Mesh mesh = make_icosphere(smoke ? 2 : 4);
  for (glm::vec3& p : mesh.positions) p *= 1 + 0.15F * std::sin(4 * p.x + 1) * std::cos(3 * p.y + p.z);
  mesh.vertex_colors.assign(mesh.positions.size(), glm::vec3(0.8F));
  scene.meshes = {{std::move(mesh)}};
  scene.smoothing = smoothing_preset("pixel");
  scene.gradients = no_gradients();
  scene.gradients.lights = true;
  return scene;
}

std::vector<View> make_views(const Scene& scene) {
  std::vector<View> views(6, View{scene.camera, {scene.meshes[0].transform}});
  for (std::size_t v = 0; v < views.size(); ++v) {
    const float elevation = v % 2 == 0 ? 35 : -35;
    views[v].camera.view = orbit_camera(4, elevation, 60 * static_cast<float>(v)).view;
  }
  return views;
}

Lights dim(Shading shading) {
  Lights lights;
  lights.ambient = glm::vec3(0.2F);
  lights.shininess = 16;
  lights.shading = shading;
  return lights;
}

/// The true lights and those to begin with.
struct Problem {
  Lights truth, start;
};

/// An error of what was found, as the table has it.
struct Figure {
  std::string name, unit;
  double value;
};

struct Kind {
  std::string name;
  Problem (*make)(Random& random);
  std::vector<Figure> (*errors)(const Lights& found, const Lights& truth);
};

/// Error in per cent of the distance from the middle of the shape.
double position_error(const glm::vec3& found, const glm::vec3& truth) {
  return 100 * static_cast<double>(glm::distance(found, truth) / glm::length(truth));
}

double direction_error(const glm::vec3& found, const glm::vec3& truth) {
  const glm::dvec3 a = glm::normalize(glm::dvec3(found)), b = glm::normalize(glm::dvec3(truth));
  return glm::degrees(2 * std::asin(std::min(glm::distance(a, b) / 2, 1.0)));
}

Problem make_point(Random& random) {
  Problem problem{dim(Shading::phong), dim(Shading::phong)};
  problem.truth.ambient = random.vector(0.1F, 0.3F);
  problem.truth.point = {
      {random(2, 5) * random.towards_light(), random.vector(0.4F, 0.7F), random.vector(0.2F, 0.4F)}};
  problem.start.point = {{4.0F * random.towards_light()}};
  return problem;
}

Problem make_directional(Random& random) {
  Problem problem{dim(Shading::blinn), dim(Shading::blinn)};
  problem.truth.ambient = random.vector(0.1F, 0.3F);
  problem.truth.directional = {
      {-random.towards_light(), random.vector(0.4F, 0.7F), random.vector(0.2F, 0.4F)}};
  problem.start.directional = {{-random.towards_light()}};
  return problem;
}

/// The cone's edge lies on the shape, in the truth and at the start.
Problem make_spot(Random& random) {
  Problem problem{dim(Shading::phong), dim(Shading::phong)};
  const glm::vec3 side = random.towards_light();
  const auto aimed = [&](const glm::vec3& from, float angle, float inner) {
    SpotLight light;
    light.position = random(3, 5) * glm::normalize(from);
    light.direction = random.vector(-0.2F, 0.2F) - light.position;
    const float to_edge = glm::degrees(std::atan(0.8F / glm::length(light.position)));
    light.angle_degrees = angle * to_edge;
    light.inner_angle_degrees = inner * to_edge;
    return light;
  };
  problem.truth.spot = {aimed(side, 1, 0.6F)};
  problem.truth.spot[0].diffuse = random.vector(0.4F, 0.7F);
  problem.start.spot = {aimed(side + random.vector(-0.4F, 0.4F), 1.2F, 0.4F)};
  return problem;
}

/// Lit from everywhere, and more from some sides. The ambient light is the first coefficient's and stays.
Problem make_harmonics(Random& random) {
  Problem problem{dim(Shading::phong), dim(Shading::phong)};
  for (std::size_t k = 0; k < k_harmonics; ++k) problem.truth.harmonics.push_back(random.vector(-0.5F, 0.5F));
  problem.truth.harmonics[0] += 1.5F;
  problem.start.harmonics.resize(k_harmonics);
  return problem;
}

double harmonics_error(const Lights& found, const Lights& truth) {
  double difference = 0, size = 0;
  for (std::size_t k = 0; k < k_harmonics; ++k) {
    const glm::dvec3 wanted(truth.harmonics[k]), error = glm::dvec3(found.harmonics[k]) - wanted;
    difference += glm::dot(error, error);
    size += glm::dot(wanted, wanted);
  }
  return 100 * std::sqrt(difference / size);
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all{
      {"point", make_point,
       [](const Lights& found, const Lights& truth) -> std::vector<Figure> {
         return {{"position", "%", position_error(found.point[0].position, truth.point[0].position)}};
       }},
      {"directional", make_directional,
       [](const Lights& found, const Lights& truth) -> std::vector<Figure> {
         return {{"direction", "degrees",
                  direction_error(found.directional[0].direction, truth.directional[0].direction)}};
       }},
      {"spot", make_spot,
       [](const Lights& found, const Lights& truth) -> std::vector<Figure> {
         const SpotLight &a = found.spot[0], &b = truth.spot[0];
         return {
             {"position", "%", position_error(a.position, b.position)},
             {"direction", "degrees", direction_error(a.direction, b.direction)},
             {"angle_degrees", "degrees", std::abs(static_cast<double>(a.angle_degrees - b.angle_degrees))}};
       }},
      {"harmonics", make_harmonics, [](const Lights& found, const Lights& truth) -> std::vector<Figure> {
         return {{"harmonics", "%", harmonics_error(found, truth)}};
       }}};
  return all;
}

/// As a camera's file has it: noise, and 255 steps.
void spoil(Image& image, Random& random) {
  for (glm::vec4& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) pixel[c] += k_noise * random.gaussian();
  }
  round_to_8_bits(image);
}

/// Light takes nothing away, and a cone stays one that can be rendered with.
void clamp(Lights& lights) {
  for_each_light_number(lights, [](std::string_view key, float& number) {
    if (key == "ambient" || key == "diffuse" || key == "specular") number = std::max(number, 0.0F);
  });
  for (SpotLight& light : lights.spot) {
    light.angle_degrees = std::clamp(light.angle_degrees, 1.0F, 180.0F);
    light.inner_angle_degrees = std::clamp(light.inner_angle_degrees, 0.0F, light.angle_degrees - 0.5F);
  }
}

double unit_of(std::string_view key) {
  return key.ends_with("degrees") ? k_degrees_of_a_step : key == "position" ? k_length_of_a_step : 1;
}

/// Adam on every number of the lights, at a rate that falls by a constant factor. Of the environment's scenes
/// the ambient light is known.
Lights find(Renderer& renderer, ImageLoss& loss, Lights lights, unsigned iterations) {
  Optimizer optimizer({.learning_rate = k_first_rate});
  for (unsigned i = 0; i < iterations; ++i) {
    optimizer.set_learning_rate(k_first_rate * std::pow(k_last_rate / k_first_rate, double(i) / iterations));
    renderer.set_lights(lights);
    renderer.forward();
    loss.evaluate(renderer);
    SceneGradient gradient = renderer.backward(loss);
    if (!lights.harmonics.empty()) gradient.ambient = glm::dvec3(0);
    std::vector<double> slopes;
    for_each_light_number(gradient, [&](std::string_view key, auto value) {
      slopes.push_back(static_cast<double>(value) * unit_of(key));
    });
    auto step = optimizer.step(slopes).begin();
    for_each_light_number(lights, [&](std::string_view key, float& number) {
      number += static_cast<float>(*step++ * unit_of(key));
    });
    clamp(lights);
  }
  return lights;
}

Image render(Renderer& renderer, const Lights& lights) {
  renderer.set_lights(lights);
  renderer.forward();
  return renderer.image();
}

/// The numbers of a kind; a row of the first problem's target, start and result goes into `pictures`.
Json run_kind(const Settings& settings, const Kind& kind, const Scene& plain, std::size_t problems,
              unsigned iterations, std::vector<Image>& pictures) {
  Random random;
  Renderer renderer(settings.device);
  std::vector<std::vector<Figure>> before, after;
  for (std::size_t p = 0; p < problems; ++p) {
    const Problem problem = kind.make(random);
    Scene scene = plain;
    scene.lights = problem.truth;
    renderer.set_scene(scene);
    renderer.set_views(make_views(scene));
    renderer.forward();
    std::vector<Image> targets;
    for (std::size_t v = 0; v < renderer.views().size(); ++v)
      spoil(targets.emplace_back(renderer.image(v)), random);
    ImageLoss loss(settings.device, LossWeights::only(LossKind::mse), targets);
    const Lights found = find(renderer, loss, problem.start, iterations);
    before.push_back(kind.errors(problem.start, problem.truth));
    after.push_back(kind.errors(found, problem.truth));
    if (p == 0)
      pictures.push_back(hstack({targets[0], render(renderer, problem.start), render(renderer, found)}));
  }
  Json figures = Json::array();
  for (std::size_t f = 0; f < before[0].size(); ++f) {
    const auto sorted = [&](const std::vector<std::vector<Figure>>& all) {
      std::vector<double> values;
      for (const auto& of_problem : all) values.push_back(of_problem[f].value);
      std::ranges::sort(values);
      return values;
    };
    const std::vector<double> at_start = sorted(before), at_end = sorted(after);
    figures.push_back({{"name", before[0][f].name},
                       {"unit", before[0][f].unit},
                       {"start_median", at_start[at_start.size() / 2]},
                       {"median", at_end[at_end.size() / 2]},
                       {"largest", at_end.back()}});
  }
  return {{"lights", kind.name}, {"errors", figures}};
}

}  // namespace

void run_lights(const Settings& settings) {
  const std::size_t problems = settings.smoke ? 1 : 5;
  const unsigned iterations = settings.smoke ? 3 : 1000;
  const Scene scene = make_scene(settings.smoke);
  Json rows = Json::array();
  std::vector<Image> pictures;
  for (const Kind& kind : kinds()) {
    rows.push_back(run_kind(settings, kind, scene, problems, iterations, pictures));
    write_data(settings, "lights",
               {{"problems", problems}, {"iterations", iterations}, {"noise", k_noise}, {"rows", rows}});
  }
  write_image(settings.folder / "lights.png", vstack(pictures, 4));
  announce(settings, "lights.png");
}

}  // namespace dpr::experiments
