// Standard errors of images and gradients from independent replicates.
#include "dpr/sampling_error.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "base/checks.hpp"
#include "renderer/renderer_impl.hpp"
#include "scene/gradient_table.hpp"

namespace dpr {
namespace {

/// Spreads of many numbers, by Welford's recurrence: they are far below the numbers themselves.
class Spread {
 public:
  void add(std::size_t index, double value) {
    if (index >= mean_.size()) {
      mean_.resize(index + 1);
      squares_.resize(index + 1);
    }
    const double change = value - mean_[index];
    mean_[index] += change / count_;
    squares_[index] += change * (value - mean_[index]);
  }
  void next_replicate() { ++count_; }
  /// 0 of a single replicate.
  double variance(std::size_t index) const { return count_ > 1 ? squares_[index] / (count_ - 1) : 0; }
  double deviation(std::size_t index) const { return std::sqrt(variance(index)); }

 private:
  std::vector<double> mean_, squares_;
  double count_ = 0;
};

/// Sums over the replicates of a renderer.
class Replicates {
 public:
  explicit Replicates(Renderer::Impl& renderer) : m_(renderer) {}

  void add(const Renderer& renderer, SceneGradient gradient) {
    for (Spread* spread : {&image_, &depth_, &distance_, &gradient_}) spread->next_replicate();
    for (std::size_t v = 0; v < m_.views.size(); ++v) add_image(renderer.image(v), v);
    if (has_fragments_of_pixels()) add_fragments();
    std::size_t i = 0;
    transform_numbers(gradient, [&](double value) {
      gradient_.add(i++, value);
      return value;
    });
    last_ = std::move(gradient);
  }

  SamplingError result() const {
    SamplingError error;
    for (std::size_t v = 0; v < m_.views.size(); ++v) error.images.push_back(image_of(v));
    if (has_fragments_of_pixels()) error.pixel_gradients = pixel_gradients();
    error.gradient = last_;
    std::size_t i = 0;
    transform_numbers(error.gradient, [&](double) { return gradient_.deviation(i++); });
    return error;
  }

 private:
  /// With noise of the pixel they are the samples'.
  bool has_fragments_of_pixels() const { return m_.bands.size() == 1 && !m_.pixel_noise; }

  void add_image(const Image& image, std::size_t view) {
    std::size_t i = view * 4 * image.pixels.size();
    for (const glm::vec4& pixel : image.pixels) {
      for (int c = 0; c < 4; ++c) image_.add(i++, static_cast<double>(pixel[c]));
    }
  }

  void add_fragments() {
    const std::vector<float> by_depth = m_.rasterize.grad_plane(m_.frame, DPR_PLANE_DEPTH),
                             by_distance = m_.rasterize.grad_plane(m_.frame, DPR_PLANE_DISTANCE);
    for (std::size_t k = 0; k < by_depth.size(); ++k) {
      depth_.add(k, static_cast<double>(by_depth[k]));
      distance_.add(k, static_cast<double>(by_distance[k]));
    }
  }

  Image image_of(std::size_t view) const {
    Image image(m_.scene.width, m_.scene.height);
    std::size_t i = view * 4 * image.pixels.size();
    for (glm::vec4& pixel : image.pixels) {
      for (int c = 0; c < 4; ++c) pixel[c] = static_cast<float>(image_.deviation(i++));
    }
    return image;
  }

  std::vector<std::vector<float>> pixel_gradients() const {
    const std::vector<cl_uint> starts = m_.rasterize.pixel_starts.download(),
                               list = m_.rasterize.list.download();
    const std::size_t pixels = std::size_t{m_.frame.width} * m_.frame.height;
    std::vector<std::vector<float>> result;
    for (std::size_t v = 0; v < m_.views.size(); ++v) {
      const Camera& camera = m_.views[v].camera;
      const Smoothing& s = m_.scene.smoothing;
      const double depth_scale = static_cast<double>(s.gamma * (camera.zfar - camera.znear));
      const double distance_scale = static_cast<double>(s.sigma);
      std::vector<float>& view = result.emplace_back();
      for (std::size_t pixel = v * pixels; pixel < (v + 1) * pixels; ++pixel) {
        double variance = 0;
        for (cl_uint i = starts[pixel]; i < starts[pixel + 1]; ++i) {
          variance += depth_.variance(list[i]) * depth_scale * depth_scale +
                      distance_.variance(list[i]) * distance_scale * distance_scale;
        }
        view.push_back(static_cast<float>(std::sqrt(variance)));
      }
    }
    return result;
  }

