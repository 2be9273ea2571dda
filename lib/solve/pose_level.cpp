// Images of hypotheses against the target, and the derivatives of their difference.
#include "solve/pose_level.hpp"

#include <algorithm>
#include <cmath>

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

// Step of finite differences at the object's rim, as a part of the blur. A longer step would cross edges that
// the residual does not see; a shorter one would drown in rounding.
constexpr double k_difference = 0.3;

// Scale of the robust loss, in standard deviations of the residuals, and its lower bound: the colour
// difference that blur and rounding leave anywhere.
constexpr float k_scale = 4, k_least_scale = 0.02F;
constexpr int k_scale_iterations = 3;  // the light of the robust fit leaves other residuals

constexpr float k_channels = 3;

std::size_t pixels_of(const Scene& scene) {
  return static_cast<std::size_t>(scene.width) * static_cast<std::size_t>(scene.height);
}

/// The means of blocks of samples x samples, of images on top of each other; their height is a multiple too.
void average(const std::vector<cl_float4>& drawn, int width, int samples, std::vector<cl_float4>& images) {
  const auto side = static_cast<std::size_t>(samples), row_length = static_cast<std::size_t>(width);
  const std::size_t columns = row_length / side;
  const float share = 1.0F / static_cast<float>(samples * samples);
  images.assign(drawn.size() / (side * side), cl_float4{});
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    const std::size_t row = i / row_length / side, column = i % row_length / side;
    for (int c = 0; c < 4; ++c) images[row * columns + column].s[c] += share * drawn[i].s[c];
  }
}

glm::vec3 rgb(const cl_float4& color) { return {color.s[0], color.s[1], color.s[2]}; }

/// Robust loss of a pixel's squared colour difference (Geman & McClure 1985).
double robust(float weight, float squared, float inverse_scale_squared) {
  return static_cast<double>(weight * squared / (1 + squared * inverse_scale_squared));
}

/// Adds a pixel to the gradient and to the lower triangles of Hessian and scatter.
void add_pixel(std::span<const cl_float4> jacobian, const float (&residual)[3], float weight,
               NormalEquations& result) {
  const std::size_t n = jacobian.size();
  PoseSpace::Step score{};
  for (std::size_t k = 0; k < n; ++k) {
    const cl_float4& a = jacobian[k];
    score[k] =
        static_cast<double>(weight * (a.s[0] * residual[0] + a.s[1] * residual[1] + a.s[2] * residual[2]));
    result.gradient[k] += score[k];
    for (std::size_t l = 0; l <= k; ++l) {
      const cl_float4& b = jacobian[l];
      result.hessian[k * n + l] +=
          static_cast<double>(weight * (a.s[0] * b.s[0] + a.s[1] * b.s[1] + a.s[2] * b.s[2]));
      result.scatter[k * n + l] += score[k] * score[l];
    }
  }
}

}  // namespace

