// The weights with which noise of the pixel's position blurs a raster of rigid samples.
#pragma once

#include <vector>

#include "dpr/smoothing.hpp"

namespace dpr {

/// The blur along one axis; the other's is the same. A pixel is the mean, over the samples that it holds, of
/// the raster's expectation where the noise moves the sample to. All weights are symmetric about their
/// middle.
///
/// Up to a scale of some samples (Gaussian 4, logistic 8, Cauchy 14) `decimation` is 1 and `weights` lead
/// from samples to pixels. Above, the raster is projected to a coarse grid by quintic B-splines (`reduce`),
/// convolved there (`weights`), and expanded by the same splines (`expand`), so that the cost of a pixel does
/// not grow with the scale. The splines' own blur is divided out of the weights. The error of the kernel is
/// below 2e-4 of its peak. The uniform density has jumps, which splines cannot follow: it is convolved sample
/// by sample at every scale.
struct BlurKernel {
  int margin = 0;                                ///< samples that the raster needs on each side of the frame
  int supersampling = 1;                         ///< samples of a pixel along the axis
  int decimation = 1;                            ///< samples from one node of the coarse grid to the next
  std::vector<float> weights, weights_by_scale;  ///< and their derivative by the scale in pixels
  std::vector<float> reduce, expand;             ///< empty where there is no coarse grid
};

/// @param prior  its density, or rather the product of its densities along the two axes, is that of the
///               noise. Densities end at the prior's pixel_reach and are scaled to an integral of 1. On the
///               raster they keep their variance, however small the scale: at 0 the raster is left as it is.
/// @param scale  of the noise in pixels
/// @param supersampling  1, 2 or 4
/// Throws InvalidArgument, for the Gumbel prior too: it is not symmetric, so that it would shift the image.
BlurKernel blur_kernel(Prior prior, double scale, int supersampling);

/// By how many samples a draw of the noise shifts the raster along one axis: from -radius to radius, with the
/// probabilities that are the weights of the blur without a coarse grid.
struct ShiftTable {
  std::vector<float> cumulative;  ///< [2 radius + 1] that the shift is at most so much
  std::vector<float> scores;      ///< [2 radius + 1] d ln probability / d scale in pixels
  int radius() const { return static_cast<int>(cumulative.size() / 2); }
};

/// Arguments as blur_kernel() takes them; its margin is at least the radius.
ShiftTable shift_table(Prior prior, double scale, int supersampling);

}  // namespace dpr
