// Losses on the device.
#include "dpr/loss.hpp"

#include <array>
#include <cmath>

#include "base/checks.hpp"
#include "loss/image_loss_impl.hpp"
#include "renderer/frame.hpp"

namespace dpr {
namespace {

constexpr std::array<std::string_view, 3> k_names{"mse", "l1", "silhouette"};

void check_weights(const LossWeights& weights) {
  for (const float weight : {weights.mse, weights.l1, weights.silhouette}) {
    if (!(weight >= 0) || !std::isfinite(weight)) {
      throw InvalidArgument("weight (loss)", std::to_string(weight), "a finite number, at least 0");
    }
  }
  if (weights.mse + weights.l1 + weights.silhouette <= 0) {
    throw InvalidArgument("weights (loss)", "all 0", "at least one above 0");
  }
}

void check_targets(std::span<const Image> targets) {
  if (targets.empty()) throw InvalidArgument("targets (loss)", "none", "one image a view");
  for (const Image& image : targets) {
    if (image.width < 1 || image.height < 1 || image.width != targets[0].width ||
        image.height != targets[0].height) {
      throw InvalidArgument("target size (loss)", checks::size(image.width, image.height),
                            "images of one size, " + checks::size(targets[0].width, targets[0].height));
    }
    checks::require_pixels(image, "target (loss)");
  }
}

}  // namespace

void check_loss(const LossWeights& weights, std::span<const Image> targets) {
  check_weights(weights);
  check_targets(targets);
}

std::string_view to_string(LossKind kind) { return k_names[static_cast<std::size_t>(kind)]; }

LossKind parse_loss(std::string_view word, std::string_view where) {
  for (std::size_t i = 0; i < k_names.size(); ++i) {
    if (k_names[i] == word) return static_cast<LossKind>(i);
  }
  throw InvalidArgument(std::string(where), "'" + std::string(word) + "'", "mse, l1 or silhouette");
}

LossWeights LossWeights::only(LossKind kind) {
  LossWeights weights;
  (kind == LossKind::mse ? weights.mse : kind == LossKind::l1 ? weights.l1 : weights.silhouette) = 1;
  return weights;
}

ImageLoss::Impl::Impl(const Device& device_, LossWeights weights_, std::span<const Image> targets,
                      std::span<const unsigned char> has_alpha)
    : device(device_),
      weights(weights_),
      width(targets[0].width),
      height(targets[0].height),
      views(targets.size()),
      per_view(targets.size()),
      silhouettes(targets.size(), weights_.silhouette),
      forward(device.impl(), "loss.cl", "loss_forward"),
      backward(device.impl(), "loss.cl", "loss_backward"),
      reduce(device.impl()) {
  const std::size_t pixels = targets[0].pixels.size();
  std::vector<cl_float4> values;
  std::vector<cl_uint> starts{0};
  for (const Image& image : targets) {
    for (const glm::vec4& p : image.pixels) values.push_back({{p.x, p.y, p.z, p.w}});
    starts.push_back(static_cast<cl_uint>(values.size()));
  }
  target.upload(device.impl(), values);
  view_starts.upload(device.impl(), starts);
  for (std::size_t view = 0; view < has_alpha.size(); ++view) {
    if (has_alpha[view] == 0) silhouettes[view] = 0;
  }
  view_silhouettes.upload(device.impl(), silhouettes);
  channels.resize(device.impl(), DPR_LOSS_SUMS * pixels * views);
  grad_image.resize(device.impl(), pixels * views);
}

ImageLoss::ImageLoss(const Device& device, LossWeights weights, std::span<const Image> targets,
                     std::span<const unsigned char> has_alpha) {
  check_loss(weights, targets);
  if (!has_alpha.empty() && has_alpha.size() != targets.size()) {
    throw InvalidArgument("has_alpha (loss)", std::to_string(has_alpha.size()) + " values",
                          "one for each of the " + std::to_string(targets.size()) + " targets, or none");
  }
  impl_ = std::make_unique<Impl>(device, weights, targets, has_alpha);
}

ImageLoss::~ImageLoss() = default;
ImageLoss::ImageLoss(ImageLoss&&) noexcept = default;
ImageLoss& ImageLoss::operator=(ImageLoss&&) noexcept = default;

double ImageLoss::evaluate(const Renderer& renderer) {
  Impl& m = *impl_;
  require_same_device(m.device, renderer, "ImageLoss::evaluate");
  const Frame frame = last_frame(renderer, "ImageLoss::evaluate");
  if (frame.views != m.views) {
    throw InvalidArgument("targets (loss)", std::to_string(m.views) + " images",
                          "one for each of the " + std::to_string(frame.views) + " views");
  }
  if (frame.width != m.width || frame.height != m.height) {
    throw InvalidArgument("target size (loss)", checks::size(m.width, m.height),
                          "the size of the render, " + checks::size(frame.width, frame.height));
  }
  const std::size_t pixels_per_view = static_cast<std::size_t>(m.width) * static_cast<std::size_t>(m.height);
  const std::size_t pixels = pixels_per_view * m.views;
  shared::LossParams p{};
  p.mse = m.weights.mse;
  p.l1 = m.weights.l1;
  p.views = static_cast<cl_uint>(m.views);
  p.pixels_per_view = static_cast<cl_uint>(pixels_per_view);
  m.frame_number = 0;  // until everything of this one is there
  m.forward(pixels, p, frame.image, m.target, m.channels);
  m.reduce({pixels, DPR_LOSS_SUMS, m.views, 1, m.view_starts, m.channels}, m.sums);
  m.backward(pixels, p, frame.image, m.target, m.sums, m.view_silhouettes, m.grad_image);

  const std::vector<float> sums = m.sums.download();
  double total = 0;
  for (std::size_t view = 0; view < m.views; ++view) {
    const auto sum = [&](std::size_t channel) { return static_cast<double>(sums[channel * m.views + view]); };
    const double count = 3.0 * static_cast<double>(pixels_per_view);
    const double iou = sum(3) > 0 ? sum(2) / sum(3) : 1.0;  // two empty images agree
    m.per_view[view] = m.weights.mse * sum(0) / count + m.weights.l1 * sum(1) / count +
                       static_cast<double>(m.silhouettes[view]) * (1 - iou);
    total += m.per_view[view] / static_cast<double>(m.views);
  }
  m.frame_number = frame.number;
  return total;
}

std::span<const double> ImageLoss::per_view() const { return impl_->per_view; }

}  // namespace dpr
