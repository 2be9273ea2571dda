// Auxiliary outputs of a pixel from the weights of its fragments: expected depth and normal, the face of the
// largest weight with its barycentrics, the effective number of faces.
#include "face_normal.h"
#include "face_rows.h"
#include "shared_types.h"

/// 0 for vectors without a length.
static inline float3 normalized(float3 v) {
  const float length2 = dot(v, v);
  return length2 > 0.0f ? v * rsqrt(length2) : (float3)(0.0f);
}

/// One work-item per pixel, up to `last_pixel`. Deterministic.
/// in   starts         uint[pixel + 1]        runs of `list`
/// in   list           uint[...]              fragments, by pixel
/// in   grads          float[plane][fragment]  of aggregation's backward pass for a gradient of 1 in red:
///                                            COLOR is the weight in the pixel's colour
/// in   channels       float[channel][pixel]  of the same: the background's weight is in that of the
///                                            background colour
/// in   fragments      float[plane][fragment]  DEPTH, BARY
/// in   fragment_pair  uint[fragment],  pair_face  uint[pair]
/// in   faces          uint4[face]            vertex indices
/// in   world          float4[view][vertex]
/// out  outputs        float[DPR_AUXILIARY_CHANNELS][pixel]
/// out  face_id        uint[pixel]            face of the scene, DPR_NO_FACE for the background
kernel void auxiliary_forward(const FrameParams p, const uint last_pixel, global const uint* restrict starts,
                              global const uint* restrict list, global const float* restrict grads,
                              global const float* restrict channels, global const float* restrict fragments,
                              global const uint* restrict fragment_pair,
                              global const uint* restrict pair_face, global const uint4* restrict faces,
                              global const float4* restrict world, global float* restrict outputs,
                              global uint* restrict face_id) {
  const uint pixel = (uint)get_global_id(0);
  const uint pixels_per_view = p.width * p.height, pixels = p.views * pixels_per_view;
  if (pixel >= last_pixel) return;
  global const float *const weight = grads + DPR_GRAD_PLANE(p, COLOR),
                            *const depth = fragments + DPR_PLANE(p, DEPTH),
                            *const bary = fragments + DPR_PLANE(p, BARY);
  global const float4* vertices = world + pixel / pixels_per_view * p.vertices;
  faces += first_row(p, pixel / pixels_per_view);
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
    normal += w * normalized(face_normal(vertices, faces[face]));
    if (w <= largest) continue;
    largest = w;
    seen = face;
    barycentrics = (float2)(bary[k], bary[p.fragments + k]);
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
/// in   channels  as auxiliary_forward has them
/// out  surface   float4[pixel]  depth and normal
/// out  coverage  float4[pixel]  1 and the effective number of faces
kernel void auxiliary_weigh(const FrameParams p, global const float* restrict outputs,
                            global const float* restrict channels, global float4* restrict surface,
                            global float4* restrict coverage) {
  const uint pixel = (uint)get_global_id(0), pixels = p.views * p.width * p.height;
  if (pixel >= pixels) return;
  const float alpha = 1.0f - channels[DPR_CHANNEL_BACKGROUND * pixels + pixel];
  surface[pixel] = alpha * (float4)(outputs[DPR_AUXILIARY_DEPTH * pixels + pixel],
                                    outputs[DPR_AUXILIARY_NORMAL * pixels + pixel],
                                    outputs[(DPR_AUXILIARY_NORMAL + 1) * pixels + pixel],
                                    outputs[(DPR_AUXILIARY_NORMAL + 2) * pixels + pixel]);
  coverage[pixel] =
      alpha * (float4)(1.0f, outputs[DPR_AUXILIARY_EFFECTIVE_FACES * pixels + pixel], 0.0f, 0.0f);
}

/// The samples' outputs as those of pixels: with noise on the pixel the face and where it is seen are those
/// of the sample at the pixel's centre or, of an even number, behind it, and the rest is the mean over what
/// covers the pixel. One work-item per pixel of the images.
/// in   image      uint4  width and height of an image, samples along a pixel's side and around the image
/// in   blurred    1: noise on the pixel; else a sample is a pixel, without `surface` and `coverage`
/// in   has_uv     1: every corner of a face has texture coordinates
/// in   outputs    float[DPR_AUXILIARY_CHANNELS][sample]  as auxiliary_forward
/// in   face_id    uint[sample]                           as auxiliary_forward
/// in   surface, coverage  float4[pixel]  as auxiliary_weigh, blurred
/// in   texcoord_of  uint[row of the face * 3 + corner]
/// in   texcoords    float2[...]
/// out  normals    float4[pixel]  the normal; w = depth
/// out  places     float4[pixel]  barycentrics, 0 on the background; w = the effective number of faces
/// out  uvs        float2[pixel]  0 on the background
/// out  faces      uint[pixel]    DPR_NO_FACE on the background
kernel void auxiliary_finish(const FrameParams p, const uint4 image, const uint blurred, const uint has_uv,
                             global const float* restrict outputs, global const uint* restrict face_id,
                             global const float4* restrict surface, global const float4* restrict coverage,
                             global const uint* restrict texcoord_of, global const float2* restrict texcoords,
                             global float4* restrict normals, global float4* restrict places,
                             global float2* restrict uvs, global uint* restrict faces) {
  const uint i = (uint)get_global_id(0), pixels = image.x * image.y, samples = p.views * p.width * p.height;
  if (i >= p.views * pixels) return;
  const uint pixel = i % pixels, row = image.w + pixel / image.x * image.z + image.z / 2,
             column = image.w + pixel % image.x * image.z + image.z / 2;
  const uint sample = (i / pixels * p.height + row) * p.width + column, face = face_id[sample];
  float4 normal = (float4)(outputs[DPR_AUXILIARY_NORMAL * samples + sample],
                           outputs[(DPR_AUXILIARY_NORMAL + 1) * samples + sample],
                           outputs[(DPR_AUXILIARY_NORMAL + 2) * samples + sample],
                           outputs[DPR_AUXILIARY_DEPTH * samples + sample]);
  float effective_faces = outputs[DPR_AUXILIARY_EFFECTIVE_FACES * samples + sample];
  if (blurred) {
    const float scale = coverage[i].x > 0.0f ? 1.0f / coverage[i].x : 0.0f;
    normal = (float4)(normalized(surface[i].yzw), surface[i].x * scale);
    effective_faces = coverage[i].y * scale;
  }
  float3 place = (float3)(0.0f);
  float2 uv = (float2)(0.0f, 0.0f);
  if (face != DPR_NO_FACE) {
    const float b1 = outputs[DPR_AUXILIARY_BARYCENTRICS * samples + sample],
                b2 = outputs[(DPR_AUXILIARY_BARYCENTRICS + 1) * samples + sample];
    place = (float3)(1.0f - b1 - b2, b1, b2);
    if (has_uv) {
      texcoord_of += 3 * (first_row(p, i / pixels) + face);
      uv = place.x * texcoords[texcoord_of[0]] + place.y * texcoords[texcoord_of[1]] +
           place.z * texcoords[texcoord_of[2]];
    }
  }
  normals[i] = normal;
  places[i] = (float4)(fmax(place, 0.0f), effective_faces);
  uvs[i] = uv;
  faces[i] = face;
}
