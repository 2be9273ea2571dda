// Losses between images on the device; their formulas are in kernels/loss_*.h.
#include "dpr/image_loss.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "loss/image_loss_impl.hpp"
#include "renderer/frame.hpp"
#include "renderer/scene_batch_impl.hpp"

namespace dpr {
namespace {

#define DPR_LOSS_ROW(name)                                                                      \
  ImageLossRow{#name, &LossWeights::name, shared::name##_sums, shared::name##_reads_alpha != 0, \
               shared::name##_value},
constexpr std::array k_losses{DPR_IMAGE_LOSSES(DPR_LOSS_ROW)};
#define DPR_LOSS_ORDER(name) static_assert(static_cast<int>(LossKind::name) == shared::name##_number);
DPR_IMAGE_LOSSES(DPR_LOSS_ORDER)

void check_weights(const LossWeights& weights, bool may_be_0) {
  float sum = 0;
  for (const ImageLossRow& loss : k_losses) {
    const float weight = weights.*loss.weight;
    if (!(weight >= 0) || !std::isfinite(weight)) {
      throw InvalidArgument("weight of " + std::string(loss.name) + " (loss)", std::to_string(weight),
                            "a finite number, at least 0");
    }
    sum += weight;
  }
  if (sum <= 0 && !may_be_0) throw InvalidArgument("weights (loss)", "all 0", "at least one above 0");
  constexpr float k_least_scale = 1e-6F;  // its inverse squared is still a number
  require(weights.robust_scale >= k_least_scale && std::isfinite(weights.robust_scale), "robust_scale (loss)",
          weights.robust_scale, "a finite number, at least 1e-6");
}

void check_targets(std::span<const Image> targets) {
  if (targets.empty()) throw InvalidArgument("targets (loss)", "none", "one image a view");
  for (const Image& image : targets) {
    if (image.width < 1 || image.height < 1)
      throw InvalidArgument("target size (loss)", checks::size(image.width, image.height), "at least 1x1");
    if (image.width != targets[0].width || image.height != targets[0].height) {
      throw InvalidArgument("target size (loss)", checks::size(image.width, image.height),
                            "images of one size, " + checks::size(targets[0].width, targets[0].height));
    }
    checks::require_pixels(image, "target (loss)");
  }
}

void check_masks(std::span<const Image> masks, std::span<const Image> targets) {
  if (masks.empty()) return;
  if (masks.size() != targets.size()) {
    throw InvalidArgument("masks (loss)", std::to_string(masks.size()) + " images",
                          "one for each of the " + std::to_string(targets.size()) + " targets, or none");
  }
  for (const Image& mask : masks) require_mask(mask, targets[0], "mask (loss)");
}

/// Pixels of a work-item, as kernels/image_loss.cl has them.
std::size_t pixel_run(const Device::Impl& device) { return device.info.lanes == 1 ? 1 : 16; }

/// The next level of a pyramid, as image_loss_shrink makes it.
Image shrink(const Image& large) {
  Image small((large.width + 1) / 2, (large.height + 1) / 2);
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x) {
      const int columns = std::min(large.width - 2 * x, 2), rows = std::min(large.height - 2 * y, 2);
      glm::vec4 sum(0);
      for (int k = 0; k < columns * rows; ++k) sum += large.at(2 * x + k % columns, 2 * y + k / columns);
      small.at(x, y) = sum / static_cast<float>(columns * rows);
    }
  }
  return small;
}

std::vector<Image> shrink(std::span<const Image> large) {
  std::vector<Image> small;
  for (const Image& image : large) small.push_back(shrink(image));
  return small;
}

std::vector<cl_float4> rgba_of(std::span<const Image> images, std::size_t pixels) {
  std::vector<cl_float4> result;
  result.reserve(pixels);
  for (const Image& image : images) {
    for (const glm::vec4& p : image.pixels) result.push_back({{p.x, p.y, p.z, p.w}});
  }
  return result;
}

/// Weights of all views' pixels: their masks, or 1 without masks.
std::vector<float> weights_of(std::span<const Image> masks, std::size_t pixels) {
  if (masks.empty()) return std::vector<float>(pixels, 1.0F);
  std::vector<float> result;
  result.reserve(pixels);
  for (const Image& mask : masks) {
    for (const glm::vec4& p : mask.pixels) result.push_back(p.x);
  }
  return result;
}

/// Throws InvalidArgument unless every level holds windows, and every mask leaves some there.
void check_windows(const LossOptions& options, const Image& target) {
  int width = target.width, height = target.height;
  for (unsigned level = 1; level < options.levels; ++level) {
    width = (width + 1) / 2;
    height = (height + 1) / 2;
  }
  require_window(width, height);
  for (const Image& mask : options.masks) {
    Image smaller = mask;
    for (unsigned level = 0; level < options.levels; ++level) {
      if (level > 0) smaller = shrink(smaller);
      static_cast<void>(ssim_windows(std::span(&smaller, 1)));
    }
  }
}

}  // namespace

