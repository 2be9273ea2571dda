// 1 - the mean structural similarity of windows and colour channels (Wang, Bovik, Sheikh, Simoncelli 2004).
// Windows are no pixels': ssim.cl writes the sum, and adds the gradient. image_losses.h says what each
// function is for.
#ifndef DPR_LOSS_SSIM_H
#define DPR_LOSS_SSIM_H

enum { ssim_sums = 1, ssim_reads_alpha = 0 };

/// Pixels from a window's middle to its border.
#define DPR_SSIM_RADIUS 5

/// Numbers of a window: the moments, and the derivatives by those of the image.
#define DPR_SSIM_MOMENTS 5
#define DPR_SSIM_GRADIENTS 3

#ifdef __OPENCL_C_VERSION__

static inline void ssim_add(const LossPixel p, float* sums) {
  (void)p;
  sums[0] = 0.0f;
}

static inline float4 ssim_gradient(float weight, const LossPixel p, const float* sums) {
  (void)weight;
  (void)p;
  (void)sums;
  return 0.0f;
}

#else

inline double ssim_value(double weight, const double* sums, double /*channels*/) {
  return weight * (1 - sums[0]);
}

#endif
#endif
