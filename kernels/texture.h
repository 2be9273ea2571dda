// The base colour of a fragment: its corners' colours, interpolated, times its texture. Shared by the stage
// that computes it and the one that gathers its gradient at texels. One fragment at a time: its texels lie
// anywhere, and a texel is a vector already.
#ifndef DPR_TEXTURE_H
#define DPR_TEXTURE_H

#include "clip.h"
#include "face_rows.h"
#include "geometry.h"
#include "pyramid.h"

/// Everything of a scene that base colours are made of.
typedef struct {
  // [face] of FrameParams.color_faces: indices into colors, by corner; of FrameParams.texcoord_faces: into
  // texcoords; w = texture or DPR_NO_TEXTURE
  global const uint4* faces;
  global const float4* colors;     // linear RGB
  global const float4* texcoords;  // u, v
  global const Texture* textures;
  global const Triangle* triangles;   // [view][face]
  global const ClippedFace* clipped;  // [view][face]; read where p.clips is set
} SurfaceScene;

/// Inputs of the level of detail. Barycentric c_k changes by z (q_k - c_k Q) from sample to sample along
/// an axis of the image, where q_k = g_k / z_k, Q = sum q_k, z = sum c_k z_k, z_k is a corner's depth, or 1
/// without perspective, and g_k is the step of the barycentric on the screen. NDC.
typedef struct {
  float3 depth;     // z_k
  float3 q_x, q_y;  // q_k along either axis
} Steps;

/// A triangle's corners: colours, and places in its texture. Places are in units of the whole texture, from
/// its upper left corner to the right and down; c1, c2 of the way along `along1`, `along2` from `base`.
typedef struct {
  float4 color, color1, color2;
  float2 place, place1, place2;
  Texture texture;
  int is_textured;
  int is_clipped;
  Steps steps;  // where the texture has several levels
} TexturedFace;

/// Steps of the barycentrics on the screen, times the doubled area.
static inline float3 screen_steps(const Triangle t, int along_y) {
  return along_y ? (float3)(t.x2 - t.x1, t.x0 - t.x2, t.x1 - t.x0)
                 : (float3)(t.y1 - t.y2, t.y2 - t.y0, t.y0 - t.y1);
}

/// The determinant of a clipped face's homogeneous corners, and its derivative by one of them. A barycentric
/// times 1 / depth is one of these over the determinant, times the sample: q_k is a component of that.
static inline float3 cofactor(const ClippedFace c, int k) {
  return cross(c.corner[(k + 1) % 3].xyw, c.corner[(k + 2) % 3].xyw);
}
static inline float determinant(const ClippedFace c) { return dot(c.corner[0].xyw, cofactor(c, 0)); }

/// Steps of a whole face, and of a clipped one: in perspective always, as without it the plane has no
/// steps where it passes the camera.
static inline Steps triangle_steps(const FrameParams p, const Triangle t) {
  const float3 depth = p.perspective_correct ? (float3)(t.z0, t.z1, t.z2) : (float3)(1.0f);
  const float3 scale = is_sliver(t) ? (float3)(0.0f) : 1.0f / (doubled_area(t) * depth);
  const Steps s = {depth, screen_steps(t, 0) * scale, screen_steps(t, 1) * scale};
  return s;
}

static inline Steps clipped_steps(const ClippedFace c) {
  const float inverse = 1.0f / determinant(c);
  const float3 a = cofactor(c, 0), b = cofactor(c, 1), d = cofactor(c, 2);
  const Steps s = {(float3)(c.corner[0].w, c.corner[1].w, c.corner[2].w), inverse * (float3)(a.x, b.x, d.x),
                   inverse * (float3)(a.y, b.y, d.y)};
  return s;
}

static inline float2 place_of(float4 texcoord) { return (float2)(texcoord.x, 1.0f - texcoord.y); }

