// Triangles on lanes of samples: what they cover of a tile, on which side of them samples lie, and the
// gradients of their corners. Shared by the kernels of whole triangles and of clipped ones.
#ifndef DPR_RASTERIZE_H
#define DPR_RASTERIZE_H

#include "geometry.h"

static inline ulong whole_mask(uint2 mask) { return (ulong)mask.y << 32 | mask.x; }

/// Lanes of truth as bits.
static inline uint lane_bits(intn condition) {
#if DPR_WIDTH == 1
  return condition ? 1u : 0u;
#else
  const uint8 bits = as_uint8(condition) & (uint8)(1, 2, 4, 8, 16, 32, 64, 128);
  const uint4 a = bits.lo | bits.hi;
  const uint2 b = a.lo | a.hi;
  return b.x | b.y;
#endif
}

/// Those of the given pixels of a row that a triangle owns; bit k is `first_column` + k.
static uint owned_of(uint bits, const FrameParams p, const Triangle t, uint first_column, uint row) {
  uint owned = 0;
  for (; bits != 0; bits &= bits - 1) {
    owned |= owns_sample(t, pixel_centre(p, first_column + lowest_bit(bits), row)) ? bits & -bits : 0u;
  }
  return owned;
}

/// Pixels of a tile (view * tiles + tile) that a triangle's blurred area covers: those it owns, and those
/// closer than the blur distance. Bit 8 * row + column.
static inline uint2 cover_tile(const FrameParams p, const Triangle t, uint view_tile) {
  const uint tile = view_tile % (p.tiles_x * p.tiles_y);
  const uint first_column = tile % p.tiles_x * DPR_TILE, first_row = tile / p.tiles_x * DPR_TILE;
  const float limit = is_sliver(t) ? 0.0f : p.blur_distance * p.blur_distance;
  const uint2 rows = samples_of_tile(rows_of(t), first_row / DPR_TILE) - first_row;
  const float error = side_error(p, t);
  ulong mask = 0;
  for (uint row = rows.x; row <= rows.y; ++row) {
    const realn y = pixel_y(p, (realn)((float)(first_row + row)));
    for (uint part = 0; part < DPR_TILE; part += DPR_WIDTH) {
      const intn column = (int)(first_column + part) + DPR_LANE_INDEX;
      const View3 v = view_triangle(t, pixel_x(p, convert_realn(column)), y);
      const realn side = least_side(v, t.orientation);
      const intn in_image = column < (int)p.width, doubtful = !(fabs(side) > error);
      uint bits = lane_bits(side > error && in_image);
      if (limit > 0.0f) bits |= lane_bits((side > 0.0f || is_within(v, limit)) && in_image);
      if (any_lane(doubtful)) {
        bits |= owned_of(lane_bits(doubtful && in_image), p, t, first_column + part, first_row + row);
      }
      mask |= (ulong)bits << (DPR_TILE * row + part);
    }
  }
  return (uint2)((uint)mask, (uint)(mask >> 32));
}

/// True if a triangle owns a vector of samples: by the edge functions where their sign is certain, by
/// owns_sample() where it is not.
static inline intn is_inside(const FrameParams p, const Triangle t, const View3 v, float error,
                             uintn packed) {
  const realn side = least_side(v, t.orientation);
  intn inside = side > 0.0f;
  const intn doubtful = !(fabs(side) > error);
  if (any_lane(doubtful)) {
    uint pixels[DPR_WIDTH];
    store_n(packed, 0, pixels);
    int owned[DPR_WIDTH];
    for (uint k = 0; k < DPR_WIDTH; ++k) {
      owned[k] = -owns_sample(t, pixel_centre(p, pixels[k] & 0xffffu, pixels[k] >> 16));
    }
    inside = select(inside, load_n(0, owned), doubtful);
  }
  return inside;
}

/// The signed distance from its square.
static inline realn with_sign(const FrameParams p, realn distance2, intn inside) {
  const realn s = p.euclidean ? sqrt(distance2) : distance2;
  return choose(inside, s, -s);
}

/// The gradients of a triangle's corners, as sums over lanes of fragments.
typedef struct {
  realn x[3], y[3], z[3];
} CornerGradients;

static inline CornerGradients no_corner_gradients(void) {
  CornerGradients g;
#pragma unroll
  for (int k = 0; k < 3; ++k) g.x[k] = g.y[k] = g.z[k] = 0.0f;
  return g;
}

