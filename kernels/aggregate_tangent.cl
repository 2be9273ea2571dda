// The second half of forward mode's aggregation, of every composition: from the tangents of fragments to those of the
// image, by the rows that the first half leaves. Fragment by fragment first, where memory is read in order, then
// pixel by pixel, which reads all over it, but one number for all directions.
#include "tile_lanes.h"

/// Stores RGBA, a lane after the other, `step` apart.
static inline void store_lanes(realn red, realn green, realn blue, realn alpha, size_t step,
                               global float4* to) {
#if DPR_WIDTH == 1
  (void)step;
  *to = (float4)(red, green, blue, alpha);
#else
  float lanes[4][DPR_WIDTH];
  store_n(red, 0, lanes[0]);
  store_n(green, 0, lanes[1]);
  store_n(blue, 0, lanes[2]);
  store_n(alpha, 0, lanes[3]);
#pragma unroll
  for (int i = 0; i < DPR_WIDTH; ++i)
    to[i * step] = (float4)(lanes[0][i], lanes[1][i], lanes[2][i], lanes[3][i]);
#endif
}

/// Shares of fragments in their pixels' tangents. Any number of work-items, by vector of fragments. Deterministic.
/// in   fragment_starts  uint[pair + 1]
/// in   rows      float[DPR_FRAGMENT_ROWS][fragment]  as aggregate_rows leaves them
/// in   tangents  float[direction][q.planes][fragment]  of DEPTH, LOG_OCCUPANCY, COLOR
/// out  shares    float4[fragment][direction]  RGBA
kernel void aggregate_share_tangent(const AggregateParams p, const TangentParams q, const uint last_pair,
                                    global const uint* restrict fragment_starts,
                                    global const float* restrict rows, global const float* restrict tangents,
                                    global float4* restrict shares) {
  const uint last = fragment_starts[last_pair], step = (uint)get_global_size(0) * DPR_WIDTH;
  const uint plane = p.grad_fragments;
  for (uint i = (uint)get_global_id(0) * DPR_WIDTH; i < last; i += step) {
    realn row[DPR_FRAGMENT_ROWS];
#pragma unroll
    for (uint r = 0; r < DPR_FRAGMENT_ROWS; ++r) row[r] = load_n(i, rows + r * plane);
    for (uint d = 0; d < q.directions; ++d) {
      global const float* const of = tangents + (size_t)d * q.planes * plane;
      const realn depth = load_n(i, of + DPR_GRAD_PLANE(p, DEPTH)),
                  log_p = load_n(i, of + DPR_GRAD_PLANE(p, LOG_OCCUPANCY));
      realn share[3];
#pragma unroll
      for (uint c = 0; c < 3; ++c) {
        share[c] = row[DPR_ROW_WEIGHT] * load_n(i, of + DPR_GRAD_PLANE(p, COLOR) + c * plane) +
                   row[DPR_ROW_DEPTH + c] * depth + row[DPR_ROW_LOG_OCCUPANCY + c] * log_p;
      }
      store_lanes(share[0], share[1], share[2], row[DPR_ROW_COVERAGE] * log_p, q.directions,
                  shares + (size_t)i * q.directions + d);
    }
  }
}

/// Adds the shares of pixels' fragments to the image's tangents. One work-item per pixel. Deterministic.
/// in      starts, list    as aggregate_forward has them
/// in      shares          float4[fragment][direction]
/// in out  image_tangents  float4[direction][pixel]  from q.first on
kernel void aggregate_sum_tangent(const AggregateParams p, const TangentParams q,
                                  global const uint* restrict starts, global const uint* restrict list,
                                  global const float4* restrict shares,
                                  global float4* restrict image_tangents) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= p.last_pixel) return;
  for (uint d = 0; d < q.directions; ++d) {
    float4 sum = 0.0f;
    for (uint i = starts[pixel]; i < starts[pixel + 1]; ++i)
      sum += shares[(size_t)list[i] * q.directions + d];
    image_tangents[(size_t)(q.first + d) * p.pixels + pixel] += sum;
  }
}