/// Without the colours.
static inline TexturedFace load_place(const SurfaceScene s, const FrameParams p, uint view_face) {
  const uint4 corner = s.faces[p.texcoord_faces + row_of_face(p, view_face)];
  TexturedFace f;
  f.is_textured = corner.w != DPR_NO_TEXTURE;
  f.texture = s.textures[f.is_textured ? corner.w : 0];
  f.is_clipped = p.clips && s.clipped[view_face].corners != 0;
  f.place = place_of(s.texcoords[corner.x]);
  f.place1 = place_of(s.texcoords[corner.y]) - f.place;
  f.place2 = place_of(s.texcoords[corner.z]) - f.place;
  // Whole periods are left out before anything is interpolated: far from the origin they would take the
  // digits.
  if (f.texture.wrap == DPR_REPEAT) f.place -= floor(f.place);
  if (f.texture.wrap == DPR_MIRROR) f.place -= 2.0f * floor(0.5f * f.place);
  if (f.texture.levels > 1) {
    f.steps = f.is_clipped ? clipped_steps(s.clipped[view_face]) : triangle_steps(p, s.triangles[view_face]);
  }
  return f;
}

static inline TexturedFace load_face(const SurfaceScene s, const FrameParams p, uint view_face) {
  const uint view = view_face / p.faces;
  const uint4 c = s.faces[p.color_faces + row_of_face(p, view_face)] + view * p.color_stride;
  TexturedFace f = load_place(s, p, view_face);
  f.color = s.colors[c.x];
  f.color1 = s.colors[c.y] - f.color;
  f.color2 = s.colors[c.z] - f.color;
  return f;
}

/// Place of a fragment in two neighbouring levels of its texture, or twice in its only one. Vectors
/// hold column and row of the larger level, then of the smaller one: along each axis the two texels whose
/// mixture is seen, `low` and the one after it (the first after the last), the part of the latter, and how
/// fast a place moves from the one to the other.
typedef struct {
  uint2 first, width;  // of the levels
  uint4 low, high;
  float4 part, slope;
} Footprint;

static inline Footprint find_footprint(const Texture t, uint level, float2 at) {
  const Level large = find_level(t, level), small = level + 1 < t.levels ? next_level(large) : large;
  const uint4 size = (uint4)(large.width, large.height, small.width, small.height);
  const float4 count = convert_float4(size);
  Footprint f;
  f.first = (uint2)(large.first, small.first);
  f.width = (uint2)(large.width, small.width);
  float4 place = at.xyxy;
  f.slope = count;
  if (t.wrap == DPR_REPEAT) place -= floor(place);
  if (t.wrap == DPR_MIRROR) {
    place -= 2.0f * floor(0.5f * place);
    f.slope = place > 1.0f ? -count : count;
    place = 1.0f - fabs(1.0f - place);
  }
  // Beyond single precision there is no place: the first texel. Written so that a NaN is one of those.
  place = place > 0.0f ? fmin(place, 1.0f) : (float4)(0.0f);
  const float4 from_centre = place * count - (t.filter == DPR_NEAREST ? 0.0f : 0.5f);
  const float4 last = count - 1.0f, below = floor(from_centre);
  f.part = from_centre - below;
  const uint4 nearest = convert_uint4(clamp(from_centre, 0.0f, last));
  f.low = below < 0.0f ? size - 1 : min(convert_uint4(fmax(below, 0.0f)), size - 1);
  // A single texel: at the borders half of it has no neighbour, or itself as one.
  const int4 is_within = from_centre > 0.0f && from_centre < last;
  const int4 is_mixed = t.filter == DPR_NEAREST ? (int4)(0) : t.wrap == DPR_REPEAT ? (int4)(-1) : is_within;
  f.low = is_mixed ? f.low : nearest;
  f.part = is_mixed ? f.part : (float4)(0.0f);
  f.slope = is_mixed ? f.slope : (float4)(0.0f);
  f.high = f.low + 1 == size ? (uint4)(0) : f.low + 1;
  return f;
}

/// The mixtures of four texels, each named by the first of them.
static inline uint2 footprint_cells(const Footprint f) { return f.first + f.low.yw * f.width + f.low.xz; }

/// Colour of a texture, and its derivatives by the place and by the level of detail.
typedef struct {
  float4 color, by_x, by_y, by_detail;
} Sample;

