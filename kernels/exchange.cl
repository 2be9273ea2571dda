// Vectors to and from buffers whose layout is the caller's, and the numbers of a gradient from the sums of
// its channels: what lets a program keep everything on the device.
#include "shared_types.h"

/// Copies vectors of floats, bit by bit, from one layout to another. A layout is the first float, the floats
/// from one group to the next, the vectors of a group, which follow one another, and the floats of a vector.
/// One work-item per vector. What the source has not is 0.
/// in   vectors   how many there are
/// in   from, to  uint4  the layouts
/// in   clean     1: numbers that are not finite become 0
/// in   source    float[...]
/// out  target    float[...]
kernel void exchange_vectors(const uint vectors, const uint4 from, const uint4 to, const uint clean,
                             global const uint* restrict source, global uint* restrict target) {
  const uint i = (uint)get_global_id(0);
  if (i >= vectors) return;
  global const uint* in = source + from.x + (size_t)(i / from.z) * from.y + i % from.z * from.w;
  global uint* out = target + to.x + (size_t)(i / to.z) * to.y + i % to.z * to.w;
  for (uint k = 0; k < to.w; ++k) {
    const uint bits = k < from.w ? in[k] : 0;
    out[k] = clean && !isfinite(as_float(bits)) ? 0 : bits;
  }
}

/// Vectors of one to four floats to rows of four, 0 behind them; and back. One work-item per vector: what exchange_vectors
/// does for such layouts, several times as fast on CPUs.
/// in   count     vectors
/// in   first     the first row
/// in   layout    uint4  of `packed`, as exchange_vectors has it, whose groups are one vector
/// in   clean     1: numbers that are not finite become 0
/// in   packed    float[...], as integers
/// out  rows      float4[first + count], as integers
kernel void exchange_unpack(const uint count, const uint first, const uint4 layout, const uint clean,
                            global const uint* restrict packed, global uint4* restrict rows) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  global const uint* in = packed + layout.x + (size_t)i * layout.y;
  const uint4 row = (uint4)(in[0], layout.w > 1 ? in[1] : 0, layout.w > 2 ? in[2] : 0, layout.w > 3 ? in[3] : 0);
  rows[first + i] = clean ? select(row, (uint4)(0), (row & 0x7f800000) == 0x7f800000) : row;
}

kernel void exchange_pack(const uint count, const uint first, const uint4 layout,
                          global const uint4* restrict rows, global uint* restrict packed) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  global uint* out = packed + layout.x + (size_t)i * layout.y;
  const uint4 row = rows[first + i];
  out[0] = row.x;
  if (layout.w > 1) out[1] = row.y;
  if (layout.w > 2) out[2] = row.z;
  if (layout.w > 3) out[3] = row.w;
}

static inline float4 finite_row(global const float* row) {
  return (float4)(isfinite(row[0]) ? row[0] : 0.0f, isfinite(row[1]) ? row[1] : 0.0f,
                  isfinite(row[2]) ? row[2] : 0.0f, isfinite(row[3]) ? row[3] : 0.0f);
}

/// Cameras' places and directions from world-to-camera matrices. One work-item per view.
/// in   count         views
/// in   from          uint4         the layout, as exchange_vectors has it, of rows of four floats
/// in   orthographic  whether the views are
/// in   source        float[...]    numbers that are not finite count as 0
/// out  views         ViewParams[view]  of which row and eye are written
kernel void exchange_cameras(const uint count, const uint4 from, const uint orthographic,
                             global const float* restrict source, global ViewParams* restrict views) {
  const uint i = (uint)get_global_id(0);
  if (i >= count) return;
  global const float* in = source + from.x + (size_t)i * from.y;
  const float4 x = finite_row(in), y = finite_row(in + 4), z = finite_row(in + 8);
  // Columns of the inverse, times the determinant.
  const float3 first = cross(y.xyz, z.xyz), second = cross(z.xyz, x.xyz), third = cross(x.xyz, y.xyz);
  const float inverse = 1.0f / dot(x.xyz, first);
  const float3 eye = orthographic ? third : -(x.w * first + y.w * second + z.w * third);
  views[i].row[0] = x;
  views[i].row[1] = y;
  views[i].row[2] = z;
  views[i].eye = (float4)(eye * inverse, orthographic ? 0.0f : 1.0f);
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
#pragma OPENCL FP_CONTRACT OFF
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