  Renderer::Impl& m_;
  Spread image_, depth_, distance_, gradient_;
  SceneGradient last_;
};

/// The renderer's smoothing, and a request that computes the gradients of distances; put back at the end.
class Restored {
 public:
  explicit Restored(Renderer::Impl& renderer)
      : renderer_(renderer),
        smoothing_(renderer.scene.smoothing),
        prepared_(renderer.prepare(smoothing_)),
        request_(renderer.scene.gradients) {
    renderer.scene.gradients.smoothing = true;
  }
  ~Restored() {
    renderer_.scene.gradients = request_;
    if (renderer_.scene.smoothing.seed != smoothing_.seed) renderer_.set(std::move(prepared_));
  }
  Restored(const Restored&) = delete;
  Restored& operator=(const Restored&) = delete;

  const Smoothing& smoothing() const { return smoothing_; }
  const GradientRequest& request() const { return request_; }

 private:
  Renderer::Impl& renderer_;
  Smoothing smoothing_;
  SmoothingSetting prepared_;
  GradientRequest request_;
};

SamplingError replicate(Renderer& renderer, unsigned replicates,
                        const std::function<SceneGradient()>& backward) {
  require(replicates >= 2, "replicates (sampling error)", replicates, "at least 2");
  impl_of(renderer).require_scene("estimate_sampling_error");
  const Restored restored(impl_of(renderer));
  const Smoothing& own = restored.smoothing();
  Replicates found(impl_of(renderer));
  // The renderer's own seed comes last. Exact estimators need no second frame.
  for (unsigned i = is_sampled(own) ? replicates : 1; i-- > 0;) {
    Smoothing seeded = own;
    seeded.seed += i;
    renderer.set_smoothing(seeded);
    renderer.forward();
    found.add(renderer, backward());
  }
  SamplingError error = found.result();
  error.replicates = replicates;
  error.samples = own.samples;
  if (!restored.request().smoothing) error.gradient.sigma = error.gradient.gamma = error.gradient.alpha = 0;
  return error;
}

}  // namespace

double SamplingError::image_rms() const {
  double sum = 0, count = 0;
  for (const Image& image : images) {
    for (const glm::vec4& pixel : image.pixels) {
      const glm::dvec3 color(pixel);
      sum += glm::dot(color, color);
      count += 3;
    }
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

SamplingError estimate_sampling_error(Renderer& renderer, std::span<const Image> grad_images,
                                      unsigned replicates) {
  return replicate(renderer, replicates, [&] { return renderer.backward(grad_images); });
}

SamplingError estimate_sampling_error(Renderer& renderer, ImageLoss& loss, unsigned replicates) {
  return replicate(renderer, replicates, [&] {
    loss.evaluate(renderer);
    return renderer.backward(loss);
  });
}

std::uint32_t suggest_samples(double error, std::uint32_t samples, double wanted) {
  require(error >= 0 && std::isfinite(error), "error (suggest_samples)", error, "a finite number >= 0");
  require(wanted > 0, "wanted (suggest_samples)", wanted, "a number above 0");
  require(samples >= 1, "samples (suggest_samples)", samples, "at least 1");
  constexpr double k_most_samples = 1 << 20;
  const double ratio = error / wanted;
  return static_cast<std::uint32_t>(std::clamp(std::ceil(samples * ratio * ratio), 1.0, k_most_samples));
}

}  // namespace dpr
