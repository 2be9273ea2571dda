// The gradient fuzzer: random scenes over all features, and of each every gradient against differences of the
// image; the mean gradient over a pixel's motion against what that changes; and wrong gradients, which must
// be found. The seeds come from the commit (DPR_COMMIT), so that each has scenes of its own, or from
// DPR_GRADIENT_SEED; the mean gradient's scenes are the same for all commits. DPR_GRADIENT_SECONDS says how
// long a run is, DPR_GRADIENT_SCENES how many scenes at most, DPR_GRADIENT_STAGE which of the wrong gradients is
// tried, or "all"; by default one, another one with every commit. What has failed once is a line of
// tests/data/gradient_seeds.txt.
#include <doctest/doctest.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

#include "device/profile.hpp"
#include "gradients/random_scene.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/data.hpp"
#include "support/reduced.hpp"

namespace gradient_fuzz_test {

using namespace dpr;
using namespace dpr::test::gradients;

namespace {

/// Processor time of the random scenes; DPR_GRADIENT_SECONDS in its place.
constexpr unsigned k_seconds = 30;

/// What the median of a kind's errors over scenes stays below, and four fifths of them, where there are so
/// many: a stage that is wrong may have a small part in each.
constexpr double k_median = 1e-2, k_upper = 8e-2;
constexpr std::size_t k_errors_of_median = 10;

/// What a gradient may be off by, relative to the larger of itself and the difference. Noise of the pixel
/// jumps by what samples between contours show, most with one of them a pixel and where contours crowd.
double tolerance_of(const Trial& trial) { return trial.has("noise of the pixel") ? 5e-2 : 3e-2; }

/// A derivative of the images that varies over a few pixels, from view to view and from channel to channel.
std::vector<Image> weights_of(const Trial& trial, unsigned seed) {
  Draw draw(seed);
  std::vector<Image> all;
  for (std::size_t view = 0; view < trial.views.size(); ++view) {
    glm::mat4 waves;
    for (int i = 0; i < 4; ++i) waves[i] = glm::vec4(draw.vector(-7, 7), draw.between(0, 6));
    Image image(trial.scene.width, trial.scene.height);
    for (int row = 0; row < image.height; ++row) {
      for (int column = 0; column < image.width; ++column) {
        const glm::vec2 at(static_cast<float>(column) / static_cast<float>(image.width),
                           static_cast<float>(row) / static_cast<float>(image.height));
        for (int i = 0; i < 4; ++i)
          image.at(column, row)[i] = std::sin(waves[i].x * at.x + waves[i].y * at.y + waves[i].w);
      }
    }
    all.push_back(std::move(image));
  }
  return all;
}

void render(Renderer& renderer, const Trial& trial) {
  renderer.set_scene(trial.scene);
  renderer.set_views(trial.views);
  renderer.forward();
}

double loss_of(Renderer& renderer, const Trial& trial, const std::vector<Image>& weights) {
  render(renderer, trial);
  double sum = 0;
  for (std::size_t v = 0; v < weights.size(); ++v) {
    const Image image = renderer.image(v);
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      sum += glm::dot(glm::dvec4(image.pixels[i]), glm::dvec4(weights[v].pixels[i]));
  }
  return sum;
}

/// Derivatives below it, by a step of a pixel, are not told from rounding.
double floor_of(const Trial& trial) {
  const std::size_t pixels =
      trial.views.size() * static_cast<std::size_t>(trial.scene.width * trial.scene.height);
  return 1e-3 * std::sqrt(static_cast<double>(pixels));
}

/// A direction with a part along the gradient, so that the derivative does not cancel out, and a random one,
/// so that what the gradient lacks counts.
std::vector<double> direction_of(const Parameters& of, Draw& draw) {
  double largest = 0;
  for (std::size_t i = 0; i < of.found.size(); ++i)
    largest = std::max(largest, std::abs(of.found[i] * of.units[i]));
  std::vector<double> way;
  for (std::size_t i = 0; i < of.found.size(); ++i) {
    const double along = largest > 0 ? of.found[i] * of.units[i] / largest : 0;
    way.push_back(of.units[i] *
                  std::clamp(along + 0.5 * static_cast<double>(draw.between(-1, 1)), -1.0, 1.0));
  }
  return way;
}

double along(const Parameters& of, const std::vector<double>& way) {
  return std::inner_product(way.begin(), way.end(), of.found.begin(), 0.0);
}

/// The central difference by a step.
double difference_along(Renderer& renderer, const Trial& trial, const Parameters& of,
                        const std::vector<double>& way, double step, const std::vector<Image>& weights) {
  double difference = 0;
  for (const double sign : {1.0, -1.0}) {
    Trial moved = trial;
    std::vector<double> by = way;
    for (double& b : by) b *= sign * step;
    of.move(moved, by);
    difference += sign * loss_of(renderer, moved, weights) / (2 * step);
  }
  return difference;
}

/// Size that an error is relative to.
double size_of(double difference, double derivative, const Trial& trial) {
  return std::max({std::abs(difference), std::abs(derivative), floor_of(trial)});
}

/// The error of one kind of gradients along a direction: the least against differences by two steps that
/// agree, infinite for numbers that are not finite. None where no steps agree: a jump lies within all of
/// them.
std::optional<double> local_error(Renderer& renderer, const Trial& trial, const Parameters& of,
                                  const std::vector<Image>& weights, Draw& draw) {
  const std::vector<double> way = direction_of(of, draw);
  const double derivative = along(of, way);
  double before = NAN;
  if (!std::isfinite(derivative)) return INFINITY;
  std::optional<double> least;
  for (double step = 0.25; step > 5e-4 && !(least.value_or(1) < 1e-2); step /= 4) {
    const double difference = difference_along(renderer, trial, of, way, step, weights);
    const double size = size_of(difference, derivative, trial);
    if (std::abs(difference - before) < 0.25 * tolerance_of(trial) * size)
      least = std::min(least.value_or(INFINITY), std::abs(difference - derivative) / size);
    before = difference;
  }
  return least;
}

SceneGradient gradient_of(Renderer& renderer, const Trial& trial, const std::vector<Image>& weights) {
  render(renderer, trial);
  return renderer.backward(weights);
}

struct Found {
  std::size_t kind;  // as parameters_of() counts them
  std::string name;
  std::optional<double> error;
  bool is_wrong(const Trial& trial) const { return error && !(*error < tolerance_of(trial)); }
};

/// Of every kind of gradients, or of one, at one place.
std::vector<Found> local_errors(Renderer& renderer, const Trial& trial, unsigned seed,
                                const std::string& only = "") {
  const std::vector<Image> weights = weights_of(trial, seed);
  SceneGradient gradient = gradient_of(renderer, trial, weights);
  Draw draw(seed + 1);
  std::vector<Found> errors;
  const std::vector<Parameters> all = parameters_of(trial, gradient);
  for (std::size_t kind = 0; kind < all.size(); ++kind) {
    if (only.empty() || only == all[kind].name)
      errors.push_back({kind, all[kind].name, local_error(renderer, trial, all[kind], weights, draw)});
  }
  return errors;
}

/// The least error by small steps of one kind of gradients, counted as parameters_of() has them.
double error_at(Renderer& renderer, const Trial& trial, unsigned seed, std::size_t kind) {
  const std::vector<Image> weights = weights_of(trial, seed);
  SceneGradient gradient = gradient_of(renderer, trial, weights);
  const Parameters of = parameters_of(trial, gradient)[kind];
  Draw draw(seed + 1);
  const std::vector<double> way = direction_of(of, draw);
  const double derivative = along(of, way);
  double least = INFINITY;
  for (const double step : {1.0 / 64, 1.0 / 256, 1.0 / 1024}) {
    const double difference = difference_along(renderer, trial, of, way, step, weights);
    least = std::min(least, std::abs(difference - derivative) / size_of(difference, derivative, trial));
  }
  return least;
}

/// NAN of none.
double quantile(std::vector<double> values, double part) {
  if (values.empty()) return NAN;
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

Trial shifted(const Trial& trial, Draw& draw) {
  Trial moved = trial;
  for (View& view : moved.views)
    view.transforms[0][3] += glm::vec4(draw.vector(-0.1F, 0.1F) * static_cast<float>(trial.pixel), 0.0F);
  return moved;
}

/// The same; where one is too large, the median over places around, of small steps alone: jumps lie at few of
/// them, a wrong gradient is wrong at most.
std::vector<Found> lasting_errors(Renderer& renderer, const Trial& trial, unsigned seed,
                                  const std::string& only = "") {
  std::vector<Found> errors = local_errors(renderer, trial, seed, only);
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (!errors[i].is_wrong(trial)) continue;
    Draw draw(seed + 2);
    std::vector<double> around;
    for (int place = 0; place < 9; ++place)
      around.push_back(error_at(renderer, shifted(trial, draw), seed, errors[i].kind));
    errors[i].error = quantile(around, 0.5);
  }
  return errors;
}

/// The mean gradient over a motion of the first mesh by a pixel, against the change of the image; relative to
/// the larger of that and the mean size of the gradient.
double mean_error(Renderer& renderer, const Trial& trial, unsigned seed) {
  constexpr int k_parts = 24;
  const std::vector<Image> weights = weights_of(trial, seed);
  Draw draw(seed + 3);
  const glm::vec3 way = glm::normalize(draw.vector(-1, 1)) * static_cast<float>(trial.pixel);
  const auto at = [&](double part) {
    Trial moved = trial;
    moved.views[0].transforms[0][3] += glm::vec4(static_cast<float>(part) * way, 0.0F);
    return moved;
  };
  double sum = 0, size = 0;
  for (int i = 0; i < k_parts; ++i) {
    const SceneGradient gradient = gradient_of(renderer, at((i + 0.5) / k_parts), weights);
    const double slope = glm::dot(gradient.views[0].transforms[0].translation, glm::dvec3(way)) / k_parts;
    sum += slope;
    size += std::abs(slope);
  }
  const double change = loss_of(renderer, at(1), weights) - loss_of(renderer, at(0), weights);
  return std::abs(change - sum) / size_of(change, size, trial);
}

/// Stays what it is where there is no such variable.
void read_number(const char* variable, unsigned& number, std::size_t digits = 9, int base = 10) {
  const char* value = std::getenv(variable);
  const std::string text = value == nullptr ? "" : std::string(value).substr(0, digits);
  std::from_chars(text.data(), text.data() + text.size(), number, base);
}

/// The first seed of a run; 1 where no commit is known.
unsigned first_seed() {
  unsigned seed = 1;
  read_number("DPR_COMMIT", seed, 7, 16);
  read_number("DPR_GRADIENT_SEED", seed);
  return seed;
}

std::vector<unsigned> kept_seeds() {
  std::ifstream file(test::data_folder() / "gradient_seeds.txt");
  std::vector<unsigned> seeds;
  for (std::string line; std::getline(file, line);) {
    unsigned seed = 0;
    if (std::from_chars(line.data(), line.data() + line.size(), seed).ec == std::errc())
      seeds.push_back(seed);
  }
  return seeds;
}

/// With noise of triangles and of the pixel apart.
using ErrorsByKind = std::map<std::string, std::vector<double>>;

/// Says what is off. A scene that is `kept` must not be; of random ones some are full of jumps, so that they
/// count by how many there are.
void check_locally(Renderer& renderer, unsigned seed, bool kept, ErrorsByKind& errors) {
  const Trial trial = random_trial(seed);
  for (const Found& found : lasting_errors(renderer, trial, seed)) {
    if (!found.error) continue;
    errors[found.name + (trial.has("noise of triangles") ? ", triangles" : ", pixel")].push_back(
        *found.error);
    if (!found.is_wrong(trial)) continue;
    MESSAGE("DPR_GRADIENT_SEED=" << seed << " DPR_GRADIENT_SCENES=1: " << found.name << " off by "
                                 << 100 * *found.error << "% (" << trial.description() << ")");
    CHECK_FALSE(kept);
  }
}

double seconds_used() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Of a pixel's colour, where a face's plane passes the camera within the frame, above the furthest corner.
float largest_change_at_horizon(bool perspective_correct) {
  Mesh mesh;
  mesh.positions = {{-0.8F, -0.6F, -2}, {1.8F, -0.6F, -3}, {0.9F, 4.5F, -9}};
  mesh.faces = {{0, 1, 2}};
  mesh.vertex_colors = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  Scene scene;
  scene.width = scene.height = test::reduced(33, 9);
  scene.camera.fov_y_degrees = 90.0F;
  scene.perspective_correct = perspective_correct;
  scene.smoothing = smoothing_preset("joint_gaussian");
  scene.smoothing.distance = DistanceMetric::euclidean;
  scene.smoothing.sigma = 0.3F;
  scene.meshes.push_back({mesh});
  Renderer renderer(open_device());
  std::optional<Image> before;
  float largest = 0;
  for (int step = 0; step < test::reduced(64, 16); ++step) {
    scene.camera.view = glm::rotate(glm::mat4(1.0F), 0.002F * static_cast<float>(step), glm::vec3(1, 0, 0));
    renderer.set_scene(scene);
    renderer.forward();
    const Image image = renderer.image();
    for (std::size_t i = 0; before && i < image.pixels.size(); ++i)
      largest = std::max(largest, glm::length(image.pixels[i] - before->pixels[i]));
    before = image;
  }
  return largest;
}

/// A device whose gradients are a tenth too large behind one kernel's launch.
class Planted : public Profile {
 public:
  using Scale = std::function<void(Renderer::Impl&)>;
  /// Of the first launch of the last of `kernels` after those before it.
  Planted(const Device& device, std::vector<std::string> kernels, Scale scale)
      : Profile(device), kernels_(std::move(kernels)), scale_(std::move(scale)) {}
  void record(const std::string&, const std::string& kernel, const cl::Event&) override {
    if (kernel != kernels_[passed_]) return;
    passed_ = (passed_ + 1) % kernels_.size();
    if (passed_ != 0 || renderer == nullptr) return;
    scale_(impl_of(*renderer));
    has_scaled = true;
  }
  Renderer* renderer = nullptr;
  bool has_scaled = false;

