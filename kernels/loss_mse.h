// Mean squared error over pixels and colour channels, eq. (19). image_losses.h says what each function is
// for.
#ifndef DPR_LOSS_MSE_H
#define DPR_LOSS_MSE_H

enum { mse_sums = 1, mse_reads_alpha = 0 };

#ifdef __OPENCL_C_VERSION__

static inline void mse_add(const LossPixel p, float* sums) {
  const float3 difference = p.image.xyz - p.target.xyz;
  sums[0] = dot(difference, difference);
}

static inline float4 mse_gradient(float weight, const LossPixel p, const float* sums) {
  (void)sums;
  return (float4)(2.0f * weight * (p.image.xyz - p.target.xyz), 0.0f);
}

#else

inline double mse_value(double weight, const double* sums, double channels) {
  return weight * sums[0] / channels;
}

#endif
#endif
