// The lens: radial and tangential distortion of tangents, x and y of camera space over depth. Brown,
// "Close-range camera calibration" (1971), with OpenCV's coefficients: with R = 1 + k1 r^2 + k2 r^4 + k3 r^6
// and q = (p2, -p1), since OpenCV's y axis points down, a tangent t is seen at t (R + 2 q.t) + q r^2.
//
// Beyond the radius where r R has its maximum the image would fold over: what lies there is held at it, in
// its own direction from the axis.
#ifndef DPR_LENS_H
#define DPR_LENS_H

#include "shared_types.h"

/// A tangent held within what the lens can show, and by what part of it.
typedef struct {
  float2 tangent;
  float part, radius2;
} HeldTangent;

static inline HeldTangent hold_tangent(global const ViewParams* view, float2 t) {
  const float radius2 = dot(t, t), largest = view->largest_radius2;
  HeldTangent held = {t, 1.0f, radius2};
  if (radius2 > largest) {
    held.part = sqrt(largest / radius2);
    held.tangent = held.part * t;
    held.radius2 = largest;
  }
  return held;
}

static inline float radial_factor(global const ViewParams* view, float radius2) {
  return 1.0f + radius2 * (view->radial[0] + radius2 * (view->radial[1] + radius2 * view->radial[2]));
}

/// Tangent as the lens shows it. Not contracted, so that faces that share a cut agree on it.
static inline float2 bend_tangent(global const ViewParams* view, float2 tangent) {
#pragma OPENCL FP_CONTRACT OFF
  const HeldTangent held = hold_tangent(view, tangent);
  const float2 t = held.tangent, q = (float2)(view->tangential[0], view->tangential[1]);
  return t * (radial_factor(view, held.radius2) + 2.0f * dot(q, t)) + q * held.radius2;
}

/// From the gradient of where a tangent is shown to that of the tangent.
static inline float2 bend_tangent_backward(global const ViewParams* view, float2 tangent, float2 grad) {
  const HeldTangent held = hold_tangent(view, tangent);
  const float2 t = held.tangent, q = (float2)(view->tangential[0], view->tangential[1]);
  const float r2 = held.radius2;
  const float slope = view->radial[0] + r2 * (2.0f * view->radial[1] + r2 * 3.0f * view->radial[2]);
  const float2 g = (radial_factor(view, r2) + 2.0f * dot(q, t)) * grad +
                   2.0f * (dot(t, grad) * (slope * t + q) + dot(q, grad) * t);
  // A held tangent moves about the axis only.
  return held.part < 1.0f ? held.part * (g - dot(t, g) / r2 * t) : g;
}

/// The gradients of k1, k2, p1, p2, k3, and zeros. How the radius from which on points are held moves does
/// not count: r R is at its maximum there.
static inline float8 coefficients_gradient(global const ViewParams* view, float2 tangent, float2 grad) {
  const HeldTangent held = hold_tangent(view, tangent);
  const float r2 = held.radius2, along = dot(held.tangent, grad);
  const float2 grad_q = 2.0f * along * held.tangent + r2 * grad;
  return (float8)(along * r2, along * r2 * r2, -grad_q.y, grad_q.x, along * r2 * r2 * r2, 0.0f, 0.0f, 0.0f);
}

/// The NDC of a point of camera space.
static inline float2 project(const FrameParams p, global const ViewParams* view, float2 point, float depth) {
  const float2 scale = view->projection.xy, offset = view->projection.zw;
  if (p.orthographic) return point * scale + offset;
  if (view->distorts) return bend_tangent(view, point / depth) * scale + offset;
  return point * scale / depth + offset;
}

/// From NDC without distortion to those with it.
static inline float2 bend_ndc(global const ViewParams* view, float2 ndc) {
  const float2 scale = view->projection.xy, offset = view->projection.zw;
  return view->distorts ? bend_tangent(view, (ndc - offset) / scale) * scale + offset : ndc;
}
static inline float2 bend_ndc_backward(global const ViewParams* view, float2 ndc, float2 grad) {
  const float2 scale = view->projection.xy, offset = view->projection.zw;
  return view->distorts ? bend_tangent_backward(view, (ndc - offset) / scale, grad * scale) / scale : grad;
}

#endif
