// The base colour of a fragment: its corners' colours, interpolated, times its texture. Shared by the stage
// that computes it and the one that gathers its gradient at texels. One fragment at a time: its texels lie
// anywhere, and a texel is a vector already.
#ifndef DPR_TEXTURE_H
#define DPR_TEXTURE_H

#include "clip.h"
#include "geometry.h"
#include "pyramid.h"

/// Everything of a scene that base colours are made of.
typedef struct {
  global const uint4* face_colors;  // [face] indices into colors, by corner
  global const float4* colors;      // linear RGB
  global const uint4*
      face_texcoords;              // [face] indices into texcoords, by corner; w = texture or DPR_NO_TEXTURE
  global const float4* texcoords;  // u, v
  global const Texture* textures;
  global const Triangle* triangles;   // [view][face]
  global const ClippedFace* clipped;  // [view][face]; read where p.clips is set
} SurfaceScene;

/// A triangle's corners: colours, and places in its texture. Places are in units of the whole texture, from
/// its upper left corner to the right and down; c1, c2 of the way along `along1`, `along2` from `base`.
typedef struct {
  float4 color, color1, color2;
  float2 place, place1, place2;
  Texture texture;
  int is_textured;
  Triangle triangle;
  int is_clipped;
  ClippedFace clipped;
} TexturedFace;

static inline float2 place_of(float4 texcoord) { return (float2)(texcoord.x, 1.0f - texcoord.y); }

static inline TexturedFace load_face(const SurfaceScene s, const FrameParams p, uint view_face) {
  const uint view = view_face / p.faces, face = view_face - view * p.faces;
  const uint4 c = s.face_colors[face] + view * p.color_stride, corner = s.face_texcoords[face];
  TexturedFace f;
  f.color = s.colors[c.x];
  f.color1 = s.colors[c.y] - f.color;
  f.color2 = s.colors[c.z] - f.color;
  f.is_textured = corner.w != DPR_NO_TEXTURE;
  f.texture = s.textures[f.is_textured ? corner.w : 0];
  f.triangle = s.triangles[view_face];
  f.is_clipped = p.clips && s.clipped[view_face].corners != 0;
  if (f.is_clipped) f.clipped = s.clipped[view_face];
  f.place = place_of(s.texcoords[corner.x]);
  f.place1 = place_of(s.texcoords[corner.y]) - f.place;
  f.place2 = place_of(s.texcoords[corner.z]) - f.place;
  // Whole periods are left out before anything is interpolated: far from the origin they would take the
  // digits.
  if (f.texture.wrap == DPR_REPEAT) f.place -= floor(f.place);
  if (f.texture.wrap == DPR_MIRROR) f.place -= 2.0f * floor(0.5f * f.place);
  return f;
}

/// The two texels along an axis whose mixture is seen, `low` and the one after it (the first after the last),
/// and the part of the latter; and how fast a place moves from the one to the other.
typedef struct {
  uint low, high;
  float part, slope;
} Tap;

static inline Tap make_tap(float place, uint size, uint wrap, uint filter) {
  const float count = (float)size;
  float slope = count;
  if (wrap == DPR_REPEAT) place -= floor(place);
  if (wrap == DPR_MIRROR) {
    place -= 2.0f * floor(0.5f * place);
    if (place > 1.0f) slope = -count;
    place = 1.0f - fabs(1.0f - place);
  }
  // Beyond single precision there is no place: the first texel. Written so that a NaN is one of those.
  place = place > 0.0f ? fmin(place, 1.0f) : 0.0f;
  const float from_centre = place * count - (filter == DPR_NEAREST ? 0.0f : 0.5f);
  Tap tap;
  if (filter == DPR_NEAREST || (wrap != DPR_REPEAT && !(from_centre > 0.0f && from_centre < count - 1.0f))) {
    // A single texel: at the borders half of it has no neighbour, or itself as one.
    tap.low = (uint)clamp(from_centre, 0.0f, count - 1.0f);
    tap.part = 0.0f;
    tap.slope = 0.0f;
  } else {
    const float below = floor(from_centre);
    tap.low = below < 0.0f ? size - 1 : min((uint)below, size - 1);
    tap.part = from_centre - below;
    tap.slope = slope;
  }
  tap.high = tap.low + 1 == size ? 0 : tap.low + 1;
  return tap;
}

/// Where a fragment looks into a level of its texture.
typedef struct {
  uint first, width;  // of the level
  Tap x, y;
} Footprint;

static inline Footprint find_footprint(const Texture t, uint level, float2 place) {
  const Level l = find_level(t, level);
  Footprint f;
  f.first = l.first;
  f.width = l.width;
  f.x = make_tap(place.x, l.width, t.wrap, t.filter);
  f.y = make_tap(place.y, l.height, t.wrap, t.filter);
  return f;
}

/// The mixture of four texels, named by the first of them.
static inline uint footprint_cell(const Footprint f) { return f.first + f.y.low * f.width + f.x.low; }

/// What is seen, and its derivatives by the place and by the level of detail.
typedef struct {
  float4 color, by_x, by_y, by_detail;
} Sample;

static inline Sample sample_level(const Footprint f, global const float4* texels) {
  global const float4 *low = texels + f.first + f.y.low * f.width,
                      *high = texels + f.first + f.y.high * f.width;
  const float4 a = low[f.x.low], b = low[f.x.high] - a, c = high[f.x.low], d = high[f.x.high] - c;
  const float4 upper = a + f.x.part * b, lower = c + f.x.part * d;
  Sample s;
  s.color = upper + f.y.part * (lower - upper);
  s.by_x = f.x.slope * (b + f.y.part * (d - b));
  s.by_y = f.y.slope * (lower - upper);
  s.by_detail = 0.0f;
  return s;
}