/// The tangents of a triangle's corners: x, y (NDC), view depth.
typedef struct {
  float3 corner[3];
} CornerTangents;

/// The tangent of a value with these gradients.
static inline realn along_corners(const CornerGradients g, const CornerTangents t) {
  realn sum = 0.0f;
#pragma unroll
  for (int k = 0; k < 3; ++k) sum += g.x[k] * t.corner[k].x + g.y[k] * t.corner[k].y + g.z[k] * t.corner[k].z;
  return sum;
}

/// The edge that is left out where none is.
#define DPR_NO_EDGE 3

/// Adds the gradient of the signed distance to a triangle's edges but for `left_out`. With q from the closest
/// point of the triangle to the pixel, and u the barycentrics of that point, d|q|^2 / d vertex_k = -2 u_k q:
/// the point's own motion along the edge does not count (the distance is stationary there).
static inline void add_distance_gradient(const View3 v, int left_out, intn inside, uint euclidean, realn grad,
                                         CornerGradients* g) {
  realn best = INFINITY, best_x = 0.0f, best_y = 0.0f;
  realn u[3] = {(realn)(0.0f), (realn)(0.0f), (realn)(0.0f)};
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    if (k == left_out) continue;
    const realn along = closest_on_edge(v.edge[k]);
    realn qx, qy;
    offset_from_edge(v.edge[k], along, &qx, &qy);
    const realn distance2 = qx * qx + qy * qy;
    const intn closer = distance2 < best;
    best = choose(closer, distance2, best);
    best_x = choose(closer, qx, best_x);
    best_y = choose(closer, qy, best_y);
    u[k] = choose(closer, (realn)(0.0f), u[k]);
    u[(k + 1) % 3] = choose(closer, 1.0f - along, u[(k + 1) % 3]);
    u[(k + 2) % 3] = choose(closer, along, u[(k + 2) % 3]);
  }
  // d|q| = d|q|^2 / (2 |q|); at |q| = 0 the Euclidean distance has no derivative, and zero is one of its
  // subgradients' averages.
  const realn chain = euclidean ? choose(best > 0.0f, 0.5f * rsqrt(best), (realn)(0.0f)) : (realn)(1.0f);
  const realn factor = choose(inside, (realn)(-2.0f), (realn)(2.0f)) * chain * grad;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    g->x[k] += factor * u[k] * best_x;
    g->y[k] += factor * u[k] * best_y;
  }
}

/// Adds the gradients that come by the clipped barycentrics c_i = max(n_i, 0) / sum_j max(n_j, 0): those of
/// depth and of the shaded colour. `grad_bary` are relative to vertex 0's, which changes nothing since the
/// c_i sum to 1.
static inline void add_barycentric_gradient(const View3 v, const Triangle t, const BarycentricScale scale,
                                            realn grad_depth, realn grad_bary1, realn grad_bary2,
                                            CornerGradients* g) {
  realn n[3], c[3];
  const realn turn = raw_barycentrics(v, scale, n);
  const realn inverse_sum = inverse_of_clipped(n);
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    c[k] = greater(n[k], 0.0f) * inverse_sum;
    g->z[k] += grad_depth * c[k];
  }
  const realn h1 = grad_depth * (t.z1 - t.z0) + grad_bary1, h2 = grad_depth * (t.z2 - t.z0) + grad_bary2;
  const realn mean = c[1] * h1 + c[2] * h2;
  const realn h[3] = {-mean, h1 - mean, h2 - mean};
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;  // the ends of the edge opposite to vertex k
    const realn grad_n = choose(n[k] > 0.0f, h[k] * inverse_sum, (realn)(0.0f));
    // n_k is proportional to 1 / z_k.
    g->z[k] -= grad_n * n[k] * scale.inverse_depth[k];
    // The edge function is cross(a, b) of the edge's ends a, b relative to the pixel.
    const realn grad_side = grad_n * turn * scale.factor[k];
    const Edge from_i = v.edge[k], from_j = v.edge[i];  // edge i begins at vertex j
    g->x[i] -= grad_side * from_j.dy;
    g->y[i] += grad_side * from_j.dx;
    g->x[j] += grad_side * from_i.dy;
    g->y[j] -= grad_side * from_i.dx;
  }
}

/// The pixels of a run of fragments; in the lanes outside of it pixel 0, which is as good as any.
static inline uintn load_pixels(intn in_run, uint first, global const uint* pixels) {
  return select((uintn)(0), load_n(first, pixels), in_run);
}

#endif