PoseLevel::PoseLevel(const Device& device, const Scene& scene, const Image& target,
                     const LeastSquares& options, const PoseSpace& space, const LevelShape& shape,
                     PoseLight light, CornerNormals normals)
    : space_(space), light_(light), samples_(shape.samples), renderer_(device) {
  const Scene whole = level_scene(scene, space, options, shape, light);
  const std::vector<View> lenses = space.seen_through_lenses(whole.camera);
  scene_ = subdivide_for_lens(whole, {}, lenses).scene;
  renderer_.set_scene(scene_);
  if (light == PoseLight::harmonics) {
    Scene colored = whole;
    Instance& object = colored.meshes.front();
    const glm::dmat3 stretch = polar_decomposition(glm::dmat3(object.transform)).stretch;
    object.mesh = colored_by_normals(object.mesh, stretch, normals);
    normal_renderer_.emplace(device).set_scene(subdivide_for_lens(colored, {}, lenses).scene);
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
}

double PoseLevel::pixel_ndc() const { return 2.0 / std::min(width(), height()); }

void PoseLevel::render_batch(Renderer& renderer, std::span<const View> views,
                             std::vector<cl_float4>& images) {
  renderer.set_views(views);
  renderer.forward();
  drawn_.resize(views.size() * pixels_of(scene_));
  last_frame(renderer, "PoseLevel").image.download(drawn_);
  if (samples_ == 1) {
    images.swap(drawn_);
  } else {
    average(drawn_, scene_.width, samples_, images);
  }
}

template <typename Visitor>
void PoseLevel::render(std::span<const View> views, std::size_t images_together, const Visitor& visit) {
  const std::size_t pixels = target_.colors.size(), faces = scene_.meshes.front().mesh.faces.size();
  const std::size_t fitting = std::min(k_most_pixels / pixels_of(scene_), k_most_faces / faces);
  const std::size_t batch = std::max(fitting / images_together, std::size_t{1}) * images_together;
  for (std::size_t first = 0; first < views.size(); first += batch) {
    const auto part = views.subspan(first, std::min(batch, views.size() - first));
    render_batch(renderer_, part, images_);
    if (normal_renderer_) render_batch(*normal_renderer_, part, normals_);
    for (std::size_t i = 0; i < part.size(); i += images_together) visit(first + i, images_at(i * pixels));
  }
}

HypothesisImages PoseLevel::images_at(std::size_t pixel) const {
  return {&images_[pixel], normal_renderer_ ? &normals_[pixel] : nullptr};
}

std::vector<View> PoseLevel::views_of(std::span<const Hypothesis> hypotheses) const {
  std::vector<View> views;
  for (const Hypothesis& hypothesis : hypotheses) views.push_back(space_.view(hypothesis, scene_.camera));
  return views;
}

void PoseLevel::set_scale(float scale) {
  scale_ = scale;
  target_.inverse_scale_squared = scale > 0 ? 1 / (scale * scale) : 0;
}

void PoseLevel::estimate_scale(std::span<const Hypothesis> hypotheses) {
  constexpr std::ptrdiff_t k_best = 16;  // one of so many: the very best may fit by luck
  std::vector<float> scales;
  render(views_of(hypotheses), 1, [&](std::size_t, const HypothesisImages& image) {
    set_scale(0);
    for (int i = 0; i < k_scale_iterations; ++i)
      set_scale(std::max(k_scale * deviation(image), k_least_scale));
    if (!shown_.empty()) scales.push_back(scale_);
  });
  set_scale(0);
  if (scales.empty()) return;
  const auto best = scales.begin() + std::ssize(scales) / k_best;
  std::ranges::nth_element(scales, best);
  set_scale(*best);
}

float PoseLevel::deviation(const HypothesisImages& image) {
  find_shown(image, 1);
  if (light_ != PoseLight::fixed) return LightFit(target_, shown_, image).deviation();
  std::vector<float> sizes;
  for (const std::size_t i : shown_) {
    for (int c = 0; c < 3; ++c) sizes.push_back(std::abs(image.colors[i].s[c] - target_.colors[i].s[c]));
  }
  return robust_deviation(sizes);
}

std::vector<double> PoseLevel::losses(std::span<const Hypothesis> hypotheses) {
  const std::vector<View> views = views_of(hypotheses);
  std::vector<double> result(views.size());
  render(views, 1, [&](std::size_t i, const HypothesisImages& image) {
    result[i] = light_ == PoseLight::fixed ? loss(image) : loss_in_best_light(image);
  });
  return result;
}

std::vector<NormalEquations> PoseLevel::linearize(std::span<const Hypothesis> hypotheses) {
  const PoseSpace::Step step =
      space_.step_lengths(k_difference * static_cast<double>(scene_.smoothing.sigma));
  std::vector<View> views;
  for (const Hypothesis& hypothesis : hypotheses) {
    views.push_back(space_.view(hypothesis, scene_.camera));
    for (std::size_t k = 0; k < space_.size(); ++k) {
      PoseSpace::Step one{};
      one[k] = step[k];
      views.push_back(space_.view(space_.moved(hypothesis, one), scene_.camera));
    }
  }
  std::vector<NormalEquations> result(hypotheses.size());
  const std::size_t together = space_.size() + 1;
  render(views, together, [&](std::size_t i, const HypothesisImages& images) {
    if (light_ == PoseLight::fixed) {
      accumulate(images, step, result[i / together]);
    } else {
      accumulate_in_best_light(images, step, result[i / together]);
    }
  });
  return result;
}

double PoseLevel::pixel_loss(std::size_t i, const glm::vec3& color) const {
  const glm::vec3 residual = color - rgb(target_.colors[i]);
  return robust(target_.weights[i], glm::dot(residual, residual), target_.inverse_scale_squared);
}

double PoseLevel::loss(const HypothesisImages& image) const {
  double sum = 0;
  for (std::size_t i = 0; i < target_.colors.size(); ++i) sum += pixel_loss(i, rgb(image.colors[i]));
  return sum / (static_cast<double>(k_channels) * weight_);
}

double PoseLevel::blank_loss() const {
  const std::size_t pixels = target_.colors.size();
  glm::dvec3 mean(0.0);
  for (std::size_t i = 0; i < pixels; ++i)
    mean += glm::dvec3(rgb(target_.colors[i]) * target_.weights[i]) / weight_;
  const auto loss_of = [&](const glm::vec3& color) {
    double sum = 0;
    for (std::size_t i = 0; i < pixels; ++i) sum += pixel_loss(i, color);
    return sum / (static_cast<double>(k_channels) * weight_);
  };
  return std::min(loss_of(target_.background), loss_of(glm::vec3(mean)));
}

void PoseLevel::find_shown(const HypothesisImages& images, std::size_t count) {
  const std::size_t pixels = target_.colors.size();
  shown_.clear();
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t k = 0; k < count; ++k) {
      if (images.colors[k * pixels + i].s[3] <= 0) continue;
      shown_.push_back(i);
      break;
    }
  }
}

