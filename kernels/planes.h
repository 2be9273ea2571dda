// Vectors of three in planes, of which each begins `plane` elements after the one before.
#ifndef DPR_PLANES_H
#define DPR_PLANES_H

static inline void add_to_planes(float3 v, uint i, uint plane, global float* values) {
  values[i] += v.x;
  values[i + plane] += v.y;
  values[i + 2 * plane] += v.z;
}
static inline float3 load_planes(uint i, uint plane, global const float* values) {
  return (float3)(values[i], values[i + plane], values[i + 2 * plane]);
}
static inline void store_planes(float3 v, uint i, uint plane, global float* values) {
  values[i] = v.x;
  values[i + plane] = v.y;
  values[i + 2 * plane] = v.z;
}

#endif
