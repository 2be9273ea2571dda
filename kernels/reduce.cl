// Sums over segments, channel by channel. The order of additions is fixed, so the result is the same from run
// to run.
#include "compensated.h"
#include "tile_lanes.h"

DPR_COMPENSATED_ADD(compensated_add, realn)

/// The elements from k on, zero where they are not in [held.x, held.y). The first held one is values[0].
static inline realn load_held(uint k, uint2 held, global const float* values) {
  if (k >= held.x && held.y - k >= DPR_WIDTH) return load_n(k - held.x, values);
  float lanes[DPR_WIDTH];
  for (uint lane = 0; lane < DPR_WIDTH; ++lane)
    lanes[lane] = k + lane >= held.x && k + lane < held.y ? values[k + lane - held.x] : 0.0f;
  return load_n(0, lanes);
}

/// Every slot sums its elements of its segment: on a GPU, where neighbours' loads go together, slot k those
/// at k, k + slots, k + 2 slots ...; a vector of slots those of a run of its own, which a CPU's caches
/// follow. One work-item per (channel, segment, vector of slots); `slots` is a multiple of the widest vector.
/// in   held     elements [x, y), which there are. Other launches add the others, in order
/// in   starts   uint[segment * stride + 1]  segment s is [starts[s * stride], starts[(s + 1) * stride])
/// in   values   float[channel][count], of so many `channels` from `first_channel` on, and `segments`; element
///               held.x lies at `shift`
/// in out  partial  float[channel][segment][2][slot]  sums, and their compensations
kernel void reduce_partial(const uint count, const uint2 held, const uint shift, const uint first_channel,
                           const uint channels, const uint segments, const uint stride, const uint slots,
                           global const uint* restrict starts, global const float* restrict values,
                           global float* restrict partial) {
  const uint i = (uint)get_global_id(0);
  const uint vectors = slots / DPR_WIDTH;
  if (i >= channels * segments * vectors) return;
  const uint slot = i % vectors * DPR_WIDTH, segment = i / vectors % segments,
             channel = i / vectors / segments;
  const uint begin = starts[segment * stride], end = starts[(segment + 1) * stride];
#if DPR_WIDTH == 1
  const uint first = begin + slot, last = end, step = slots;
#else
  const uint run = (end - begin + slots - 1) / slots;  // vectors
  const uint first = begin + slot * run, last = min(end, first + DPR_WIDTH * run), step = DPR_WIDTH;
#endif
  global const float* of_channel = values + (size_t)(first_channel + channel) * count + shift;
  global float* out = partial + (size_t)2 * slots * (channel * segments + segment) + slot;
  realn sum = 0.0f, error = 0.0f;
  if (held.x > begin) {
    sum = load_n(0, out);
    error = load_n(slots, out);
  }
  const uint2 own = (uint2)(held.x, min(last, held.y));
  const uint before = first < held.x ? (held.x - first) / step * step : 0;
  for (uint k = first + before; k < own.y; k += step)
    compensated_add(&sum, &error, load_held(k, own, of_channel));
  store_n(sum, 0, out);
  store_n(error, slots, out);
}

/// Sums the slots in order. One work-item per (channel, segment), `count` in all.
/// in   partial  as reduce_partial left them, with its `slots`
/// out  sums     float[channel][segment], from `first` on
kernel void reduce_final(const uint count, const uint slots, const uint first,
                         global const float* restrict partial, global float* restrict sums) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  global const float* slot_sums = partial + (size_t)2 * slots * i;
  float sum = 0.0f, error = 0.0f;
  for (uint slot = 0; slot < slots; ++slot) {
    const float x = slot_sums[slot], t = sum + x;
    error += (fabs(sum) >= fabs(x) ? (sum - t) + x : (x - t) + sum) + slot_sums[slots + slot];
    sum = t;
  }
  sums[first + i] = sum + error;
}
