// Mean absolute error over pixels and colour channels, eq. (76). image_losses.h says what each function is
// for.
#ifndef DPR_LOSS_L1_H
#define DPR_LOSS_L1_H

enum { l1_sums = 1, l1_reads_alpha = 0 };

#ifdef __OPENCL_C_VERSION__

static inline void l1_add(const LossPixel p, float* sums) {
  const float3 difference = p.image.xyz - p.target.xyz;
  sums[0] = fabs(difference.x) + fabs(difference.y) + fabs(difference.z);
}

static inline float4 l1_gradient(float weight, const LossPixel p, const float* sums) {
  (void)sums;
  const float3 difference = p.image.xyz - p.target.xyz;
  return (float4)(weight * sign(difference.x), weight * sign(difference.y), weight * sign(difference.z),
                  0.0f);
}

#else

inline double l1_value(double weight, const double* sums, double channels) {
  return weight * sums[0] / channels;
}

#endif
#endif
