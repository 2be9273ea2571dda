// Auxiliary outputs of a pixel from the weights of its fragments: expected depth and normal, the face of the
// largest weight with its barycentrics, the effective number of faces.
#include "shared_types.h"

/// The normal of a face, not normalised, on the side from which it winds counter-clockwise.
static inline float3 face_normal(uint4 face, global const float4* world) {
  const float3 a = world[face.x].xyz;
  return cross(world[face.y].xyz - a, world[face.z].xyz - a);
}

/// 0 for vectors without a length.
static inline float3 normalized(float3 v) {
  const float length2 = dot(v, v);
  return length2 > 0.0f ? v * rsqrt(length2) : (float3)(0.0f);
}

/// One work-item per pixel, up to `last_pixel`. Deterministic.
/// in   starts         uint[pixel + 1]        runs of `list`
/// in   list           uint[...]              fragments, by pixel
/// in   weight         float[fragment]        in the pixel's colour
/// in   channels       float[DPR_PIXEL_CHANNELS][pixel]  of aggregation's backward pass for a gradient of 1
///                                                       in red: the background's weight is in that of the
///                                                       background colour
/// in   depth, bary1, bary2  float[fragment]
/// in   fragment_pair  uint[fragment],  pair_face  uint[pair]
/// in   faces          uint4[face]            vertex indices
/// in   world          float4[view][vertex]
/// out  outputs        float[DPR_AUXILIARY_CHANNELS][pixel]
/// out  face_id        uint[pixel]            face of the scene, DPR_NO_FACE for the background
kernel void auxiliary_forward(const FrameParams p, const uint last_pixel, global const uint* restrict starts,
                              global const uint* restrict list, global const float* restrict weight,
                              global const float* restrict channels, global const float* restrict depth,
                              global const float* restrict bary1, global const float* restrict bary2,
                              global const uint* restrict fragment_pair,
                              global const uint* restrict pair_face, global const uint4* restrict faces,
                              global const float4* restrict world, global float* restrict outputs,
                              global uint* restrict face_id) {
  const uint pixel = (uint)get_global_id(0);
  const uint pixels_per_view = p.width * p.height, pixels = p.views * pixels_per_view;
  if (pixel >= last_pixel) return;
  global const float4* vertices = world + pixel / pixels_per_view * p.vertices;
  float sum = 0.0f, squares = 0.0f, depth_sum = 0.0f,
        largest = channels[DPR_CHANNEL_BACKGROUND * pixels + pixel];
  float2 barycentrics = (float2)(0.0f, 0.0f);
  float3 normal = 0.0f;
  uint seen = DPR_NO_FACE;
  for (uint i = starts[pixel]; i < starts[pixel + 1]; ++i) {
    const uint k = list[i];
    const float w = max(weight[k], 0.0f);  // quadrature may leave a rounding below 0
    const uint face = pair_face[fragment_pair[k]] % p.faces;
    sum += w;
    squares += w * w;
    depth_sum += w * depth[k];
    normal += w * normalized(face_normal(faces[face], vertices));
    if (w <= largest) continue;
    largest = w;
    seen = face;
    barycentrics = (float2)(bary1[k], bary2[k]);
  }
  normal = normalized(normal);
  outputs[DPR_AUXILIARY_DEPTH * pixels + pixel] = sum > 0.0f ? depth_sum / sum : 0.0f;
  outputs[DPR_AUXILIARY_NORMAL * pixels + pixel] = normal.x;
  outputs[(DPR_AUXILIARY_NORMAL + 1) * pixels + pixel] = normal.y;
  outputs[(DPR_AUXILIARY_NORMAL + 2) * pixels + pixel] = normal.z;
  outputs[DPR_AUXILIARY_BARYCENTRICS * pixels + pixel] = barycentrics.x;
  outputs[(DPR_AUXILIARY_BARYCENTRICS + 1) * pixels + pixel] = barycentrics.y;
  outputs[DPR_AUXILIARY_EFFECTIVE_FACES * pixels + pixel] = squares > 0.0f ? sum * sum / squares : 0.0f;
  face_id[pixel] = seen;
}

/// Auxiliary outputs as what noise on the pixel can blend and blur: times the sample's alpha, by which to
/// divide after. One work-item per pixel. Deterministic.
/// in   outputs   float[DPR_AUXILIARY_CHANNELS][pixel]
/// in   image     float4[pixel]  whose w is alpha
/// out  surface   float4[pixel]  depth and normal
/// out  coverage  float4[pixel]  1 and the effective number of faces
kernel void auxiliary_weigh(const FrameParams p, global const float* restrict outputs,
                            global const float4* restrict image, global float4* restrict surface,
                            global float4* restrict coverage) {
  const uint pixel = (uint)get_global_id(0), pixels = p.views * p.width * p.height;
  if (pixel >= pixels) return;
  const float alpha = image[pixel].w;
  surface[pixel] = alpha * (float4)(outputs[DPR_AUXILIARY_DEPTH * pixels + pixel],
                                    outputs[DPR_AUXILIARY_NORMAL * pixels + pixel],
                                    outputs[(DPR_AUXILIARY_NORMAL + 1) * pixels + pixel],
                                    outputs[(DPR_AUXILIARY_NORMAL + 2) * pixels + pixel]);
  coverage[pixel] =
      alpha * (float4)(1.0f, outputs[DPR_AUXILIARY_EFFECTIVE_FACES * pixels + pixel], 0.0f, 0.0f);
}
