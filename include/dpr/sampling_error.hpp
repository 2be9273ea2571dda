// Error of Monte Carlo: standard errors of images and gradients, and how many samples a wanted one
// takes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dpr/export.h"
#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/renderer.hpp"

namespace dpr {

/// Standard errors of a single frame at the renderer's number of samples: standard deviations over
/// independent replicates, which hold for whatever draws and control variates there are. All 0 for exact
/// estimators. Estimates themselves, each known to a part 1 / sqrt(2 (replicates - 1)).
struct DPR_API SamplingError {
  unsigned replicates = 0;
  std::uint32_t samples = 0;  ///< of the estimator they were measured at
  std::vector<Image> images;  ///< [view] RGBA, each channel's own
  /// [view][height * width] of the gradient where it arises: the root of the summed variances, over the
  /// pixel's fragments, of gamma (zfar - znear) dL/dz and sigma dL/ds, by how much the loss changes when
  /// depth or distance moves by one scale of its noise. Empty where the frame was
  /// rendered in bands of the memory budget: no fragment outlives its band; and with noise of the pixel,
  /// whose fragments are no pixel's.
  std::vector<std::vector<float>> pixel_gradients;
  SceneGradient gradient;  ///< of every number that the scene asks for

  /// Root mean square over all pixels, of the colour channels.
  double image_rms() const;
};

/// From `replicates` >= 2 frames of the renderer's scene and views, with the seeds seed, seed + 1, ...; the
/// last forward() is then that of the renderer's own seed. The gradients are those of <grad_images, image>.
/// Costs as many forward and backward passes. Throws InvalidArgument for fewer replicates, and what
/// Renderer::backward throws.
DPR_API SamplingError estimate_sampling_error(Renderer& renderer, std::span<const Image> grad_images,
                                              unsigned replicates = 16);
/// The same for the gradients of a loss, evaluated on every replicate: what a descent on it meets.
DPR_API SamplingError estimate_sampling_error(Renderer& renderer, ImageLoss& loss, unsigned replicates = 16);

/// The samples that bring a standard error down to the wanted one: errors fall as 1 / sqrt(samples), so
/// samples (error / wanted)^2, rounded up, 1 to 2^20. Stratified draws fall at least as fast; the logarithm
/// of a sampled occupancy has a bias beside it that no replicate shows. Throws InvalidArgument for an error
/// below 0, a wanted one that is not above 0, and 0 samples.
DPR_API std::uint32_t suggest_samples(double error, std::uint32_t samples, double wanted);

}  // namespace dpr