double PoseLevel::background_loss() const {
  double sum = 0;
  std::size_t next = 0;
  for (std::size_t i = 0; i < target_.colors.size(); ++i) {
    if (next < shown_.size() && shown_[next] == i) {
      ++next;
      continue;
    }
    sum += pixel_loss(i, target_.background);
  }
  return sum;
}

double PoseLevel::loss_in_best_light(const HypothesisImages& image) {
  find_shown(image, 1);
  return (LightFit(target_, shown_, image).loss() + background_loss()) /
         (static_cast<double>(k_channels) * weight_);
}

void PoseLevel::accumulate_in_best_light(const HypothesisImages& images, const PoseSpace::Step& step,
                                         NormalEquations& result) {
  const std::size_t n = space_.size(), pixels = target_.colors.size();
  find_shown(images, n + 1);
  const LightFit fit(target_, shown_, images);
  const auto size = static_cast<Eigen::Index>(n);
  const Eigen::VectorXf weights = fit.weights().matrix();
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size);
  Eigen::MatrixXf jacobian(static_cast<Eigen::Index>(shown_.size()), size);
  Eigen::MatrixXf score = Eigen::MatrixXf::Zero(jacobian.rows(), size);
  for (int c = 0; c < 3; ++c) {
    for (std::size_t k = 0; k < n; ++k) {
      HypothesisImages moved = images;
      moved.colors += (k + 1) * pixels;
      if (moved.normals != nullptr) moved.normals += (k + 1) * pixels;
      jacobian.col(static_cast<Eigen::Index>(k)) = fit.difference(moved, c) * static_cast<float>(1 / step[k]);
    }
    const Eigen::MatrixXf projected = fit.project(jacobian, c);
    const Eigen::VectorXf residual = weights.cwiseProduct(fit.residuals().col(c));
    hessian += (jacobian.transpose() * weights.asDiagonal() * projected).cast<double>();
    gradient += (jacobian.transpose() * residual).cast<double>();
    score += residual.asDiagonal() * projected;
  }
  const Eigen::MatrixXd scatter = (score.transpose() * score).cast<double>();
  const double scale = 1 / (static_cast<double>(k_channels) * weight_);
  for (std::size_t k = 0; k < n; ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    result.gradient[k] = scale * gradient[row];
    for (std::size_t l = 0; l < n; ++l) {
      const auto column = static_cast<Eigen::Index>(l);
      result.hessian[k * n + l] = scale * (hessian(row, column) + hessian(column, row)) / 2;
      result.scatter[k * n + l] = scale * scale * scatter(row, column);
    }
  }
  result.loss = scale * (fit.loss() + background_loss());
}

void PoseLevel::accumulate(const HypothesisImages& images, const PoseSpace::Step& step,
                           NormalEquations& result) const {
  const std::size_t n = space_.size(), pixels = target_.colors.size();
  std::array<float, PoseSpace::k_most_parameters> inverse_step{};
  for (std::size_t k = 0; k < n; ++k) inverse_step[k] = static_cast<float>(1 / step[k]);
  std::array<cl_float4, PoseSpace::k_most_parameters> jacobian{};
  for (std::size_t i = 0; i < pixels; ++i) {
    const cl_float4 image = images.colors[i];
    bool still = true;  // most pixels show no edge: nothing there depends on the pose
    for (std::size_t k = 0; k < n; ++k) {
      const cl_float4 moved = images.colors[(k + 1) * pixels + i];
      for (int c = 0; c < 3; ++c) {
        jacobian[k].s[c] = (moved.s[c] - image.s[c]) * inverse_step[k];
        still = still && moved.s[c] == image.s[c];
      }
    }
    if (still) continue;
    float residual[3], squared = 0;
    for (int c = 0; c < 3; ++c) {
      residual[c] = image.s[c] - target_.colors[i].s[c];
      squared += residual[c] * residual[c];
    }
    // Iteratively reweighted: the derivative of the robust loss, and the part of its curvature that is
    // positive.
    const float slope = 1 / (1 + squared * target_.inverse_scale_squared);
    add_pixel(std::span(jacobian).first(n), residual, target_.weights[i] * slope * slope, result);
  }
  const double scale = 1 / (static_cast<double>(k_channels) * weight_);
  for (std::size_t k = 0; k < n; ++k) {
    result.gradient[k] *= scale;
    for (std::size_t l = 0; l <= k; ++l) {
      result.hessian[l * n + k] = result.hessian[k * n + l] *= scale;
      result.scatter[l * n + k] = result.scatter[k * n + l] *= scale * scale;
    }
  }
  result.loss = loss(images);
}

}  // namespace dpr