void check_loss(const LossOptions& options, std::span<const Image> targets) {
  constexpr unsigned k_most_levels = 16;
  check_weights(options.weights, !options.attributes.empty());
  check_targets(targets);
  check_masks(options.masks, targets);
  require(options.levels >= 1 && options.levels <= k_most_levels, "levels (loss)", options.levels, "1 to 16");
  if (!options.has_alpha.empty() && options.has_alpha.size() != targets.size()) {
    throw InvalidArgument("has_alpha (loss)", std::to_string(options.has_alpha.size()) + " values",
                          "one for each of the " + std::to_string(targets.size()) + " targets, or none");
  }
  if (options.weights.ssim > 0) check_windows(options, targets[0]);
  for (const AttributeTarget& target : options.attributes) check_attribute_target(target, targets);
}

void require_mask(const Image& mask, const Image& image, const std::string& name) {
  if (mask.width != image.width || mask.height != image.height) {
    throw InvalidArgument("size of the " + name, checks::size(mask.width, mask.height),
                          checks::size(image.width, image.height) + ", the image's");
  }
  checks::require_weights(mask, name, std::numeric_limits<float>::max(), "a finite number, at least 0");
}

std::span<const ImageLossRow> image_losses() { return k_losses; }

std::string_view to_string(LossKind kind) { return k_losses[static_cast<std::size_t>(kind)].name; }

std::vector<std::string_view> loss_names() {
  std::vector<std::string_view> names;
  for (const ImageLossRow& loss : k_losses) names.push_back(loss.name);
  return names;
}

LossKind parse_loss(std::string_view word, std::string_view where) {
  return static_cast<LossKind>(position_of(word, loss_names(), std::string(where)));
}

LossWeights LossWeights::only(LossKind kind) {
  LossWeights weights;
  weights.*k_losses[static_cast<std::size_t>(kind)].weight = 1;
  return weights;
}

ImageLoss::Impl::Impl(const Device& device_, const LossOptions& options, std::span<const Image> targets)
    : device(device_),
      width(targets[0].width),
      height(targets[0].height),
      views(targets.size()),
      views_of_mean(targets.size()),
      per_view(targets.size()),
      inverse_scale_squared(1 / (options.weights.robust_scale * options.weights.robust_scale)),
      launch(impl_of(device)),
      reduce(impl_of(device)) {
  for (std::size_t view = 0; view < views; ++view) {
    const bool shows_alpha = options.has_alpha.empty() || options.has_alpha[view] != 0;
    for (const ImageLossRow& loss : k_losses)
      view_weights.push_back(loss.reads_alpha && !shows_alpha ? 0 : options.weights.*loss.weight);
    for (std::size_t loss = 0; loss < k_losses.size(); ++loss)
      used |= weight(view, loss) != 0 ? 1U << loss : 0U;
  }
  device_weights.upload(impl_of(device), view_weights);
  if (options.weights.ssim > 0) {
    ssim.emplace(impl_of(device));
    ssim_weight = options.weights.ssim / static_cast<float>(options.levels);
    set_views_of_mean(views);
  }
  levels.push_back(make_level(targets, options.masks));
  std::vector<Image> smaller, masks;
  for (unsigned l = 1; l < options.levels; ++l) {
    smaller = dpr::shrink(l == 1 ? targets : smaller);
    masks = dpr::shrink(l == 1 ? options.masks : masks);
    levels.push_back(make_level(smaller, masks));
    levels[l].image.resize(impl_of(device), levels[l].pixels_per_view() * views);
  }
  for (const AttributeTarget& target : options.attributes)
    attributes.emplace_back(device, target, options.levels);
}

