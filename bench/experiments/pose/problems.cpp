// Pose problems from seeds.
#include "experiments/pose/problems.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>

#include "base/uniform_number.hpp"
#include "cli/json.hpp"
#include "dpr/error.hpp"

namespace dpr::bench {
namespace {

/// Random numbers of a problem: a stream of its own for each.
class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream) {
    std::seed_seq sequence{seed, seed >> 32, stream, stream >> 32};
    generator_.seed(sequence);
  }

  /// In [low, high).
  double uniform(double low = 0, double high = 1) { return low + (high - low) * uniform_number(generator_); }

  glm::dvec3 direction() {
    const double z = uniform(-1, 1), angle = uniform(0, glm::two_pi<double>()), radius = std::sqrt(1 - z * z);
    return {radius * std::cos(angle), radius * std::sin(angle), z};
  }

  glm::vec3 color() { return {uniform(), uniform(), uniform()}; }

  /// Shoemake 1992, Uniform Random Rotations.
  glm::dmat3 rotation() {
    const double s = uniform(), a = uniform(0, glm::two_pi<double>()), b = uniform(0, glm::two_pi<double>());
    const double inner = std::sqrt(s), outer = std::sqrt(1 - s);
    return glm::mat3_cast(
        glm::dquat(outer * std::cos(b), inner * std::sin(a), inner * std::cos(a), outer * std::sin(b)));
  }

 private:
  std::mt19937_64 generator_;
};

/// Discs of random colours all over the image.
void paint_clutter(Image& image, Random& random) {
  constexpr int k_discs = 150;
  constexpr double k_largest = 0.12;  // radius, of the width
  for (int i = 0; i < k_discs; ++i) {
    const double x = random.uniform(0, image.width), y = random.uniform(0, image.height);
    const double radius = random.uniform(0.02, k_largest) * image.width;
    const glm::vec4 color(random.color(), 0);
    for (int row = 0; row < image.height; ++row) {
      for (int column = 0; column < image.width; ++column) {
        if (std::hypot(column + 0.5 - x, row + 0.5 - y) < radius) image.at(column, row) = color;
      }
    }
  }
}

/// Covers the part of the silhouette that lies furthest in a random direction with random stripes.
void occlude(Image& image, const Image& rigid, double part, Random& random) {
  const double angle = random.uniform(0, glm::two_pi<double>());
  const auto along = [&](int column, int row) { return column * std::cos(angle) + row * std::sin(angle); };
  std::vector<double> heights;
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      if (rigid.at(column, row).a > 0) heights.push_back(along(column, row));
    }
  }
  if (heights.empty()) return;
  std::ranges::sort(heights, std::greater());
  const double border = heights[static_cast<std::size_t>(part * static_cast<double>(heights.size()))];
  const glm::vec4 colors[2] = {glm::vec4(random.color(), 0), glm::vec4(random.color(), 0)};
  constexpr int k_stripe = 6;  // pixels
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      if (along(column, row) > border) image.at(column, row) = colors[(column + row) / k_stripe % 2];
    }
  }
}

nlohmann::ordered_json to_json(const Pose& pose) {
  return {{"rotation_matrix", cli::rows_to_json(pose.rotation)},
          {"translation", cli::to_json(pose.translation)}};
}

Pose pose_from_json(const nlohmann::json& json) {
  Pose pose;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      pose.rotation[column][row] = json.at("rotation_matrix").at(row).at(column).get<double>();
    }
    pose.translation[row] = json.at("translation").at(row).get<double>();
  }
  return pose;
}

}  // namespace