static inline Sample sample_level(uint first, uint width, uint2 low, uint2 high, float2 part, float2 slope,
                                  global const float4* texels) {
  global const float4 *upper_row = texels + first + low.y * width,
                      *lower_row = texels + first + high.y * width;
  const float4 a = upper_row[low.x], b = upper_row[high.x] - a, c = lower_row[low.x],
               d = lower_row[high.x] - c;
  const float4 upper = a + part.x * b, lower = c + part.x * d;
  Sample s;
  s.color = upper + part.y * (lower - upper);
  s.by_x = slope.x * (b + part.y * (d - b));
  s.by_y = slope.y * (lower - upper);
  s.by_detail = 0.0f;
  return s;
}

/// Texels between neighbouring samples of the image, as a level of the pyramid: the logarithm to
/// base 2 of the longer of the place's steps along the image's axes.
typedef struct {
  float level, part;  // the larger of two levels, and the part of the smaller; 0 where there is one alone
  int along_y;        // which step is the longer
  int varies;         // whether the level follows it
  float2 by_step;     // derivative by the place's step
  float depth;
} Detail;

/// Change of the place from sample to sample along an axis, over z, at `way` from corner 0: sum q_k
/// place_k, less Q times its mean by the c_k.
static inline float2 place_step(const TexturedFace* f, float3 q, float2 way) {
  return q.y * f->place1 + q.z * f->place2 - (q.x + q.y + q.z) * way;
}

static inline Detail find_detail(const FrameParams p, const TexturedFace* f, float c1, float c2) {
  Detail d;
  d.level = d.part = 0.0f;
  d.varies = 0;
  if (f->texture.levels == 1) return d;
  const Steps* s = &f->steps;
  const float2 way = c1 * f->place1 + c2 * f->place2;
  d.depth = s->depth.x + c1 * (s->depth.y - s->depth.x) + c2 * (s->depth.z - s->depth.x);
  const float2 scale = p.pixel_size * (float2)((float)f->texture.width, (float)f->texture.height);
  const float2 x = scale * d.depth * place_step(f, s->q_x, way),
               y = scale * d.depth * place_step(f, s->q_y, way);
  d.along_y = dot(y, y) > dot(x, x);
  const float2 step = d.along_y ? y : x;
  const float length2 = dot(step, step), most = (float)(f->texture.levels - 1);
  const float detail = 0.5f * log2(length2);
  d.varies = detail > 0.0f && detail < most;
  const float clamped = detail > 0.0f ? fmin(detail, most) : 0.0f;  // a NaN is 0
  d.level = fmin(floor(clamped), most - 1.0f);
  d.part = clamped - d.level;
  d.by_step = scale * step / (length2 * M_LN2_F);
  return d;
}

static inline float4 base_of_corners(const TexturedFace* f, float c1, float c2) {
  return f->color + c1 * f->color1 + c2 * f->color2;
}

static inline float2 place_at(const TexturedFace* f, float c1, float c2) {
  return f->place + c1 * f->place1 + c2 * f->place2;
}

/// White where there is no texture.
static inline Sample sample_face(const TexturedFace* f, const Detail d, float c1, float c2,
                                 global const float4* texels) {
  Sample s;
  s.color = 1.0f;
  s.by_x = s.by_y = s.by_detail = 0.0f;
  if (!f->is_textured) return s;
  const Footprint at = find_footprint(f->texture, (uint)d.level, place_at(f, c1, c2));
  s = sample_level(at.first.x, at.width.x, at.low.xy, at.high.xy, at.part.xy, at.slope.xy, texels);
  if (f->texture.levels == 1) return s;
  const Sample next =
      sample_level(at.first.y, at.width.y, at.low.zw, at.high.zw, at.part.zw, at.slope.zw, texels);
  s.by_detail = next.color - s.color;
  s.color += d.part * s.by_detail;
  s.by_x += d.part * (next.by_x - s.by_x);
  s.by_y += d.part * (next.by_y - s.by_y);
  return s;
}

#endif