std::size_t ImageLoss::Impl::sums_before(std::size_t loss) const {
  std::size_t sums = 0;
  for (std::size_t before = 0; before < loss; ++before) sums += is_used(before) ? k_losses[before].sums : 0;
  return sums;
}

void ImageLoss::Impl::set_views_of_mean(std::size_t count) {
  views_of_mean = count;
  for (AttributeLoss& attribute : attributes) attribute.set_views_of_mean(count);
  if (ssim)
    ssim_weights.upload(impl_of(device), std::vector(views, ssim_weight / static_cast<float>(views_of_mean)));
}

ImageLoss::Impl::Level ImageLoss::Impl::make_level(std::span<const Image> targets,
                                                   std::span<const Image> masks) {
  constexpr float k_channels = 3;
  Level level;
  level.width = targets[0].width;
  level.height = targets[0].height;
  const std::size_t size = level.pixels_per_view(), pixels = views * size;
  Device::Impl& d = impl_of(device);
  level.target.upload(d, rgba_of(targets, pixels));
  const std::vector<float> weights = weights_of(masks, pixels);
  level.mask.upload(d, weights);
  if (ssim) {
    const std::vector<Image> whole(masks.empty() ? views : 0, Image(level.width, level.height, glm::vec4(1)));
    level.windows.upload(d, ssim_windows(masks.empty() ? whole : masks));
  }
  std::vector<cl_uint> starts{0};
  for (std::size_t view = 0; view < views; ++view) {
    const auto its = std::span(weights).subspan(view * size, size);
    level.channels.push_back(k_channels * static_cast<float>(std::accumulate(its.begin(), its.end(), 0.0)));
    starts.push_back(static_cast<cl_uint>((view + 1) * size));
  }
  level.device_channels.upload(d, level.channels);
  level.view_starts.upload(d, starts);
  level.per_pixel.resize(d, sums_before(k_losses.size()) * pixels);
  level.grad_image.resize(d, pixels);
  return level;
}

ImageLoss::ImageLoss(const Device& device, const LossOptions& options, std::span<const Image> targets) {
  check_loss(options, targets);
  impl_ = std::make_unique<Impl>(device, options, targets);
}

ImageLoss::ImageLoss(const Device& device, LossWeights weights, std::span<const Image> targets,
                     std::span<const unsigned char> has_alpha)
    : ImageLoss(device, LossOptions{.weights = weights, .has_alpha = has_alpha}, targets) {}

ImageLoss::~ImageLoss() = default;
ImageLoss::ImageLoss(ImageLoss&&) noexcept = default;
ImageLoss& ImageLoss::operator=(ImageLoss&&) noexcept = default;

double ImageLoss::evaluate(const Renderer& renderer) {
  Impl& m = *impl_;
  require_same_device(m.device, renderer.device(), "ImageLoss::evaluate");
  const Frame frame = last_frame(renderer, "ImageLoss::evaluate");
  m.evaluate(frame);
  for (AttributeLoss& attribute : m.attributes) {
    const std::span<const double> values = attribute.evaluate(renderer);
    for (std::size_t view = 0; view < m.views; ++view) m.per_view[view] += values[view];
  }
  return m.finish(frame.number);
}

double ImageLoss::evaluate(const SceneBatch& batch) {
  Impl& m = *impl_;
  require_same_device(m.device, batch.device(), "ImageLoss::evaluate");
  if (!m.attributes.empty()) {
    throw InvalidArgument("attributes (ImageLoss::evaluate)", std::to_string(m.attributes.size()),
                          "none for a SceneBatch: they need a Renderer");
  }
  impl_of(batch).require_forward("ImageLoss::evaluate");
  const FrameImages images = impl_of(batch).images();
  m.evaluate(images);
  return m.finish(images.number);
}

void ImageLoss::Impl::evaluate(const FrameImages& images) {
  if (images.views != views) {
    throw InvalidArgument("targets (loss)", std::to_string(views) + " images",
                          "one for each of the " + std::to_string(images.views) + " views");
  }
  if (images.width != width || images.height != height) {
    throw InvalidArgument("target size (loss)", checks::size(width, height),
                          "the size of the render, " + checks::size(images.width, images.height));
  }
  frame_number = 0;  // until everything of this one is there
  evaluate(images.image);
}

