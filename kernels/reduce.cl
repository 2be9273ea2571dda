// Sums over segments, channel by channel, with Neumaier's compensation: sensitivities cancel heavily, and a plain sum
// would lose what is left. The order of additions is fixed, so the result is the same from run to run.

/// Partial sums of a segment.
#ifndef DPR_REDUCE_SLOTS
#define DPR_REDUCE_SLOTS 64
#endif

/// Adds x to the sum s.x with running error s.y (Neumaier 1974).
static inline float2 compensated_add(float2 s, float x) {
  const float t = s.x + x;
  const float error = fabs(s.x) >= fabs(x) ? (s.x - t) + x : (x - t) + s.x;
  return (float2)(t, s.y + error);
}

/// Slot k sums the elements k, k + slots, k + 2 slots ... of its segment. One work-item per (channel, segment, slot).
/// in   starts   uint[segment * stride + 1]  segment s is [starts[s * stride], starts[(s + 1) * stride])
/// in   values   float[channel][count]
/// out  partial  float2[channel][segment][slot]  sum and compensation
kernel void reduce_partial(const uint count, const uint channels, const uint segments, const uint stride,
                           global const uint* restrict starts, global const float* restrict values,
                           global float2* restrict partial) {
  const uint i = (uint)get_global_id(0);
  if (i >= channels * segments * DPR_REDUCE_SLOTS) return;
  const uint slot = i % DPR_REDUCE_SLOTS, segment = i / DPR_REDUCE_SLOTS % segments;
  const uint channel = i / DPR_REDUCE_SLOTS / segments;
  const uint last = starts[(segment + 1) * stride];
  float2 sum = (float2)(0.0f, 0.0f);
  for (uint k = starts[segment * stride] + slot; k < last; k += DPR_REDUCE_SLOTS) {
    sum = compensated_add(sum, values[channel * count + k]);
  }
  partial[i] = sum;
}

/// Sums the slots in order. One work-item per (channel, segment).
/// out  sums  float[channel][segment]
kernel void reduce_final(const uint channels, const uint segments, global const float2* restrict partial,
                         global float* restrict sums) {
  const uint i = (uint)get_global_id(0);
  if (i >= channels * segments) return;
  float2 sum = (float2)(0.0f, 0.0f);
  for (uint slot = 0; slot < DPR_REDUCE_SLOTS; ++slot) {
    const float2 part = partial[i * DPR_REDUCE_SLOTS + slot];
    sum = compensated_add(sum, part.x);
    sum.y += part.y;
  }
  sums[i] = sum.x + sum.y;
}
