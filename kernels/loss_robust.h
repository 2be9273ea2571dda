// Mean over pixels and colour channels of s / (1 + s / c^2), s being a pixel's squared colour difference and
// c the scale (Geman & McClure 1985): pixels of quite another colour hardly count. image_losses.h says what
// each function is for.
#ifndef DPR_LOSS_ROBUST_H
#define DPR_LOSS_ROBUST_H

enum { robust_sums = 1, robust_reads_alpha = 0 };

#ifdef __OPENCL_C_VERSION__

static inline void robust_add(const LossPixel p, float* sums) {
  const float3 difference = p.image.xyz - p.target.xyz;
  const float squared = dot(difference, difference);
  sums[0] = squared / (1.0f + squared * p.inverse_scale_squared);
}

static inline float4 robust_gradient(float weight, const LossPixel p, const float* sums) {
  (void)sums;
  const float3 difference = p.image.xyz - p.target.xyz;
  const float slope = 1.0f / (1.0f + dot(difference, difference) * p.inverse_scale_squared);
  return (float4)(2.0f * weight * slope * slope * difference, 0.0f);
}

#else

inline double robust_value(double weight, const double* sums, double channels) {
  return weight * sums[0] / channels;
}

#endif
#endif
