// Philox4x32-10, the counter-based generator of Salmon, Moraes, Dror & Shaw, "Parallel random numbers: as
// easy as 1, 2, 3" (SC 2011). Noise is a pure function of its counter and key: nothing is stored, and the
// backward pass draws the same numbers again.
#ifndef DPR_PHILOX_H
#define DPR_PHILOX_H

#define DPR_PHILOX_ROUNDS 10
#define DPR_COUNTER_WORDS 4 /* that a counter is worth */
#define DPR_PHILOX_M0 0xD2511F53UL
#define DPR_PHILOX_M1 0xCD9E8D57UL
#define DPR_PHILOX_W0 0x9E3779B9u /* golden ratio */
#define DPR_PHILOX_W1 0xBB67AE85u /* sqrt(3) - 1 */
#define DPR_LOW_WORD 0xffffffffUL

/// The four words of `counter`. Not all rounds are unrolled: the key of each would be kept in a register for
/// a whole launch.
static inline uint4 philox4x32_10(uint4 counter, uint2 key) {
  const uint2 factor = (uint2)((uint)DPR_PHILOX_M0, (uint)DPR_PHILOX_M1);
#pragma unroll 2
  for (int round = 0; round < DPR_PHILOX_ROUNDS; ++round) {
    const uint2 high = mul_hi(counter.xz, factor), low = counter.xz * factor;
    counter = (uint4)(high.y ^ counter.y ^ key.x, low.y, high.x ^ counter.w ^ key.y, low.x);
    key += (uint2)(DPR_PHILOX_W0, DPR_PHILOX_W1);
  }
  return counter;
}

/// The four words of `counter`, then those of the next: counter.z + 1. All four multiplications of a round
/// are one of vectors: words sit in the low halves of 64-bit lanes, what is left in the high halves does not
/// count.
static inline uint8 philox4x32_10_twice(uint4 counter, uint2 key) {
  const ulong4 factor = (ulong4)(DPR_PHILOX_M0, DPR_PHILOX_M1, DPR_PHILOX_M0, DPR_PHILOX_M1);
  ulong4 even = (ulong4)(counter.x, counter.z, counter.x, counter.z + 1); /* words 0, 2 of both counters */
  ulong4 odd = (ulong4)(counter.y, counter.w, counter.y, counter.w);      /* words 1, 3 */
#pragma unroll
  for (int round = 0; round < DPR_PHILOX_ROUNDS; ++round) {
    const ulong4 product = ((even & DPR_LOW_WORD) * factor).yxwz;
    even = (product >> 32) ^ odd ^ (ulong4)(key.x, key.y, key.x, key.y);
    odd = product;
    key += (uint2)(DPR_PHILOX_W0, DPR_PHILOX_W1);
  }
  return as_uint8((even & DPR_LOW_WORD) | odd << 32);
}

#endif
