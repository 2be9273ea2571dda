// Losses between rendered and target images, evaluated on the device.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "dpr/attribute_images.hpp"
#include "dpr/device.hpp"
#include "dpr/export.h"
#include "dpr/image.hpp"

namespace dpr {

class Renderer;
class SceneBatch;

/// mse, l1: means over pixels and the three colour channels. silhouette: 1 - IoU of the alpha channel, eq.
/// (75). robust: mse in which pixels of quite another colour hardly count: the mean of s / (1 + s / c^2),
/// with s a pixel's squared colour difference and c the robust_scale (Geman & McClure 1985). ssim: 1 - the
/// mean structural similarity (Wang et al. 2004) over colour channels, of colours from 0 to 1, and over
/// windows of 11x11 pixels that lie in the image whole, weighed by a Gaussian of standard deviation 1.5.
enum class LossKind { mse, l1, silhouette, robust, ssim };

DPR_API std::string_view to_string(LossKind);
/// In the order of LossKind.
DPR_API std::vector<std::string_view> loss_names();
DPR_API LossKind parse_loss(std::string_view word, std::string_view where);

/// Weight of each loss in the total, eq. (74).
struct DPR_API LossWeights {
  float mse = 0, l1 = 0, silhouette = 0, robust = 0, ssim = 0;
  float robust_scale = 0.1F;  ///< at least 1e-6, a colour difference

  static LossWeights only(LossKind kind);
};

/// An attribute of the surfaces, compared with a target. A pixel's difference is
/// sum_j w_j (a_j - target), of the weights w_j that blend its colour: RGB - A target of AttributeImages. It
/// counts surfaces that are seen in part as such, and the background not at all, so that it says nothing of
/// where a silhouette should be: a loss of the images beside it does.
struct AttributeTarget {
  Attribute attribute = Attribute::depth;
  LossWeights weights = {};  ///< of those differences from 0; no silhouette, no ssim
  /// One image a view, of the images' size: RGB as attribute images have it where a surface fills the pixel,
  /// alpha how much the pixel counts, at least 0 and not all 0: what aov_image() makes.
  std::span<const Image> targets = {};
};

/// Options of an ImageLoss.
struct LossOptions {
  LossWeights weights = {};
  /// One value a target, or empty for all: where it is 0 a target has no silhouette, and its view no
  /// silhouette loss.
  std::span<const unsigned char> has_alpha = {};
  /// Weight of every pixel, in the first channel, at least 0: one image a target, of its size, or none.
  /// Means are over the weights, which are not all 0 in any. A window of ssim counts as the pixel at its
  /// middle does.
  std::span<const Image> masks = {};
  /// Levels of a pyramid, 1 to 16: the loss is the mean over the images and ever smaller ones, each the means
  /// of blocks of 2x2 pixels of the one before. Large differences of place get gradients from the small ones.
  /// With ssim the smallest has to hold a window.
  unsigned levels = 1;
  /// Added to the loss of the images, whose weights may then all be 0. Each costs a forward and a backward
  /// pass more.
  std::span<const AttributeTarget> attributes = {};
};

/// Weighted sum of losses against fixed targets, mean over the views.
class DPR_API ImageLoss {
 public:
  /// One target a view, all of the same size. Throws InvalidArgument for sizes that differ, values that are
  /// not finite, negative weights or none above zero.
  ImageLoss(const Device& device, const LossOptions& options, std::span<const Image> targets);
  ImageLoss(const Device& device, LossWeights weights, std::span<const Image> targets,
            std::span<const unsigned char> has_alpha = {});
  ~ImageLoss();
  ImageLoss(ImageLoss&&) noexcept;
  ImageLoss& operator=(ImageLoss&&) noexcept;

  /// The loss of the renderer's last images; keeps d loss / d image on the device for Renderer::backward.
  /// Blocks. Throws InvalidArgument for images of another number or size, for a renderer of another Device,
  /// and for losses on attributes where the renderer's positions or transforms came from a buffer.
  double evaluate(const Renderer& renderer);
  /// The same of a batch's last images, all scenes' one after the other, for SceneBatch::backward; without
  /// losses on attributes.
  double evaluate(const SceneBatch& batch);
  /// The same for every view of the last evaluate(): the total is their mean.
  std::span<const double> per_view() const;

  struct DPR_LOCAL Impl;

 private:
  friend struct Internals;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dpr