std::vector<PoseProblem> make_pose_problems(const PoseProblemSet& set, std::size_t count) {
  std::vector<PoseProblem> problems;
  for (std::size_t i = 0; i < count; ++i) {
    Random random(set.seed, i);
    PoseProblem problem;
    problem.seed = set.seed ^ (i << 32);
    problem.truth.rotation = random.rotation();
    const glm::dvec3 axis = random.direction(), aside = random.direction();
    problem.initial.rotation =
        set.initial_degrees > 0
            ? rotation_from_vector(glm::radians(set.initial_degrees) * axis) * problem.truth.rotation
            : random.rotation();
    problem.initial.translation = set.translation_error * k_pose_camera_distance * aside;
    problems.push_back(problem);
  }
  return problems;
}

Scene pose_scene(const std::string& object) {
  Scene scene;
  scene.camera = orbit_camera(static_cast<float>(k_pose_camera_distance), 30, 120);
  scene.meshes.push_back({make_object(object)});
  scene.lights = Lights{.point = {{.position = {0, 2, -2}}}};
  return scene;
}

RigidCamera::RigidCamera(const Device& device, Scene scene)
    : renderer_(device), view_{scene.camera, {glm::mat4(1.0F)}} {
  scene.smoothing = rigid_smoothing();
  renderer_.set_scene(scene);
}

Image RigidCamera::render(const Pose& pose) {
  glm::dmat4 transform(pose.rotation);
  transform[3] = glm::dvec4(pose.translation, 1);
  view_.transforms.front() = glm::mat4(transform);
  renderer_.set_views({&view_, 1});
  renderer_.forward();
  return renderer_.image();
}

Image make_target(RigidCamera& camera, const PoseProblemSet& set, const PoseProblem& problem) {
  const Image rigid = camera.render(problem.truth);
  Image target = rigid;
  Random random(problem.seed, 1);
  if (set.clutter) {
    paint_clutter(target, random);
    for (std::size_t i = 0; i < rigid.pixels.size(); ++i) {
      if (rigid.pixels[i].a > 0) target.pixels[i] = rigid.pixels[i];
    }
  }
  if (set.occluded > 0) occlude(target, rigid, set.occluded, random);
  return target;
}

double differing_pixels(const Image& a, const Image& b) {
  constexpr float k_tolerance = 2.0F / 255;
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const glm::vec3 difference = glm::abs(glm::vec3(a.pixels[i]) - glm::vec3(b.pixels[i]));
    if (std::max({difference.x, difference.y, difference.z}) > k_tolerance) ++count;
  }
  return static_cast<double>(count) / static_cast<double>(a.pixels.size());
}

nlohmann::ordered_json to_json(const PoseProblemSet& set) {
  return {{"object", set.object},
          {"initial_degrees", set.initial_degrees},
          {"translation_error", set.translation_error},
          {"occluded", set.occluded},
          {"clutter", set.clutter},
          {"seed", set.seed}};
}

void write_pose_problems(const std::filesystem::path& file, const PoseProblemSet& set,
                         const std::vector<PoseProblem>& problems) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const PoseProblem& problem : problems) {
    list.push_back(
        {{"seed", problem.seed}, {"truth", to_json(problem.truth)}, {"initial", to_json(problem.initial)}});
  }
  cli::write_json(file, {{"set", to_json(set)}, {"problems", list}});
}

std::vector<PoseProblem> read_pose_problems(const std::filesystem::path& file, PoseProblemSet& set) {
  std::ifstream stream(file);
  if (!stream) throw IoError(file, "cannot be read");
  try {
    const nlohmann::json json = nlohmann::json::parse(stream);
    const nlohmann::json& s = json.at("set");
    set = {s.at("object"),   s.at("initial_degrees"), s.at("translation_error"),
           s.at("occluded"), s.at("clutter"),         s.at("seed")};
    std::vector<PoseProblem> problems;
    for (const nlohmann::json& entry : json.at("problems")) {
      problems.push_back(
          {entry.at("seed"), pose_from_json(entry.at("truth")), pose_from_json(entry.at("initial"))});
    }
    return problems;
  } catch (const nlohmann::json::exception& error) {
    throw IoError(file, std::string("no problem file: ") + error.what());
  }
}

}  // namespace dpr::bench
