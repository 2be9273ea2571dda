// Affine maps by their rows.
#ifndef DPR_AFFINE_H
#define DPR_AFFINE_H

static inline float3 apply_affine(float4 row0, float4 row1, float4 row2, float3 v) {
  return (float3)(dot(row0.xyz, v) + row0.w, dot(row1.xyz, v) + row1.w, dot(row2.xyz, v) + row2.w);
}

/// The transpose of the linear part: how gradients travel back through an affine map.
static inline float3 apply_transposed(float4 row0, float4 row1, float4 row2, float3 g) {
  return row0.xyz * g.x + row1.xyz * g.y + row2.xyz * g.z;
}

#endif
