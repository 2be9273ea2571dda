// 1 - IoU of the alpha channels, eq. (75): intersection a b and union a + b - a b, each summed over the
// pixels. Where both images are empty they agree: no loss, no gradient. image_losses.h says what each
// function is for.
#ifndef DPR_LOSS_SILHOUETTE_H
#define DPR_LOSS_SILHOUETTE_H

enum { silhouette_sums = 2, silhouette_reads_alpha = 1 };

#ifdef __OPENCL_C_VERSION__

static inline void silhouette_add(const LossPixel p, float* sums) {
  const float a = p.image.w, b = p.target.w;
  sums[0] = a * b;
  sums[1] = a + b - a * b;
}

static inline float4 silhouette_gradient(float weight, const LossPixel p, const float* sums) {
  const float intersection = sums[0], united = sums[1];
  const float b = p.target.w;
  const float iou = united > 0.0f ? intersection / united : 1.0f;
  return (float4)(0.0f, 0.0f, 0.0f, united > 0.0f ? -weight * (b - iou * (1.0f - b)) / united : 0.0f);
}

#else

inline double silhouette_value(double weight, const double* sums, double /*channels*/) {
  const double iou = sums[1] <= 0 ? 1.0 : sums[0] / sums[1];  // NaN stays NaN
  return weight * (1 - iou);
}

#endif
#endif
