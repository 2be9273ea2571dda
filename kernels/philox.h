// Philox4x32-10, the counter-based generator of Salmon, Moraes, Dror & Shaw, "Parallel random numbers: as easy as
// 1, 2, 3" (SC 2011). Noise is a pure function of its counter and key: nothing is stored, and the backward pass draws
// the same numbers again.
#ifndef DPR_PHILOX_H
#define DPR_PHILOX_H

#define DPR_PHILOX_ROUNDS 10
#define DPR_PHILOX_M0 0xD2511F53u
#define DPR_PHILOX_M1 0xCD9E8D57u
#define DPR_PHILOX_W0 0x9E3779B9u /* golden ratio */
#define DPR_PHILOX_W1 0xBB67AE85u /* sqrt(3) - 1 */

/// Which decision the noise is for: the last word of the counter, beside the view.
#define DPR_STAGE_OCCUPANCY 0u
#define DPR_STAGE_AGGREGATE 1u

static inline uint4 philox4x32_10(uint4 counter, uint2 key) {
  for (int round = 0; round < DPR_PHILOX_ROUNDS; ++round) {
    const uint high0 = mul_hi(DPR_PHILOX_M0, counter.x), low0 = DPR_PHILOX_M0 * counter.x;
    const uint high1 = mul_hi(DPR_PHILOX_M1, counter.z), low1 = DPR_PHILOX_M1 * counter.z;
    counter = (uint4)(high1 ^ counter.y ^ key.x, low1, high0 ^ counter.w ^ key.y, low0);
    key += (uint2)(DPR_PHILOX_W0, DPR_PHILOX_W1);
  }
  return counter;
}

#endif
