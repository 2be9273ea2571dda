#include "solve/pose_places.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <variant>

#include "scene/lens.hpp"
#include "solve/extent.hpp"
#include "solve/resample.hpp"
#include "solve/rotation_grid.hpp"

namespace dpr {
namespace {

// The number of places of a grid over the picture that are tried with many rotations, and hypotheses that are kept of
// each, and of the start's place where another is more likely.
constexpr std::size_t k_best_places = 8, k_of_place = 12, k_of_start = 48;

const LeastSquares& method_of(const PoseOptions& options) { return std::get<LeastSquares>(options.method); }

/// The body's points that are furthest in directions all around.
std::vector<glm::dvec3> outermost(const Scene& scene, const PoseBody& body) {
  constexpr std::size_t k_directions = 200;
  std::vector<glm::dvec3> points;
  for (std::size_t i = 0; i < k_directions; ++i) {  // on a Fibonacci spiral
    const double z = 1 - (2 * static_cast<double>(i) + 1) / static_cast<double>(k_directions);
    const double angle = 2 * std::numbers::pi / std::numbers::phi * static_cast<double>(i),
                 r = std::sqrt(1 - z * z);
    const glm::dvec3 direction(r * std::cos(angle), r * std::sin(angle), z);
    std::vector<glm::dvec3> of_parts;
    for (const BodyPart& part : body.parts()) {
      const glm::vec3 in_part(glm::transpose(part.linear) * direction);
      const glm::vec3 furthest = *std::ranges::max_element(
          mesh_of(scene, part.mesh).positions, {}, [&](const glm::vec3& p) { return glm::dot(p, in_part); });
      of_parts.push_back(part.linear * glm::dvec3(furthest) + part.offset);
    }
    points.push_back(
        *std::ranges::max_element(of_parts, {}, [&](const glm::dvec3& p) { return glm::dot(p, direction); }));
  }
  return points;
}

/// Tangents from the axis, x right and y up, at a place of the image in pixels.
glm::dvec2 tangents_at(const Scene& scene, const glm::dvec2& pixel) {
  const Projection p = projection(scene.camera, scene.width, scene.height);
  const glm::dvec2 middle(0.5 * scene.width, 0.5 * scene.height);
  const double ndc_per_pixel = 2.0 / std::min(scene.width, scene.height);
  const glm::dvec2 ndc = ndc_per_pixel * glm::dvec2(pixel.x - middle.x, middle.y - pixel.y);
  return undistorted((ndc - glm::dvec2(p.offset)) / glm::dvec2(p.scale), scene.camera.distortion);
}

/// Translations about which an object of that radius is seen all over the picture, at a distance.
void add_places(const Scene& scene, double distance, double radius, std::vector<glm::dvec3>& places) {
  constexpr double k_spacing = 0.75;    // of the radius
  constexpr double k_most_places = 24;  // on a side
  const glm::dvec2 low = tangents_at(scene, {0, scene.height}), high = tangents_at(scene, {scene.width, 0});
  const glm::dvec2 count = glm::clamp(glm::ceil((high - low) / (k_spacing * radius / distance)),
                                      glm::dvec2(1), glm::dvec2(k_most_places));
  const glm::dmat4 to_world = glm::inverse(glm::dmat4(scene.camera.view));
  for (int row = 0; row < static_cast<int>(count.y); ++row) {
    for (int column = 0; column < static_cast<int>(count.x); ++column) {
      const glm::dvec2 tangents = low + (high - low) * (glm::dvec2(column, row) + 0.5) / count;
      places.emplace_back(to_world * glm::dvec4(distance * glm::dvec3(tangents, -1), 1));
    }
  }
}

/// Of what a picture shows before the scene's background, where the object is all that the scene has.
std::optional<PoseBox> extent_of_target(const PoseProblem& problem) {
  const Scene& scene = problem.scene;
  const bool is_all = problem.options.meshes.empty() || problem.options.meshes.size() == scene.meshes.size();
  const bool is_unknown = method_of(problem.options).unknown_background;
  if (!is_all || is_unknown || problem.target.pixels.empty() || scene.camera.orthographic_height) return {};
  return extent_before(problem.target, scene.background);
}

/// Of depths, where nothing else is compared. Throws where they are not the object's alone: it would fit anywhere.
std::optional<PoseBox> extent_of_depths(const PoseProblem& problem, const Pose& initial) {
  const LeastSquares& method = method_of(problem.options);
  Image depths = method.depth.image;
  if (depths.pixels.empty() || !problem.target.pixels.empty() || !method.silhouette.image.pixels.empty() ||
      problem.scene.camera.orthographic_height)
    return {};
  const PoseSpace space(problem.scene, initial, problem.options);
  if (!space.body().is_alone()) return {};
  if (!space.may_cover(depths)) {
    throw InvalidArgument("depth (pose)", "depths of more than the object",
                          "those of the object alone, or a silhouette or colours beside them");
  }
  for (glm::vec4& p : depths.pixels) p.x = has_depth(p) ? 1 : 0;
  return extent(depths);
}

/// Boxes of an object of which the picture shows what is in the box, further on beyond the sides that it touches.
std::vector<PoseBox> grown_beyond(const PoseBox& box, const Scene& scene) {
  const glm::vec2 picture(scene.width, scene.height), low(box.x, box.y), size(box.width, box.height),
      high = low + size;
  std::vector<PoseBox> grown;
  for (const float part : {0.4F, 1.0F}) {
    glm::vec2 from = low, to = high;
    for (int axis = 0; axis < 2; ++axis) {
      if (low[axis] <= 0) from[axis] -= part * size[axis];
      if (high[axis] >= picture[axis]) to[axis] += part * size[axis];
    }
    if (from != low || to != high) grown.push_back({from.x, from.y, to.x - from.x, to.y - from.y});
  }
  return grown;
}

}  // namespace

BoxPlaces::BoxPlaces(const Scene& scene, const PoseBody& body, const PoseBox& box)
    : points_(outermost(scene, body)),
      axes_(scene.camera.view),
      from_camera_(glm::inverse(axes_)),
      eye_(scene.camera.view[3]),
      nearest_(static_cast<double>(scene.camera.znear)) {
  const glm::dvec2 begin(box.x, box.y), side(box.width, box.height);
  const glm::dvec2 a = tangents_at(scene, begin), b = tangents_at(scene, begin + side);
  centre_ = 0.5 * (a + b);
  size_ = glm::abs(b - a);
  radius_ = 0;
  for (const glm::dvec3& p : points_) radius_ = std::max(radius_, glm::length(axes_ * p));
}

glm::dvec3 BoxPlaces::translation(const glm::dmat3& rotation, double distance) const {
  constexpr int k_steps = 8;
  std::vector<glm::dvec3> points;
  for (const glm::dvec3& p : points_) points.push_back(axes_ * (rotation * p));
  const double front = std::ranges::max_element(points, {}, &glm::dvec3::z)->z;
  const double least = front + nearest_;
  const auto at = [&](const glm::dvec2& tangents, double depth) {
    return glm::dvec3(depth * tangents, -depth);
  };
  double depth = std::max(least, 2 * radius_ / glm::length(size_));
  glm::dvec3 place = at(centre_, depth);
  for (int i = 0; i < k_steps; ++i) {
    glm::dvec2 low(std::numeric_limits<double>::infinity()), high = -low;
    for (const glm::dvec3& p : points) {
      const glm::dvec2 seen = glm::dvec2(place + p) / -(place.z + p.z);
      low = glm::min(low, seen);
      high = glm::max(high, seen);
    }
    const double factor = glm::length(high - low) / glm::length(size_);
    const glm::dvec2 tangents = glm::dvec2(place) / depth + centre_ - 0.5 * (low + high);
    depth = std::max(least, depth * factor);
    place = at(tangents, depth);
  }
  return from_camera_ * (std::max(least / depth, distance) * place - eye_);
}

std::optional<PoseBox> box_of_search(const PoseOptions& options, bool anywhere) {
  const LeastSquares& method = method_of(options);
  if (method.box) return method.box;
  if (!anywhere || !options.solve_translation) return {};
  if (!method.silhouette.image.pixels.empty()) return extent(method.silhouette.image);
  const Image& mask = method.mask;
  const std::optional<PoseBox> box = extent(mask);
  const bool is_all =
      box && box->width * box->height >= static_cast<float>(mask.width) * static_cast<float>(mask.height);
  return is_all ? std::nullopt : box;
}

PosePlaces::PosePlaces(const PoseProblem& problem, const Pose& initial, bool anywhere)
    : scene_(problem.scene), start_(initial), about_(initial) {
  constexpr std::size_t k_enough = 15;  // rotations that tell the distance
  const PoseOptions& options = problem.options;
  const LeastSquares& method = method_of(options);
  const PoseBody body(scene_, options.meshes);
  for (const glm::dvec3& p : body.points(scene_)) radius_ = std::max(radius_, glm::length(p));
  const std::optional<PoseBox> of_depths = anywhere ? extent_of_depths(problem, initial) : std::nullopt;
  if (!options.solve_translation) return;
  std::optional<PoseBox> box = box_of_search(options, anywhere);
  const bool is_silhouette = of_depths || !method.silhouette.image.pixels.empty();
  is_mask_ = box && !method.box && !is_silhouette;
  if (!box) box = of_depths;
  if (!box && anywhere) {
    box = extent_of_target(problem);
    if (box) {
      for (const PoseBox& grown : grown_beyond(*box, scene_)) beyond_.emplace_back(scene_, body, grown);
    }
  }
  scans_ = anywhere && !method.box && !is_silhouette;
  tries_start_ = anywhere && !method.box && box;
  if (!box) return;
  box_.emplace(scene_, body, *box);
  std::vector<Hypothesis> guesses = grid(k_enough);
  const auto middle = guesses.begin() + std::ssize(guesses) / 2;
  std::ranges::nth_element(guesses, middle, {}, [&](const Hypothesis& h) {
    return view_depth(scene_.camera, h.pose.translation);
  });
  about_.translation = middle->pose.translation;
}

std::optional<PoseBox> whole_extent(const PoseProblem& problem) {
  if (method_of(problem.options).robust || !problem.options.solve_translation) return {};
  const std::optional<PoseBox> box = extent_of_target(problem);
  return box && grown_beyond(*box, problem.scene).empty() ? box : std::nullopt;
}

std::vector<LevelShape> PosePlaces::shapes(std::vector<LevelShape> shapes, const PoseSpace& space) const {
  constexpr double k_least_radius = 3;  // pixels
  while (scans_ && shapes.size() > 2 && space.radius_ndc() * shapes.front().short_side < 2 * k_least_radius)
    shapes.erase(shapes.begin());
  return shapes;
}

std::vector<Hypothesis> PosePlaces::grid(std::size_t rotations) const {
  std::vector<Hypothesis> result;
  for (const glm::dmat3& rotation : rotation_grid(rotations))
    result.push_back({{rotation, box_ ? box_->translation(rotation) : start_.translation}});
  return result;
}

/// The places of a grid over the picture, at several distances, of which some rotation leaves least.
std::vector<glm::dvec3> PosePlaces::best_of_picture(PoseLevel& level) const {
  constexpr std::size_t k_hypotheses = 12000, k_least_rotations = 8, k_most_rotations = 72;
  const double start = view_depth(scene_.camera, start_.translation);
  const double distance = std::max(start, static_cast<double>(scene_.camera.znear) + radius_);
  std::vector<glm::dvec3> places;
  for (const double factor : {1.0, std::numbers::sqrt2 / 2, std::numbers::sqrt2, 0.5, 2.0}) {
    const double depth = factor * distance;
    if (depth < radius_ + static_cast<double>(scene_.camera.znear) && factor != 1) continue;
    add_places(scene_, depth, radius_, places);
  }
  const std::vector<glm::dmat3> rotations =
      rotation_grid(std::clamp(k_hypotheses / places.size(), k_least_rotations, k_most_rotations));
  std::vector<Hypothesis> tried;
  for (const glm::dvec3& place : places) {
    for (const glm::dmat3& rotation : rotations) tried.push_back({{rotation, place}});
  }
  const std::vector<double> losses = level.losses(tried);
  std::vector<std::pair<double, std::size_t>> least;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto begin = losses.begin() + static_cast<std::ptrdiff_t>(i * rotations.size());
    least.emplace_back(*std::min_element(begin, begin + std::ssize(rotations)), i);
  }
  std::ranges::sort(least);
  std::vector<glm::dvec3> best;
  for (std::size_t i = 0; i < std::min(k_best_places, least.size()); ++i)
    best.push_back(places[least[i].second]);
  return best;
}

std::vector<PlaceGroup> PosePlaces::others(PoseLevel& level, std::size_t rotations) const {
  constexpr double k_further = 1.4;  // where a mask is larger than the object
  std::vector<PlaceGroup> groups;
  const std::vector<glm::dmat3> all = rotation_grid(rotations), some = rotation_grid(rotations / 2);
  const auto add = [&](std::span<const glm::dmat3> turns, std::size_t keep, auto place) {
    PlaceGroup& group = groups.emplace_back(PlaceGroup{{}, keep});
    for (const glm::dmat3& rotation : turns) group.hypotheses.push_back({{rotation, place(rotation)}});
  };
  if (tries_start_) add(all, k_of_start, [&](const glm::dmat3&) { return start_.translation; });
  if (is_mask_) add(all, k_of_start, [&](const glm::dmat3& r) { return box_->translation(r, k_further); });
  for (const BoxPlaces& box : beyond_)
    add(all, k_of_start, [&](const glm::dmat3& r) { return box.translation(r); });
  if (!scans_) return groups;
  for (const glm::dvec3& best : best_of_picture(level))
    add(some, k_of_place, [&](const glm::dmat3&) { return best; });
  return groups;
}

}  // namespace dpr
