// Vectors to and from buffers whose layout is the caller's, and the numbers of a gradient from the sums of
// its channels: what lets a program keep everything on the device.
#include "shared_types.h"

/// Copies vectors of floats from one layout to another. A layout is the first float, the floats from one
/// group to the next, the vectors of a group, which follow one another, and the floats of a vector. One
/// work-item per vector. What the source has not is 0. in   vectors   how many there are in   from, to  uint4
/// the layouts in   clean     1: numbers that are not finite become 0 in   source    float[...] out  target
/// float[...]
kernel void exchange_vectors(const uint vectors, const uint4 from, const uint4 to, const uint clean,
                             global const float* restrict source, global float* restrict target) {
  const uint i = (uint)get_global_id(0);
  if (i >= vectors) return;
  global const float* in = source + from.x + (size_t)(i / from.z) * from.y + i % from.z * from.w;
  global float* out = target + to.x + (size_t)(i / to.z) * to.y + i % to.z * to.w;
  for (uint k = 0; k < to.w; ++k) {
    const float value = k < from.w ? in[k] : 0.0f;
    out[k] = clean && !isfinite(value) ? 0.0f : value;
  }
}

/// Numbers that are sums of factors times sums. One work-item per number of `numbers`. Products and additions
/// carry their errors along (Dekker 1971, Knuth 1969), so that the result is rounded once.
/// in   starts   uint[number + 1]  runs of `terms`
/// in   terms    uint[...]         indices of `sums`
/// in   factors  float[...]        of the terms
/// in   sums     float[...]
/// out  values   float[number]
kernel void exchange_map(const uint numbers, global const uint* restrict starts,
                         global const uint* restrict terms, global const float* restrict factors,
                         global const float* restrict sums, global float* restrict values) {
  const uint i = (uint)get_global_id(0);
  if (i >= numbers) return;
  float sum = 0.0f, error = 0.0f;
  for (uint k = starts[i]; k < starts[i + 1]; ++k) {
    const float a = factors[k], b = sums[terms[k]], product = a * b;
    const float total = sum + product, part = total - sum;
    error += fma(a, b, -product) + ((sum - (total - part)) + (product - part));
    sum = total;
  }
  values[i] = sum + error;
}
