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

/// Scalars inside: as vectors the words would travel between registers in every round.
static inline uint4 philox4x32_10(uint4 counter, uint2 key) {
  uint a = counter.x, b = counter.y, c = counter.z, d = counter.w, k0 = key.x, k1 = key.y;
  for (int round = 0; round < DPR_PHILOX_ROUNDS; ++round) {
    const ulong first = (ulong)DPR_PHILOX_M0 * a, second = (ulong)DPR_PHILOX_M1 * c;
    a = (uint)(second >> 32) ^ b ^ k0;
    b = (uint)second;
    c = (uint)(first >> 32) ^ d ^ k1;
    d = (uint)first;
    k0 += DPR_PHILOX_W0;
    k1 += DPR_PHILOX_W1;
  }
  return (uint4)(a, b, c, d);
}

#endif
