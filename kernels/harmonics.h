// Real spherical harmonics up to the second order.
#ifndef DPR_HARMONICS_H
#define DPR_HARMONICS_H

#include "shared_types.h"
#include "vec3n.h"

/// The basis, but for its constants, at a normal: of degree 0, 1 and 2, so that without a normal the mean is
/// left. In the order (0, 0), (1, -1), (1, 0), (1, 1), (2, -2), ..., (2, 2).
static inline void harmonic_basis(Vec3n n, realn basis[DPR_HARMONICS]) {
  basis[0] = 1.0f;
  basis[1] = n.y;
  basis[2] = n.z;
  basis[3] = n.x;
  basis[4] = n.x * n.y;
  basis[5] = n.y * n.z;
  basis[6] = 2.0f * n.z * n.z - n.x * n.x - n.y * n.y;
  basis[7] = n.x * n.z;
  basis[8] = n.x * n.x - n.y * n.y;
}

/// Its gradient to the normal, from those of the basis.
static inline Vec3n harmonic_basis_backward(Vec3n n, const realn g[DPR_HARMONICS]) {
  return make_vec3n(g[3] + n.y * g[4] + n.z * g[7] + 2.0f * n.x * (g[8] - g[6]),
                    g[1] + n.x * g[4] + n.z * g[5] - 2.0f * n.y * (g[8] + g[6]),
                    g[2] + n.y * g[5] + n.x * g[7] + 2.0f * n.z * (g[6] + g[6]));
}

/// Its derivative where the normal moves by `d`.
static inline void harmonic_basis_tangent(Vec3n n, Vec3n d, realn tangent[DPR_HARMONICS]) {
  tangent[0] = 0.0f;
  tangent[1] = d.y;
  tangent[2] = d.z;
  tangent[3] = d.x;
  tangent[4] = d.x * n.y + n.x * d.y;
  tangent[5] = d.y * n.z + n.y * d.z;
  tangent[6] = 4.0f * n.z * d.z - 2.0f * (n.x * d.x + n.y * d.y);
  tangent[7] = d.x * n.z + n.x * d.z;
  tangent[8] = 2.0f * (n.x * d.x - n.y * d.y);
}

#endif