double ImageLoss::Impl::finish(std::uint64_t number) {
  double total = 0;
  for (const double value : per_view) total += value / static_cast<double>(views);
  if (!std::isfinite(total)) {
    throw InvalidArgument("images and targets (ImageLoss::evaluate)", "a loss of " + checks::text(total),
                          "smaller numbers, whose squares and sums single precision holds");
  }
  frame_number = number;
  return total;
}

void ImageLoss::Impl::evaluate(const Buffer<cl_float4>& full) {
  for (std::size_t l = 0; l < levels.size(); ++l) {
    Level& level = levels[l];
    const std::size_t pixels = level.pixels_per_view() * views;
    if (l > 0) {
      const Level& before = levels[l - 1];
      launch(pixels, kernel::image_loss_shrink{.width = static_cast<cl_uint>(before.width),
                                               .height = static_cast<cl_uint>(before.height),
                                               .pixels = static_cast<cl_uint>(pixels),
                                               .large = l == 1 ? full : before.image,
                                               .small = level.image});
    }
    if (used == 0) {  // attributes alone
      level.grad_image.fill(cl_float4{});
      continue;
    }
    const Buffer<cl_float4>& image = l == 0 ? full : level.image;
    const std::size_t run = pixel_run(impl_of(device)), runs = (pixels + run - 1) / run;
    launch(runs, kernel::image_loss_forward{.pixels = static_cast<cl_uint>(pixels),
                                            .used = used,
                                            .inverse_scale_squared = inverse_scale_squared,
                                            .image = image,
                                            .target = level.target,
                                            .mask = level.mask,
                                            .channels = level.per_pixel});
    if (ssim)
      ssim->forward(windowed(level, image), sums_before(shared::ssim_number) * pixels, level.per_pixel);
    reduce({pixels, sums_before(k_losses.size()), views, 1, level.view_starts, level.per_pixel}, level.sums);
    launch(runs, kernel::image_loss_backward{.views = static_cast<cl_uint>(views),
                                             .pixels_per_view = static_cast<cl_uint>(level.pixels_per_view()),
                                             .images = static_cast<cl_uint>(views_of_mean * levels.size()),
                                             .used = used,
                                             .inverse_scale_squared = inverse_scale_squared,
                                             .image = image,
                                             .target = level.target,
                                             .mask = level.mask,
                                             .sums = level.sums,
                                             .weights = device_weights,
                                             .channels = level.device_channels,
                                             .grad_image = level.grad_image});
    if (ssim) ssim->backward(windowed(level, image), ssim_weights, level.grad_image);
  }
  for (std::size_t l = levels.size() - 1; l > 0; --l) {
    Level& large = levels[l - 1];
    const std::size_t pixels = large.pixels_per_view() * views;
    launch(pixels, kernel::image_loss_shrink_backward{.width = static_cast<cl_uint>(large.width),
                                                      .height = static_cast<cl_uint>(large.height),
                                                      .pixels = static_cast<cl_uint>(pixels),
                                                      .grad_small = levels[l].grad_image,
                                                      .grad_large = large.grad_image});
  }
  std::ranges::fill(per_view, 0.0);
  for (const Level& level : levels) add_values(level);
}

void ImageLoss::Impl::add_attribute_gradients(SceneGradient& gradient) {
  for (AttributeLoss& attribute : attributes) add(gradient, attribute.backward());
}

void ImageLoss::Impl::add_values(const Level& level) {
  const std::vector<float> sums = level.sums.download();
  for (std::size_t view = 0; view < views; ++view) {
    std::vector<double> of_view;
    for (std::size_t place = view; place < sums.size(); place += views)
      of_view.push_back(static_cast<double>(sums[place]));
    for (std::size_t l = 0; l < k_losses.size(); ++l) {
      if (!is_used(l)) continue;
      per_view[view] += k_losses[l].value(static_cast<double>(weight(view, l)), &of_view[sums_before(l)],
                                          static_cast<double>(level.channels[view])) /
                        static_cast<double>(levels.size());
    }
  }
}

std::span<const double> ImageLoss::per_view() const { return impl_->per_view; }

}  // namespace dpr
