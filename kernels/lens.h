// The lens: distortion of tangents, x and y of camera space over depth. Both models move a tangent t of length r by
// a factor R along its direction, and R is a polynomial P with P(0) = 1.
//
// Brown, "Close-range camera calibration" (1971), with OpenCV's coefficients: R = P(r^2). With q = (p2, -p1), since
// OpenCV's y axis points down, t is seen at t (R + 2 q.t) + q r^2.
//
// Kannala and Brandt, "A generic camera model and calibration method" (2006), OpenCV's fisheye: with the angle from
// the axis a = atan r, R = a / r P(a^2) and q = 0.
//
// Beyond the radius where r R has its maximum the image would fold over: what lies there is held at it, in
// its own direction from the axis.
#ifndef DPR_LENS_H
#define DPR_LENS_H

#include "shared_types.h"

/// Squared tangent below which a fisheye's angle is the tangent: keeps a / r from being 0 / 0 on the axis.
#define DPR_LEAST_RADIUS2 1e-20f

/// A tangent held within what the lens can show, and by what part of it.
typedef struct {
  float2 tangent;
  float part, radius2;
  float argument, stretch;  // r^2 and 1; of a fisheye a^2 and a / r
} HeldTangent;

static inline HeldTangent hold_tangent(global const ViewParams* view, float2 t) {
  const float radius2 = dot(t, t), largest = view->largest_radius2;
  HeldTangent held = {t, 1.0f, radius2, radius2, 1.0f};
  if (radius2 > largest) {
    held.part = sqrt(largest / radius2);
    held.tangent = held.part * t;
    held.radius2 = held.argument = largest;
  }
  if (view->distorts == DPR_FISHEYE) {
    const float radius = sqrt(fmax(held.radius2, DPR_LEAST_RADIUS2)), angle = atan(radius);
    held.argument = angle * angle;
    held.stretch = angle / radius;
  }
  return held;
}

/// P and R.
static inline float radial_polynomial(global const ViewParams* view, HeldTangent held) {
  global const float* k = view->radial;
  const float s = held.argument;
  return 1.0f + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3])));
}
static inline float radial_factor(global const ViewParams* view, HeldTangent held) {
  return held.stretch * radial_polynomial(view, held);
}

/// Derivative of R with respect to r^2. Of a fisheye near the axis its rounding error grows as 1 / r^2, by which
/// all that it is multiplied with falls.
static inline float radial_slope(global const ViewParams* view, HeldTangent held) {
  global const float* k = view->radial;
  const float s = held.argument;
  const float slope = k[0] + s * (2.0f * k[1] + s * 3.0f * k[2] + s * s * 4.0f * k[3]);
  if (view->distorts != DPR_FISHEYE) return slope;
  const float r2 = fmax(held.radius2, DPR_LEAST_RADIUS2), a_over_r = held.stretch;
  const float angle_slope = 1.0f / (1.0f + r2);  // da / dr
  return 0.5f * (angle_slope - a_over_r) / r2 * radial_polynomial(view, held) +
         a_over_r * a_over_r * angle_slope * slope;
}

/// Tangent as the lens shows it. Not contracted, so that faces that share a cut agree on it.
static inline float2 bend_tangent(global const ViewParams* view, float2 tangent) {
#pragma OPENCL FP_CONTRACT OFF
  const HeldTangent held = hold_tangent(view, tangent);
  const float2 t = held.tangent, q = (float2)(view->tangential[0], view->tangential[1]);
  return t * (radial_factor(view, held) + 2.0f * dot(q, t)) + q * held.radius2;
}

/// From the gradient of where a tangent is shown to that of the tangent.
static inline float2 bend_tangent_backward(global const ViewParams* view, float2 tangent, float2 grad) {
  const HeldTangent held = hold_tangent(view, tangent);
  const float2 t = held.tangent, q = (float2)(view->tangential[0], view->tangential[1]);
  const float r2 = held.radius2;
  const float slope = radial_slope(view, held);
  const float2 g = (radial_factor(view, held) + 2.0f * dot(q, t)) * grad +
                   2.0f * (dot(t, grad) * (slope * t + q) + dot(q, grad) * t);
  // A held tangent moves about the axis only.
  return held.part < 1.0f ? held.part * (g - dot(t, g) / r2 * t) : g;
}

/// The gradients of k1, k2, p1, p2, k3, of a fisheye k1, k2, k3, k4, and zeros. How the radius from which on
/// points are held moves does not count: r R is at its maximum there.
static inline float8 coefficients_gradient(global const ViewParams* view, float2 tangent, float2 grad) {
  const HeldTangent held = hold_tangent(view, tangent);
  const float r2 = held.radius2, along = dot(held.tangent, grad);
  if (view->distorts == DPR_FISHEYE) {
    const float s = held.argument, first = held.stretch * along * s;
    return (float8)(first, first * s, first * s * s, first * s * s * s, 0.0f, 0.0f, 0.0f, 0.0f);
  }
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
