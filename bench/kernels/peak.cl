// Peaks of a device: independent multiply-adds, and a stream through memory.
#include "lanes.h"

/// Independent chains of a work-item: enough to hide the latency of a multiply-add, few enough to stay in registers.
#ifndef DPR_CHAINS
#define DPR_CHAINS 10
#endif

/// Every lane of every chain does `rounds` multiply-adds: 2 * rounds * DPR_CHAINS * DPR_WIDTH operations a work-item.
/// in   factor  float          below 1: the numbers stay normal
/// out  result  float[item]    so that nothing is optimised away
kernel void peak_fma(const uint rounds, const float factor, global float* restrict result) {
  const uint i = (uint)get_global_id(0);
  const realn scale = factor, offset = 1.0f - factor;
  realn chain[DPR_CHAINS];
  for (uint k = 0; k < DPR_CHAINS; ++k) chain[k] = (float)(i + k);
  for (uint round = 0; round < rounds; ++round) {
#pragma unroll
    for (uint k = 0; k < DPR_CHAINS; ++k) chain[k] = fma(chain[k], scale, offset);
  }
  realn sum = 0.0f;
  for (uint k = 0; k < DPR_CHAINS; ++k) sum += chain[k];
  result[i] = sum_lanes(sum);
}

/// McCalpin's triad a = b + s c: 3 * sizeof(realn) bytes a work-item.
kernel void peak_triad(const float scale, global const float* restrict b, global const float* restrict c,
                       global float* restrict a) {
  const uint i = (uint)get_global_id(0) * DPR_WIDTH;
  store_n(load_n(i, b) + scale * load_n(i, c), i, a);
}