 private:
  std::vector<std::string> kernels_;
  std::size_t passed_ = 0;
  Scale scale_;
};

/// Elements from `first` on, or all.
template <class Element>
void scale_by_tenth(const Buffer<Element>& buffer, std::size_t first = 0,
                    std::optional<std::size_t> count = std::nullopt) {
  constexpr float k_wrong = 1.1F;
  if (buffer.device() == nullptr || buffer.size() == 0) return;
  std::vector<Element> values(count.value_or(buffer.size()));
  buffer.download(values, first);
  const std::span<float> numbers(reinterpret_cast<float*>(values.data()),
                                 values.size() * sizeof(Element) / sizeof(float));
  for (float& number : numbers) number *= k_wrong;
  buffer.device()->write(buffer.cl_buffer(), first * sizeof(Element), std::as_bytes(std::span(values)));
}

void scale_plane(const Renderer::Impl& r, std::size_t plane) {
  scale_by_tenth(r.rasterize.grads, plane * r.frame.grad_fragments, r.rasterize.fragments);
}

struct Plant {
  const char* stage;
  std::vector<std::string> kernels;  // behind whose launch: see Planted
  const char* shown_by;              // the parameters whose gradients are wrong then
  Planted::Scale scale;
  std::vector<const char*> needs;  // features of the scenes
};

std::vector<Plant> plants() {
  using Impl = Renderer::Impl;
  const std::vector<const char*> triangles{"noise of triangles", "affine"}, pixel{"noise of the pixel"};
  return {
      {"blur, by its scale",
       {"blur_rows_scale", "reduce_final"},
       "sigma",
       [](Impl& r) { scale_by_tenth(r.pixel_noise->grad_scale()); },
       pixel},
      {"antialias",
       {"antialias_cross_backward"},
       "mesh translation",
       [](Impl& r) { scale_by_tenth(r.pixel_noise->antialias.grad_ends); },
       pixel},
      {"aggregate, colours",
       {"aggregate_joint_backward"},
       "colours",
       [](Impl& r) {
         scale_plane(r, DPR_PLANE_COLOR);
         scale_plane(r, DPR_PLANE_COLOR + 1);
       },
       {"joint"}},
      {"aggregate, occupancy",
       {"aggregate_joint_backward"},
       "positions",
       [](Impl& r) { scale_plane(r, DPR_PLANE_LOG_OCCUPANCY); },
       {"joint", "noise of triangles", "affine"}},
      {"aggregate, depths",
       {"aggregate_backward"},
       "mesh translation",
       [](Impl& r) { scale_plane(r, DPR_PLANE_DEPTH); },
       {"barrier", "noise of triangles", "affine", "two meshes"}},
      {"aggregate, channels",
       {"aggregate_backward"},
       "gamma",
       [](Impl& r) { scale_by_tenth(r.aggregate.channels); },
       {"barrier"}},
      {"occupancy",
       {"occupancy_backward"},
       "positions",
       [](Impl& r) { scale_plane(r, DPR_PLANE_DISTANCE); },
       triangles},
      {"occupancy, by sigma",
       {"occupancy_backward"},
       "sigma",
       [](Impl& r) { scale_by_tenth(r.occupancy.grad_sigma); },
       triangles},
      {"shade",
       {"shade_backward"},
       "colours",
       [](Impl& r) { scale_by_tenth(r.shade.grad_pairs); },
       {"vertex colours"}},
      {"surface",
       {"surface_backward"},
       "texture coordinates",
       [](Impl& r) { scale_by_tenth(r.shade.grad_pairs, DPR_PAIR_TEXCOORDS * r.bin.pairs, 9 * r.bin.pairs); },
       {"texture"}},
      {"texels", {"texels_sum"}, "texels", [](Impl& r) { scale_by_tenth(r.texels->grad); }, {"texture"}},
      {"shade, lights",
       {"shade_lit_backward_lights"},
       "lights",
       [](Impl& r) { scale_by_tenth(r.shade.light_channels); },
       {"lit phong"}},
      {"rasterize",
       {"rasterize_backward"},
       "positions",
       [](Impl& r) { scale_by_tenth(r.rasterize.grad_corners); },
       triangles},
      {"clip",
       {"clip_backward"},
       "positions",
       [](Impl& r) { scale_by_tenth(r.clip.grad_corners); },
       {"near plane", "noise of triangles", "affine"}},
      {"gather",
       {"gather_corners"},
       "positions",
       [](Impl& r) { scale_by_tenth(r.grad_vertices); },
       triangles},
      {"transform",
       {"transform_backward"},
       "mesh translation",
       [](Impl& r) { scale_by_tenth(r.transform.partial_sums); },
       {"pinhole"}},
      {"transform, lens",
       {"transform_backward_lens"},
       "distortion",
       [](Impl& r) { scale_by_tenth(r.transform.partial_sums); },
       {"lens"}},
      {"transform, positions",
       {"transform_backward_positions"},
       "positions",
       [](Impl& r) { scale_by_tenth(r.transform.grad_positions); },
       {}},
  };
}

/// The errors of a kind of gradients over scenes.
std::vector<Found> errors_of(Renderer& renderer, const Plant& plant, const std::vector<unsigned>& seeds,
                             bool lasting) {
  std::vector<Found> all;
  for (const unsigned seed : seeds) {
    const Trial trial = random_trial(seed);
    for (Found& found : lasting ? lasting_errors(renderer, trial, seed, plant.shown_by)
                                : local_errors(renderer, trial, seed, plant.shown_by))
      all.push_back(std::move(found));
  }
  return all;
}

double median_of(const std::vector<Found>& found) {
  std::vector<double> errors;
  for (const Found& f : found) {
    if (f.error) errors.push_back(*f.error);
  }
  return quantile(errors, 0.5);
}

/// The first seeds of scenes that have all of some features.
std::vector<unsigned> seeds_of_scenes(const std::vector<const char*>& needs, std::size_t count) {
  std::vector<unsigned> seeds;
  for (unsigned seed = 1; seeds.size() < count; ++seed) {
    const Trial trial = random_trial(seed);
    if (std::ranges::all_of(needs, [&](const char* feature) { return trial.has(feature); }))
      seeds.push_back(seed);
  }
  return seeds;
}

}  // namespace

TEST_SUITE("gradient-fuzz") {
  TEST_CASE("random scenes: every gradient against differences by several steps") {
    if (test::is_reduced()) return;
    Renderer renderer(open_device());
    ErrorsByKind errors;
    for (const unsigned seed : kept_seeds()) check_locally(renderer, seed, true, errors);
    const unsigned first = first_seed();
    unsigned scenes = std::numeric_limits<unsigned>::max(), seconds = k_seconds, checked = 0;
    read_number("DPR_GRADIENT_SCENES", scenes);
    read_number("DPR_GRADIENT_SECONDS", seconds);
    const double last = seconds_used() + seconds;
    while (checked < scenes && seconds_used() < last)
      check_locally(renderer, first + checked++, scenes == 1, errors);
    MESSAGE("DPR_GRADIENT_SEED=" << first << " DPR_GRADIENT_SCENES=" << checked);
    for (const auto& [kind, found] : errors) {
      MESSAGE(kind << ": median " << quantile(found, 0.5) << ", largest " << quantile(found, 1) << " of "
                   << found.size());
      if (found.size() < k_errors_of_median) continue;
      CHECK_MESSAGE(quantile(found, 0.5) < k_median, kind);
      CHECK_MESSAGE(quantile(found, 0.8) < k_upper, kind);
    }
  }

  TEST_CASE("random scenes: the mean gradient over a pixel's motion against what that changes") {
    if (test::is_reduced()) return;
    Renderer renderer(open_device());
    std::map<std::string, std::vector<double>> errors;
    unsigned first = 1;  // the same scenes for every commit: those of a group are few
    read_number("DPR_GRADIENT_SEED", first);
    for (unsigned seed = first; seed < first + 14; ++seed) {
      const Trial trial = random_trial(seed);
      const char* group = trial.has("noise of triangles") ? "triangles"
                          : trial.has("supersampling 1")  ? "pixel, one sample"
                                                          : "pixel, more samples";
      errors[group].push_back(mean_error(renderer, trial, seed));
    }
    const std::map<std::string, double> tolerances{
        {"triangles", 8e-2}, {"pixel, one sample", 0.2}, {"pixel, more samples", 0.1}};
    for (const auto& [group, found] : errors) {
      MESSAGE("DPR_GRADIENT_SEED=" << first << ", " << group << ": median " << quantile(found, 0.5) << " of "
                                   << found.size());
      if (found.size() >= 5) CHECK_MESSAGE(quantile(found, 0.5) < tolerances.at(group), group);
    }
  }

  TEST_CASE("the horizon of a face's plane: colours jump where they are corrected for perspective") {
    const float corrected = largest_change_at_horizon(true), affine = largest_change_at_horizon(false);
    MESSAGE("largest change of a pixel by a step: " << corrected << ", without correction " << affine);
    CHECK(corrected < 0.3F);
    CHECK(affine < 0.02F);
  }

  TEST_CASE("a gradient that is a tenth too large in one stage is found") {
    if (test::is_reduced()) return;
    constexpr std::size_t k_scenes_of_plant = 5;
    const std::vector<Plant> all = plants();
    const char* variable = std::getenv("DPR_GRADIENT_STAGE");
    const std::string only = variable != nullptr ? variable : all[first_seed() % all.size()].stage;
    const Device device = open_device();
    for (const Plant& plant : all) {
      if (only != "all" && only != plant.stage) continue;
      CAPTURE(std::string(plant.stage));
      const std::vector<unsigned> seeds = seeds_of_scenes(plant.needs, k_scenes_of_plant);
      Renderer renderer(device);
      const double right = median_of(errors_of(renderer, plant, seeds, true));
      Planted planted(device, plant.kernels, plant.scale);
      planted.renderer = &renderer;
      const double wrong = median_of(errors_of(renderer, plant, seeds, false));
      CHECK(planted.has_scaled);
      CAPTURE(right);
      CAPTURE(wrong);
      CHECK(wrong > 2 * right);
      CHECK(wrong > 5e-3);
    }
  }
}

}  // namespace gradient_fuzz_test