/// How many texels lie between neighbouring samples of the image, as a level of the pyramid: the logarithm to
/// base 2 of the longer of the steps along the image's axes. By what it depends on: barycentrics' steps c_k'
/// = z (q_k - c_k Q), where q_k = g_k / z_k, Q = sum q_k, z = sum c_k z_k, and g_k is the step of the
/// barycentric on the screen.
typedef struct {
  float level, part;  // the larger of two levels, and the part of the smaller; 0 where there is one alone
  int along_y;        // which step is the longer
  int varies;         // whether the level follows it
  float2 by_step;     // derivative by the place's step
  float q[3], z[3], depth, sum_q, step1, step2;
} Detail;

/// Steps of the barycentrics on the screen, times the doubled area.
static inline void screen_steps(const Triangle t, int along_y, float step[3]) {
  step[0] = along_y ? t.x2 - t.x1 : t.y1 - t.y2;
  step[1] = along_y ? t.x0 - t.x2 : t.y2 - t.y0;
  step[2] = along_y ? t.x1 - t.x0 : t.y0 - t.y1;
}

/// The determinant of a clipped face's homogeneous corners, and its derivative by one of them. A barycentric
/// times 1 / depth is one of these over the determinant, times the sample: q_k is a component of that.
static inline float3 cofactor(const ClippedFace c, int k) {
  return cross(c.corner[(k + 1) % 3].xyz, c.corner[(k + 2) % 3].xyz);
}
static inline float determinant(const ClippedFace c) { return dot(c.corner[0].xyz, cofactor(c, 0)); }

/// The step of the place along an axis of the image, NDC; fills what it is made of. Of clipped faces in
/// perspective, always: without it the plane has no steps where it passes the camera.
static inline float2 place_step(const FrameParams p, const TexturedFace f, float c1, float c2, int along_y,
                                Detail* d) {
  if (f.is_clipped) {
    const float inverse = 1.0f / determinant(f.clipped);
    for (int k = 0; k < 3; ++k) {
      const float3 step = cofactor(f.clipped, k);
      d->z[k] = f.clipped.corner[k].z;
      d->q[k] = (along_y ? step.y : step.x) * inverse;
    }
  } else {
    const float depths[3] = {f.triangle.z0, f.triangle.z1, f.triangle.z2};
    const float inverse_area = 1.0f / doubled_area(f.triangle);
    screen_steps(f.triangle, along_y, d->q);
    for (int k = 0; k < 3; ++k) {
      d->z[k] = p.perspective_correct ? depths[k] : 1.0f;
      d->q[k] *= inverse_area / d->z[k];
    }
  }
  d->along_y = along_y;
  d->sum_q = d->q[0] + d->q[1] + d->q[2];
  d->depth = d->z[0] + c1 * (d->z[1] - d->z[0]) + c2 * (d->z[2] - d->z[0]);
  d->step1 = d->depth * (d->q[1] - c1 * d->sum_q);
  d->step2 = d->depth * (d->q[2] - c2 * d->sum_q);
  return d->step1 * f.place1 + d->step2 * f.place2;
}

static inline Detail find_detail(const FrameParams p, const TexturedFace f, float c1, float c2) {
  Detail d;
  d.level = d.part = 0.0f;
  d.varies = 0;
  if (f.texture.levels == 1) return d;
  const float2 scale = p.pixel_size * (float2)((float)f.texture.width, (float)f.texture.height);
  Detail other;
  float2 step = scale * place_step(p, f, c1, c2, 0, &d);
  const float2 other_step = scale * place_step(p, f, c1, c2, 1, &other);
  if (dot(other_step, other_step) > dot(step, step)) {
    d = other;
    step = other_step;
  }
  const float length2 = dot(step, step), most = (float)(f.texture.levels - 1);
  const float detail = 0.5f * log2(length2);
  d.varies = detail > 0.0f && detail < most;
  const float clamped = detail > 0.0f ? fmin(detail, most) : 0.0f;  // a NaN is 0
  d.level = fmin(floor(clamped), most - 1.0f);
  d.part = clamped - d.level;
  d.by_step = scale * step / (length2 * M_LN2_F);
  return d;
}

static inline float4 base_of_corners(const TexturedFace f, float c1, float c2) {
  return f.color + c1 * f.color1 + c2 * f.color2;
}

static inline float2 place_at(const TexturedFace f, float c1, float c2) {
  return f.place + c1 * f.place1 + c2 * f.place2;
}

/// White where there is no texture.
static inline Sample sample_face(const TexturedFace f, const Detail d, float c1, float c2,
                                 global const float4* texels) {
  Sample s;
  s.color = 1.0f;
  s.by_x = s.by_y = s.by_detail = 0.0f;
  if (!f.is_textured) return s;
  const float2 place = place_at(f, c1, c2);
  s = sample_level(find_footprint(f.texture, (uint)d.level, place), texels);
  if (f.texture.levels == 1) return s;
  const Sample next = sample_level(find_footprint(f.texture, (uint)d.level + 1, place), texels);
  s.by_detail = next.color - s.color;
  s.color += d.part * s.by_detail;
  s.by_x += d.part * (next.by_x - s.by_x);
  s.by_y += d.part * (next.by_y - s.by_y);
  return s;
}

#endif
