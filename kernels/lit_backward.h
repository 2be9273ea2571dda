// From the gradients of lit colours to those of what they are made of, on lanes of fragments.
#ifndef DPR_LIT_BACKWARD_H
#define DPR_LIT_BACKWARD_H

#include "lit_surface.h"

/// A vector of fragments; 0 in the lanes that are not in the run.
typedef struct {
  realn c1, c2;
  Vec3n base, grad;
} LitFragment;

static inline LitFragment load_fragment(const FrameParams p, uint last, uint i, global const float* fragments,
                                        global const float* grads) {
  const intn in_run = lanes_before(last, i);
  const uint bary = i + DPR_PLANE(p, BARY);
  const LitFragment f = {load_run(in_run, bary, fragments), load_run(in_run, bary + p.fragments, fragments),
                         load_base(p, in_run, i, fragments),
                         load_run3(in_run, i + DPR_GRAD_PLANE(p, COLOR), p.grad_fragments, grads)};
  return f;
}

/// Gradients of what a surface is made of, and for Gouraud of the light at its corners, as sums over lanes.
typedef struct {
  Vec3n color[3], factor[3], specular[3], coefficient;
  realn shininess;
} MaterialGradients;

/// Gradients of where a surface lies, as sums over lanes.
typedef struct {
  Vec3n position[3], normal[3], eye;
} PlaceGradients;

static inline MaterialGradients no_material_gradients(void) {
  MaterialGradients g;
#pragma unroll
  for (int k = 0; k < 3; ++k) g.color[k] = g.factor[k] = g.specular[k] = zero3n();
  g.coefficient = zero3n();
  g.shininess = 0.0f;
  return g;
}
static inline PlaceGradients no_place_gradients(void) {
  PlaceGradients g;
#pragma unroll
  for (int k = 0; k < 3; ++k) g.position[k] = g.normal[k] = zero3n();
  g.eye = zero3n();
  return g;
}

static inline void add_corners(Vec3n grad[3], Vec3n g, realn c1, realn c2) {
  grad[0] = mad3n(g, 1.0f - c1 - c2, grad[0]);
  grad[1] = mad3n(g, c1, grad[1]);
  grad[2] = mad3n(g, c2, grad[2]);
}

/// Derivative by weight moved from corner 0 to corner k, of an interpolated quantity with gradient g.
static inline realn along_corner(const Vec3n corner[3], int k, Vec3n g) {
  return dot3n(sub3n(corner[k], corner[0]), g);
}

/// One fragment's share in what the surface is made of, its part of the gradients of the barycentrics,
/// relative to corner 0's, and the gradient of its base colour, which is returned.
static inline Vec3n material_backward(const Surface s, const LightingParams lp,
                                      global const Light* restrict lights, const LitFragment f,
                                      MaterialGradients* g, realn* grad_bary1, realn* grad_bary2) {
  const Shaded shaded = shade_fragment(s, lp, lights, f.c1, f.c2, f.base);
  const Vec3n grad_base = mul3n(f.grad, shaded.lit.factor),
              grad_specular = mul3n(f.grad, splat3(coefficient_of(s.material)));
  g->coefficient = mad3n(mul3n(f.grad, by_coefficient(shaded)), (realn)(1.0f), g->coefficient);
  g->shininess += dot3n(grad_specular, shaded.lit.by_shininess);
  *grad_bary1 = *grad_bary2 = 0.0f;
  if (DPR_BASE == DPR_BASE_OF_CORNERS) {
    add_corners(g->color, grad_base, f.c1, f.c2);
    *grad_bary1 = along_corner(s.color, 1, grad_base);
    *grad_bary2 = along_corner(s.color, 2, grad_base);
  }
  if (DPR_SHADING == DPR_GOURAUD) {
    const Vec3n grad_factor = mul3n(f.grad, shaded.at.base);
    add_corners(g->factor, grad_factor, f.c1, f.c2);
    add_corners(g->specular, grad_specular, f.c1, f.c2);
    *grad_bary1 += along_corner(s.factor, 1, grad_factor) + along_corner(s.specular, 1, grad_specular);
    *grad_bary2 += along_corner(s.factor, 2, grad_factor) + along_corner(s.specular, 2, grad_specular);
  }
  return grad_base;
}

/// Its share in where the surface lies, by the light at the fragment: adds to the gradients of the
/// barycentrics.
static inline void place_backward(const Surface s, const LightingParams lp,
                                  global const Light* restrict lights, const LitFragment f, PlaceGradients* g,
                                  realn* grad_bary1, realn* grad_bary2) {
  const SurfacePoint at = point_on(s, f.c1, f.c2, f.base);
  PointGradient point = zero_point_gradient();
  point.eye = g->eye;
  light_point_backward(lp, lights, s.material, s.eye, at.position, at.normal, mul3n(f.grad, at.base),
                       mul3n(f.grad, splat3(coefficient_of(s.material))), &point);
  g->eye = point.eye;
  const Vec3n grad_normal = normalize3n_backward(at.normal, at.inverse_normal, point.normal);
  add_corners(g->position, point.position, f.c1, f.c2);
  add_corners(g->normal, grad_normal, f.c1, f.c2);
  *grad_bary1 = along_corner(s.position, 1, point.position) + along_corner(s.normal, 1, grad_normal);
  *grad_bary2 = along_corner(s.position, 2, point.position) + along_corner(s.normal, 2, grad_normal);
}

/// Backward pass of light evaluated at the corners.
static inline void corners_backward(const Surface s, const LightingParams lp,
                                    global const Light* restrict lights, const MaterialGradients of,
                                    PlaceGradients* g) {
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    PointGradient point = zero_point_gradient();
    point.eye = g->eye;
    light_point_backward(lp, lights, s.material, s.eye, s.position[k], s.normal[k], of.factor[k],
                         of.specular[k], &point);
    g->position[k] = point.position;
    g->normal[k] = point.normal;
    g->eye = point.eye;
  }
}

#endif
