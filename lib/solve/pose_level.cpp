// Images of hypotheses against the target, and the derivatives of their difference.
#include "solve/pose_level.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "dpr/subdivision.hpp"
#include "renderer/frame.hpp"
#include "solve/level_scene.hpp"
#include "solve/polar.hpp"
#include "solve/resample.hpp"

namespace dpr {
namespace {

// A batch as large as keeps a device busy; the bounds keep its memory small.
constexpr std::size_t k_most_pixels = std::size_t{1} << 20;
constexpr std::size_t k_most_faces = std::size_t{1} << 20;

constexpr double k_color_channels = 3;

std::size_t pixels_of(const Scene& scene) {
  return static_cast<std::size_t>(scene.width) * static_cast<std::size_t>(scene.height);
}

glm::vec3 rgb(const cl_float4& color) { return {color.s[0], color.s[1], color.s[2]}; }

}  // namespace

PoseLevel::PoseLevel(const Device& device, const Scene& scene, const Image& target,
                     const LeastSquares& options, const PoseSpace& space, const LevelShape& shape,
                     PoseLight light, CornerNormals normals)
    : space_(space), samples_(shape.samples), colors_{Renderer(device)} {
  const Scene whole = level_scene(scene, space, options, shape, light);
  const std::vector<View> lenses = space.seen_through_lenses(whole.camera);
  scene_ = subdivide_for_lens(whole, {}, lenses).scene;
  colors_.renderer.set_scene(scene_);
  if (light == PoseLight::harmonics) {
    Scene colored = whole;
    Instance& object = colored.meshes.front();
    const glm::dmat3 stretch = polar_decomposition(glm::dmat3(object.transform)).stretch;
    object.mesh = colored_by_normals(object.mesh, stretch, normals);
    normals_.emplace(Images{Renderer(device)})
        .renderer.set_scene(subdivide_for_lens(colored, {}, lenses).scene);
  }
  target_.background = scene.background;
  for (const glm::vec4& p : resample(target, width(), height()).pixels) {
    target_.colors.push_back({{p.x, p.y, p.z, p.w}});
  }
  target_.weights.assign(target_.colors.size(), 1.0F);
  if (!options.mask.pixels.empty()) {
    const Image mask = resample(options.mask, width(), height());
    std::ranges::transform(mask.pixels, target_.weights.begin(), [](const glm::vec4& p) { return p.x; });
  }
  for (const float w : target_.weights) weight_ += static_cast<double>(w);
  sums_.emplace(device, target_, light, space.size());
}

double PoseLevel::pixel_ndc() const { return 2.0 / std::min(width(), height()); }

template <typename Visitor>
void PoseLevel::in_batches(std::span<const Hypothesis> hypotheses, std::size_t images_each,
                           const Visitor& visit) const {
  const std::size_t faces = scene_.meshes.front().mesh.faces.size();
  const std::size_t fitting = std::min(k_most_pixels / pixels_of(scene_), k_most_faces / faces);
  const std::size_t batch = std::max(fitting / images_each, std::size_t{1});
  for (std::size_t first = 0; first < hypotheses.size(); first += batch)
    visit(hypotheses.subspan(first, std::min(batch, hypotheses.size() - first)));
}

std::vector<View> PoseLevel::views_of(std::span<const Hypothesis> hypotheses) const {
  std::vector<View> views;
  for (const Hypothesis& hypothesis : hypotheses) views.push_back(space_.view(hypothesis, scene_.camera));
  return views;
}

const Buffer<cl_float4>& PoseLevel::render(Images& images, std::span<const View> views) {
  images.renderer.set_views(views);
  images.renderer.forward();
  const Buffer<cl_float4>& samples = last_frame(images.renderer, "PoseLevel").image;
  return samples_ == 1 ? samples : averaged(samples, images.means);
}

const Buffer<cl_float4>& PoseLevel::averaged(const Buffer<cl_float4>& samples, Buffer<cl_float4>& means) {
  sums_->average(samples, static_cast<std::size_t>(width()), static_cast<std::size_t>(samples_), means);
  return means;
}

HypothesisImages PoseLevel::render(std::span<const Hypothesis> hypotheses) {
  const std::vector<View> views = views_of(hypotheses);
  const Buffer<cl_float4>& colors = render(colors_, views);
  return {views.size(), colors, normals_ ? render(*normals_, views) : colors};
}

std::pair<HypothesisImages, HypothesisTangents> PoseLevel::render_tangents(
    std::span<const Hypothesis> hypotheses) {
  const HypothesisImages images = render(hypotheses);
  std::vector<SceneTangent> directions(space_.size());
  for (std::size_t k = 0; k < directions.size(); ++k) {
    for (const Hypothesis& hypothesis : hypotheses)
      directions[k].views.push_back(space_.view_tangent(hypothesis, scene_.camera, k));
  }
  const auto tangents_of = [&](Images& of) -> const Buffer<cl_float4>& {
    const Buffer<cl_float4>& samples = last_tangents(of.renderer, directions, "PoseLevel");
    return samples_ == 1 ? samples : averaged(samples, of.tangents);
  };
  const Buffer<cl_float4>& colors = tangents_of(colors_);
  return {images, {colors, normals_ ? tangents_of(*normals_) : colors}};
}

void PoseLevel::estimate_scale(std::span<const Hypothesis> hypotheses) {
  constexpr std::ptrdiff_t k_best = 16;  // one of so many: the very best may fit by luck
  std::vector<float> scales;
  in_batches(hypotheses, 1, [&](std::span<const Hypothesis> batch) {
    std::ranges::copy_if(sums_->scales(render(batch)), std::back_inserter(scales),
                         [](float scale) { return scale > 0; });
  });
  scale_ = 0;
  if (scales.empty()) return;
  const auto best = scales.begin() + std::ssize(scales) / k_best;
  std::ranges::nth_element(scales, best);
  scale_ = *best;
}

std::vector<double> PoseLevel::losses(std::span<const Hypothesis> hypotheses) {
  std::vector<double> result;
  in_batches(hypotheses, 1, [&](std::span<const Hypothesis> batch) {
    std::ranges::copy(sums_->losses(render(batch), scale_), std::back_inserter(result));
  });
  return result;
}

std::vector<NormalEquations> PoseLevel::linearize(std::span<const Hypothesis> hypotheses) {
  std::vector<NormalEquations> result;
  in_batches(hypotheses, space_.size() + 1, [&](std::span<const Hypothesis> batch) {
    const auto [images, tangents] = render_tangents(batch);
    std::ranges::copy(sums_->linearize(images, tangents, scale_), std::back_inserter(result));
  });
  return result;
}

ScoreCells PoseLevel::score_cells(const Hypothesis& hypothesis) {
  const auto [images, tangents] = render_tangents({&hypothesis, 1});
  return sums_->score_cells(images, tangents, scale_, static_cast<std::size_t>(width()));
}

double PoseLevel::blank_loss() const {
  const std::size_t pixels = target_.colors.size();
  glm::dvec3 mean(0.0);
  for (std::size_t i = 0; i < pixels; ++i)
    mean += glm::dvec3(rgb(target_.colors[i]) * target_.weights[i]) / weight_;
  const double inverse = scale_ > 0 ? 1 / std::pow(static_cast<double>(scale_), 2) : 0;
  const auto loss_of = [&](const glm::dvec3& color) {
    double sum = 0;
    for (std::size_t i = 0; i < pixels; ++i) {
      const glm::dvec3 residual = color - glm::dvec3(rgb(target_.colors[i]));
      const double squared = glm::dot(residual, residual);
      sum += static_cast<double>(target_.weights[i]) * squared / (1 + squared * inverse);
    }
    return sum / (k_color_channels * weight_);
  };
  return std::min(loss_of(target_.background), loss_of(mean));
}

}  // namespace dpr
