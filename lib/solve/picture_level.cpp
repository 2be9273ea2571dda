// Images of hypotheses against the target, and the derivatives of their difference.
#include "solve/picture_level.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "dpr/subdivision.hpp"
#include "renderer/frame.hpp"
#include "solve/level_scene.hpp"
#include "solve/pose_pyramid.hpp"
#include "solve/resample.hpp"
#include "solve/target_noise.hpp"
#include "solve/unknown_background.hpp"

namespace dpr {
namespace {

// A batch as large as keeps a device busy; the bounds keep its memory small.
constexpr std::size_t k_most_pixels = std::size_t{1} << 20;
constexpr std::size_t k_most_faces = std::size_t{1} << 20;

constexpr double k_color_channels = 3;
constexpr const char* k_level = "PictureLevel";     // in errors
constexpr std::size_t k_coverage = 0, k_depth = 1;  // kinds of MeasuredWeights

/// Positions and faces alone, black.
Mesh shape_of(const Mesh& mesh) {
  Mesh shape;
  shape.positions = mesh.positions;
  shape.faces = mesh.faces;
  shape.vertex_colors.resize(shape.positions.size());
  return shape;
}

/// The meshes without colours and light, their vertices with room for depths in place of colours.
Scene shapes_alone(Scene scene) {
  for (Instance& instance : scene.meshes) instance.mesh = shape_of(instance.mesh);
  scene.lights.reset();
  scene.background = glm::vec3(0);
  return scene;
}

/// Gives each mesh normals in the body's axes. Directions of light turn with the body: meshes that stand still have
/// normals only where the body's rotation is nearly known, and else are seen in the mean light.
void give_normals(Scene& scene, const PoseBody& body, CornerNormals normals,
                  const std::optional<glm::dmat3>& rotation) {
  for (std::size_t i = scene.meshes.size(); i-- > 0;) {  // instances before their meshes
    Instance& instance = scene.meshes[i];
    const auto part = std::ranges::find(body.parts(), i, &BodyPart::mesh);
    const bool moves = part != body.parts().end();
    if (instance.instance_of) instance = {mesh_of(scene, i), instance.transform};
    if (moves || rotation) {
      give_normals(instance.mesh,
                   moves ? part->linear : glm::transpose(*rotation) * glm::dmat3(instance.transform),
                   normals);
    } else {
      instance.mesh.normals.clear();
      instance.mesh.face_normals.clear();
    }
  }
}

/// That of one of sixteen is less: the very best may fit by luck. Empty: 0.
float best_of(std::vector<float> numbers) {
  constexpr std::ptrdiff_t k_best = 16;
  if (numbers.empty()) return 0;
  const auto best = numbers.begin() + std::ssize(numbers) / k_best;
  std::ranges::nth_element(numbers, best);
  return *best;
}

std::size_t pixels_of(const Scene& scene) {
  return static_cast<std::size_t>(scene.width) * static_cast<std::size_t>(scene.height);
}

glm::vec3 rgb(const cl_float4& color) { return {color.s[0], color.s[1], color.s[2]}; }

}  // namespace

PictureLevel::PictureLevel(const Device& device, const Scene& scene, const Image& target,
                           const LeastSquares& options, const PoseSpace& space, const LevelShape& shape,
                           PoseLight light, CornerNormals normals, const std::optional<glm::dmat3>& rotation)
    : space_(space.seen_by(scene)),
      samples_(shape.samples),
      is_finest_(shape.short_side == std::min(scene.width, scene.height)),
      colors_{Renderer(device)},
      counts_colors_(!target.pixels.empty()),
      trusts_coverage_(!options.robust && (counts_colors_ || !options.silhouette.image.pixels.empty())),
      has_unknown_background_(options.unknown_background),
      weighs_observations_(dpr::has_observations(options)),
      factors_{options.silhouette.weight, options.depth.weight} {
  Scene whole = level_scene(scene, space_, options, shape, light);
  if (has_unknown_background_) whole.background = glm::vec3(0);
  const std::vector<View> lenses = space_.seen_through_lenses(whole.camera);
  if (!options.depth.image.pixels.empty()) {
    depths_.emplace(Images{.renderer = Renderer(device), .shows_depths = true});
    depths_->renderer.set_scene(subdivide_for_lens(shapes_alone(whole), {}, lenses).scene);
  }
  if (light == PoseLight::harmonics) give_normals(whole, space_.body(), normals, rotation);
  scene_ = subdivide_for_lens(whole, {}, lenses).scene;
  colors_.renderer.set_scene(scene_);
  if (light == PoseLight::harmonics) {
    show_normals(colors_.renderer);
    normals_.emplace();
  }
  target_.background = scene.background;
  target_.has_unknown_background = has_unknown_background_;
  mask_ = options.mask.pixels.empty() ? Image(width(), height(), glm::vec4(1))
                                      : resample(options.mask, width(), height());
  if (has_unknown_background_)
    covered_ = coverage_before_unknown(target, options.mask, options.box, width(), height());
  for (const glm::vec4& p : mask_.pixels) target_.weights.push_back(counts_colors_ ? p.x : 0);
  resample_images({target, options.silhouette.image, options.depth.image});
  sums_.emplace(device, target_, light, space_.size());
}

void PictureLevel::resample_images(const PictureImages& images) {
  target_.colors.clear();
  target_.colors.resize(mask_.pixels.size());
  if (counts_colors_) {
    const Image colors = resample(images.target, width(), height());
    std::ranges::transform(colors.pixels, target_.colors.begin(), [](const glm::vec4& p) {
      return cl_float4{{p.x, p.y, p.z, p.w}};
    });
  }
  if (weighs_observations_ || has_unknown_background_) target_.measured = measured(images);
}

void PictureLevel::set_images(const PictureImages& images) {
  resample_images(images);
  sums_->set_target(target_);
}

std::vector<cl_float4> PictureLevel::measured(const PictureImages& images) const {
  std::vector<cl_float4> result(mask_.pixels.size());
  const auto add = [&](const Image& image, std::size_t kind) {
    for (std::size_t i = 0; i < result.size(); ++i) {
      result[i].s[2 * kind] = image.pixels[i].x;
      result[i].s[2 * kind + 1] = image.pixels[i].w * mask_.pixels[i].x;
    }
  };
  Image silhouette = images.silhouette, depth = images.depth;
  for (glm::vec4& p : silhouette.pixels) p.w = 1;
  for (glm::vec4& p : depth.pixels) p = has_depth(p) ? glm::vec4(p.x, 0, 0, 1) : glm::vec4(0);
  if (silhouette.pixels.empty() && !counts_colors_ && space_.body().is_alone() && space_.may_cover(depth)) {
    const std::vector<bool> holes = holes_of(depth);
    silhouette = depth;
    for (std::size_t i = 0; i < holes.size(); ++i)
      silhouette.pixels[i] = {silhouette.pixels[i].w, 0, 0, holes[i] ? 0.0F : 1.0F};
  }
  if (has_unknown_background_) add(covered_, k_coverage);
  if (!silhouette.pixels.empty()) add(resample_weighted(silhouette, width(), height()), k_coverage);
  if (!depth.pixels.empty()) add(resample_medians(depth, width(), height()), k_depth);
  return result;
}

double PictureLevel::pixel_ndc() const { return 2.0 / std::min(width(), height()); }

template <typename Visitor>
void PictureLevel::in_batches(std::span<const Hypothesis> hypotheses, std::size_t images_each,
                              const Visitor& visit) const {
  std::size_t faces = 0;
  for (std::size_t i = 0; i < scene_.meshes.size(); ++i) faces += mesh_of(scene_, i).faces.size();
  const std::size_t fitting = std::min(k_most_pixels / pixels_of(scene_), k_most_faces / faces);
  const std::size_t batch = std::max(fitting / images_each, std::size_t{1});
  for (std::size_t first = 0; first < hypotheses.size(); first += batch)
    visit(hypotheses.subspan(first, std::min(batch, hypotheses.size() - first)));
}

std::vector<View> PictureLevel::views_of(std::span<const Hypothesis> hypotheses) const {
  std::vector<View> views;
  for (const Hypothesis& hypothesis : hypotheses) views.push_back(space_.view(hypothesis, scene_.camera));
  return views;
}

void PictureLevel::render(Images& images, std::span<const View> views) {
  images.renderer.set_views(views);
  if (images.shows_depths) show_depths(images.renderer);
  images.renderer.forward();
  averaged(last_frame(images.renderer, k_level).image, images.means.images);
}

const Buffer<cl_float4>& PictureLevel::rendered(const Images& images) const {
  return samples_ > 1 ? images.means.images : last_frame(images.renderer, k_level).image;
}

const Buffer<cl_float4>& PictureLevel::averaged(const Buffer<cl_float4>& samples, Buffer<cl_float4>& means) {
  if (samples_ == 1) return samples;
  sums_->average(samples, static_cast<std::size_t>(width()), static_cast<std::size_t>(samples_), means);
  return means;
}

HypothesisImages PictureLevel::render(std::span<const Hypothesis> hypotheses) {
  const bool are_depths_alone = depths_ && !counts_colors_;  // then their coverage will do
  if (!std::ranges::equal(hypotheses, shown_)) {
    shown_.clear();
    const std::vector<View> views = views_of(hypotheses);
    if (depths_) render(*depths_, views);
    if (!are_depths_alone) render(colors_, views);
    if (normals_) averaged(last_normals(colors_.renderer, k_level), normals_->images);
    shown_.assign(hypotheses.begin(), hypotheses.end());
  }
  const Buffer<cl_float4>& colors = rendered(are_depths_alone ? *depths_ : colors_);
  const Buffer<cl_float4>& normals = !normals_      ? colors
                                     : samples_ > 1 ? normals_->images
                                                    : last_normals(colors_.renderer, k_level);
  return {hypotheses.size(), colors, normals, depths_ ? rendered(*depths_) : colors};
}

std::pair<HypothesisImages, HypothesisTangents> PictureLevel::render_tangents(
    std::span<const Hypothesis> hypotheses) {
  const HypothesisImages images = render(hypotheses);
  std::vector<SceneTangent> directions(space_.size());
  for (std::size_t k = 0; k < directions.size(); ++k) {
    for (const Hypothesis& hypothesis : hypotheses)
      directions[k].views.push_back(space_.view_tangent(hypothesis, scene_.camera, k));
  }
  const auto tangents_of = [&](Images& of) -> const Buffer<cl_float4>& {
    return averaged(last_tangents(of.renderer, directions, k_level), of.means.tangents);
  };
  const Buffer<cl_float4>* const depths = depths_ ? &tangents_of(*depths_) : nullptr;
  const Buffer<cl_float4>& colors = depths != nullptr && !counts_colors_ ? *depths : tangents_of(colors_);
  const Buffer<cl_float4>* const normals =
      normals_ ? &averaged(last_normal_tangents(colors_.renderer), normals_->tangents) : nullptr;
  return {images, {colors, normals != nullptr ? *normals : colors, depths != nullptr ? *depths : colors}};
}

void PictureLevel::estimate_scale(std::span<const Hypothesis> hypotheses) {
  std::vector<float> scales;
  in_batches(hypotheses, 1, [&](std::span<const Hypothesis> batch) {
    std::ranges::copy_if(sums_->scales(render(batch)), std::back_inserter(scales),
                         [](float scale) { return scale > 0; });
  });
  set_color_scale(best_of(std::move(scales)));
}

void PictureLevel::set_color_scale(float scale) {
  constexpr float k_uncovered = 0.7F;  // of the most that a pixel leaves
  scales_.color = scale;
  if (has_unknown_background_) scales_.measured[k_coverage] = {.weight = k_uncovered * scale * scale};
}

void PictureLevel::weigh_observations(std::span<const Hypothesis> hypotheses) {
  constexpr float k_scale = 4;  // deviations, of robust losses
  constexpr float k_coverage_scale = 0.5F;
  // What pixels leave of coverage anywhere; and in parts of a pixel's side, of depth.
  constexpr float k_least_coverage = 0.05F, k_least_of_pixel = 0.25F;
  // What residuals say beyond this, before the finest level, is how wrong the poses are.
  constexpr float k_most_coverage = 0.25F, k_most_of_pixel = 1;
  // Without colours a quite other depth, k_scale deviations, counts no more than a pixel that is missing.
  constexpr float k_most_beside_depths = 0.1F;
  if (!weighs_observations_) return;
  std::array<std::vector<float>, std::tuple_size_v<Deviations>> found;
  in_batches(hypotheses, 1, [&](std::span<const Hypothesis> batch) {
    for (const Deviations& deviations : sums_->deviations(render(batch))) {
      for (std::size_t kind = 0; kind < found.size(); ++kind)
        if (deviations[kind]) found[kind].push_back(*deviations[kind]);
    }
  });
  const auto pixel = static_cast<float>(space_.radius() / space_.radius_ndc() * pixel_ndc());
  const float of_colors = best_of(found[0]);
  float of_coverage = std::max(best_of(found[1]), k_least_coverage);
  float of_depth = std::max(best_of(found[2]), k_least_of_pixel * pixel);
  scales_.measured[k_depth].scale = k_scale * of_depth;
  if (depths_ && !counts_colors_) of_coverage = std::min(of_coverage, k_most_beside_depths);
  if (!is_finest_) {
    of_coverage = std::min(of_coverage, k_most_coverage);
    of_depth = std::min(of_depth, k_most_of_pixel * pixel);
  }
  const bool counts_coverage =
      std::ranges::any_of(target_.measured, [](const cl_float4& m) { return m.s[1] > 0; });
  const float unit = of_colors > 0 ? of_colors : counts_coverage ? of_coverage : of_depth;
  if (!has_unknown_background_) {
    scales_.measured[k_coverage] = {.weight = factors_[k_coverage] * std::pow(unit / of_coverage, 2.0F),
                                    .scale = trusts_coverage_ ? 0 : k_coverage_scale};
  }
  scales_.measured[k_depth].weight = factors_[k_depth] * std::pow(unit / of_depth, 2.0F);
}

std::vector<double> PictureLevel::losses(std::span<const Hypothesis> hypotheses) {
  std::vector<double> result;
  in_batches(hypotheses, 1, [&](std::span<const Hypothesis> batch) {
    std::ranges::copy(sums_->losses(render(batch), scales_), std::back_inserter(result));
  });
  return result;
}

std::vector<NormalEquations> PictureLevel::linearize(std::span<const Hypothesis> hypotheses) {
  std::vector<NormalEquations> result;
  in_batches(hypotheses, space_.size() + 1, [&](std::span<const Hypothesis> batch) {
    const auto [images, tangents] = render_tangents(batch);
    std::ranges::copy(sums_->linearize(images, tangents, scales_), std::back_inserter(result));
  });
  return result;
}

ScoreCells PictureLevel::score_cells(const Hypothesis& hypothesis) {
  const auto [images, tangents] = render_tangents({&hypothesis, 1});
  return sums_->score_cells(images, tangents, scales_, static_cast<std::size_t>(width()));
}

double PictureLevel::blank_loss() {
  const std::size_t pixels = target_.colors.size();
  const auto robust = [](double squared, float scale) {
    return squared / (1 + (scale > 0 ? squared / std::pow(static_cast<double>(scale), 2) : 0));
  };
  double observed = 0;  // nothing is covered
  const ResidualWeight& coverage = scales_.measured[k_coverage];
  for (const cl_float4& m : target_.measured) {
    const auto wanted = static_cast<double>(m.s[0]), counts = static_cast<double>(m.s[1]);
    observed += counts * static_cast<double>(coverage.weight) * robust(wanted * wanted, coverage.scale);
  }
  const double weight = sums_->total() / k_color_channels;
  glm::dvec3 mean(0.0);
  for (std::size_t i = 0; i < pixels; ++i)
    mean += glm::dvec3(rgb(target_.colors[i]) * target_.weights[i]) / weight;
  const auto loss_of = [&](const glm::dvec3& color) {
    double sum = 0;
    for (std::size_t i = 0; i < pixels; ++i) {
      const glm::dvec3 residual = color - glm::dvec3(rgb(target_.colors[i]));
      sum += static_cast<double>(target_.weights[i]) * robust(glm::dot(residual, residual), scales_.color);
    }
    return sum;
  };
  const double colors = has_unknown_background_ ? 0 : std::min(loss_of(target_.background), loss_of(mean));
  const double blank = (colors + observed) / sums_->total();
  if (space_.body().is_alone()) return blank;
  const Hypothesis absent = space_.absent(scene_.camera);
  return std::min(blank, losses({&absent, 1}).front());
}

LossParts PictureLevel::loss_parts(const Hypothesis& hypothesis) {
  const bool counts_depths = counts_colors_ && depths_;
  LossParts parts;
  parts.noise = noise_loss(hypothesis);
  if (!has_unknown_background_ && !counts_depths) return parts;
  const HypothesisImages images = render({&hypothesis, 1});
  const double loss = sums_->measured_loss(images, scales_.measured);
  const auto without = [&](std::size_t kind) {
    MeasuredWeights weights = scales_.measured;
    weights[kind].weight = 0;
    return sums_->measured_loss(images, weights);
  };
  if (has_unknown_background_) parts.uncovered = loss - without(k_coverage);
  if (counts_depths) {
    // Of what quite other depths leave: others may lie before some of the object.
    constexpr double k_matched = 0.5;
    constexpr float k_sharper = 1e4F;
    const double others = without(k_depth);
    MeasuredWeights most = scales_.measured;
    most[k_depth].scale /= k_sharper;
    most[k_depth].weight *= k_sharper * k_sharper;
    parts.matched = std::min(loss - others, k_matched * (sums_->measured_loss(images, most) - others));
  }
  return parts;
}

double PictureLevel::noise_loss(const Hypothesis& hypothesis) {
  if (!counts_colors_ || has_unknown_background_ || scales_.color > 0) return 0;
  const std::vector<cl_float4> picture = render({&hypothesis, 1}).colors.download();
  const TargetNoise noise =
      noise_of(target_.colors, picture, static_cast<std::size_t>(width()), target_.background);
  double sum = 0;
  for (std::size_t i = 0; i < picture.size(); ++i)
    sum += static_cast<double>(target_.weights[i]) * (picture[i].s[3] > 0 ? noise.covered : noise.uncovered);
  return sum / sums_->total();
}

}  // namespace dpr
