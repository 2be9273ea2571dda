// Losses between images on the device; their formulas are in kernels/loss_*.h.
#include "dpr/image_loss.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "loss/image_loss_impl.hpp"
#include "renderer/frame.hpp"

namespace dpr {
namespace {

#define DPR_LOSS_ROW(name)                                                                       \
  ImageLossRow{#name, &LossWeights::name, shared::name##_first, shared::name##_reads_alpha != 0, \
               shared::name##_value},
constexpr std::array k_losses{DPR_IMAGE_LOSSES(DPR_LOSS_ROW)};
#define DPR_LOSS_ORDER(name) static_assert(static_cast<int>(LossKind::name) == shared::name##_number);
DPR_IMAGE_LOSSES(DPR_LOSS_ORDER)

void check_weights(const LossWeights& weights) {
  float sum = 0;
  for (const ImageLossRow& loss : k_losses) {
    const float weight = weights.*loss.weight;
    if (!(weight >= 0) || !std::isfinite(weight)) {
      throw InvalidArgument("weight (loss)", std::to_string(weight), "a finite number, at least 0");
    }
    sum += weight;
  }
  if (sum <= 0) throw InvalidArgument("weights (loss)", "all 0", "at least one above 0");
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

std::span<const ImageLossRow> image_losses() { return k_losses; }

std::string_view to_string(LossKind kind) { return k_losses[static_cast<std::size_t>(kind)].name; }

std::vector<std::string_view> loss_names() {
  std::vector<std::string_view> names;
  for (const ImageLossRow& loss : k_losses) names.push_back(loss.name);
  return names;
}

LossKind parse_loss(std::string_view word, std::string_view where) {
  const std::vector<std::string_view> names = loss_names();
  const auto found = std::ranges::find(names, word);
  if (found != names.end()) return static_cast<LossKind>(found - names.begin());
  throw InvalidArgument(std::string(where), "'" + std::string(word) + "'", one_of(names));
}

LossWeights LossWeights::only(LossKind kind) {
  LossWeights weights;
  weights.*k_losses[static_cast<std::size_t>(kind)].weight = 1;
  return weights;
}

ImageLoss::Impl::Impl(const Device& device_, LossWeights weights, std::span<const Image> targets,
                      std::span<const unsigned char> has_alpha)
    : device(device_),
      width(targets[0].width),
      height(targets[0].height),
      views(targets.size()),
      per_view(targets.size()),
      forward(device.impl(), "image_loss.cl", "image_loss_forward"),
      backward(device.impl(), "image_loss.cl", "image_loss_backward"),
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
  for (std::size_t view = 0; view < views; ++view) {
    const bool shows_alpha = has_alpha.empty() || has_alpha[view] != 0;
    for (const ImageLossRow& loss : k_losses)
      view_weights.push_back(loss.reads_alpha && !shows_alpha ? 0 : weights.*loss.weight);
  }
  device_weights.upload(device.impl(), view_weights);
  channels.resize(device.impl(), shared::DPR_LOSS_SUMS * pixels * views);
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
  m.frame_number = 0;  // until everything of this one is there
  m.forward(pixels, static_cast<cl_uint>(pixels), frame.image, m.target, m.channels);
  m.reduce({pixels, shared::DPR_LOSS_SUMS, m.views, 1, m.view_starts, m.channels}, m.sums);
  m.backward(pixels, static_cast<cl_uint>(m.views), static_cast<cl_uint>(pixels_per_view), frame.image,
             m.target, m.sums, m.device_weights, m.grad_image);

  const std::vector<float> sums = m.sums.download();
  double total = 0;
  for (std::size_t view = 0; view < m.views; ++view) {
    std::array<double, shared::DPR_LOSS_SUMS> of_view{};
    for (std::size_t k = 0; k < of_view.size(); ++k)
      of_view[k] = static_cast<double>(sums[k * m.views + view]);
    m.per_view[view] = 0;
    for (std::size_t l = 0; l < k_losses.size(); ++l) {
      m.per_view[view] +=
          k_losses[l].value(static_cast<double>(m.weight(view, l)), &of_view[k_losses[l].first_sum],
                            3.0 * static_cast<double>(pixels_per_view));
    }
    total += m.per_view[view] / static_cast<double>(m.views);
  }
  m.frame_number = frame.number;
  return total;
}

std::span<const double> ImageLoss::per_view() const { return impl_->per_view; }

}  // namespace dpr
