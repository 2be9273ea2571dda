// Normal equations of hypotheses about an object's pose, and the light that explains each best: sums over the
// pixels, from which the host makes the next light and the next step; and means of samples. reduce.cl adds the
// slots.
//
// A pixel of coverage a, colour c and unit normal n is modelled in each channel as
//
//   c sum_k l_k Y_k(n) + o a + background (1 - a)
//
// with the basis Y of harmonic_basis(), nine polynomials that hold the irradiance of any distant light, or the
// first of them alone, and o reflected whatever the colour. The terms t of a channel are the factors of l and
// o. Without terms the image is taken as it is.
//
// The loss is that of loss_robust.h. Its weights w are those of the squares that have its derivative
// (iteratively reweighted least squares).
//
// Kernels of sums have one work-item per vector of slots, of a view, and of a part that each names. A slot
// sums pixels of its view as in reduce.cl: every slots-th on a GPU, those of a run on a CPU. Deterministic.
// in   pixels     of a view
// in   views      that are summed
// in   slots      a multiple of the widest vector
// in   background RGB, which shows where the object does not, if the light has terms; W: 1 where the target itself
//                 shows there instead, which leaves a (the model over black - the target), with or without terms
// in   active     uint[views]  the numbers of those that are summed, of all that there are
// in   fits       float[view][DPR_FIT_LENGTH]  1 / scale^2 of the robust loss, 0: squares; [channel][term] light
// in   colors     float4[view][pixel]  RGBA; if the light has terms without light, over black
// in   normals    float4[view][pixel]  as colours, over black; of harmonics alone
// in   target     float4[pixel]        RGBA
// in   weights    float[pixel]         how much a pixel counts
//      residuals  float[view][4][pixel]             RGB in their light less the target's; w
//      lit        float[direction][view][3][pixel]  derivatives J of RGB in their light
//      left       float[direction][view][3][pixel]  J less what the light makes up for, P
// out  sums       float[sum][view][slot]
#include "normal_sums.h"

/// Residuals, their weights and losses. One part.
kernel void normal_loss(const uint pixels, const uint views, const uint slots, const float4 background,
                        global const uint* restrict active, global const float* restrict fits,
                        global const float4* restrict colors, global const float4* restrict normals,
                        global const float4* restrict target, global const float* restrict weights,
                        global float* restrict residuals, global float* restrict sums) {
  const Slots s = make_slots(pixels, views, slots);
  if (s.part >= 1) return;
  const size_t view = active[s.view];
  global const float* fit = fits + view * DPR_FIT_LENGTH;
  realn loss = 0.0f;
  for (uint i = s.first; i < s.last; i += s.step) {
    const PixelsN image = load_pixels(i, s.last, colors + view * pixels);
    const Vec3n wanted = load_pixels(i, s.last, target).color;
#if DPR_TERMS == 0
    (void)normals;
    const realn compared = background.w == 0.0f ? (realn)(1.0f) : image.alpha;
    const Vec3n residual = mad3n(wanted, -compared, image.color);
#else
    const Vec3n behind = behind_object(background, wanted);
    Vec3n residual = sub3n(behind, wanted);
    if (any_lane(image.alpha > 0.0f)) {
      const Facing facing = load_facing(i, s.last, normals + view * pixels);
      const Vec3n lit = mul3n(image.color, shade(facing.basis, fit + 1));
      residual = mad3n(sub3n(light_at(fit + 1, DPR_FACTORS), behind), image.alpha,
                       sub3n(lit, sub3n(wanted, behind)));
    }
#endif
    const realn mask = load_run(lanes_before(s.last, i), i, weights), squared = dot3n(residual, residual);
    const realn slope = 1.0f / mad(squared, (realn)(fit[0]), (realn)(1.0f));
    loss += mask * slope * squared;
    global float* planes = residuals + 4 * view * pixels;
    store_planes(residual, i, s.last, pixels, planes);
    store_run(mask * square(slope), i, s.last, planes + 3 * (size_t)pixels);
  }
  store_sum(loss, 0, s, views, slots, sums);
}

#if DPR_TERMS > 0
#define DPR_LIGHT_PRODUCTS DPR_TRIANGLE(DPR_TERMS)
#define DPR_LIGHT_SUMS (DPR_LIGHT_PRODUCTS + 2 * DPR_TERMS)

/// Channels that a work-item sums, numbers of each, and where those that are not products begin: on a GPU, whose
/// registers hold no more, products or others of one channel.
#if DPR_WIDTH == 1
#define DPR_FIT_CHANNELS 1
#define DPR_FIT_ROOM (DPR_LIGHT_PRODUCTS + 1)
#define DPR_FIT_OTHERS 0
#else
#define DPR_FIT_CHANNELS 3
#define DPR_FIT_ROOM DPR_LIGHT_SUMS
#define DPR_FIT_OTHERS DPR_LIGHT_PRODUCTS
#endif

/// Sums of the light's least squares, behind the loss. Each channel sums w t t^T, its lower triangle;
/// w t; and w t y, y being the target less the background that shows. Parts are the first of the channels, then
/// the others, on a GPU, else all are one.
kernel void normal_light(const uint pixels, const uint views, const uint slots, const float4 background,
                         global const uint* restrict active, global const float4* restrict colors,
                         global const float4* restrict normals, global const float4* restrict target,
                         global const float* restrict residuals, global float* restrict sums) {
  const Slots s = make_slots(pixels, views, slots);
  if (s.part >= (DPR_WIDTH == 1 ? 6 : 1)) return;
  const uint first_channel = s.part % 3;
  const int has_products = DPR_WIDTH != 1 || s.part < 3, has_others = DPR_WIDTH != 1 || s.part >= 3;
  const size_t view = active[s.view];
  realn sum[DPR_FIT_CHANNELS * DPR_FIT_ROOM];
  DPR_UNROLL_ON_GPU
  for (uint k = 0; k < DPR_FIT_CHANNELS * DPR_FIT_ROOM; ++k) sum[k] = 0.0f;
  for (uint i = s.first; i < s.last; i += s.step) {
    const PixelsN image = load_pixels(i, s.last, colors + view * pixels);
    if (!any_lane(image.alpha > 0.0f)) continue;  // there all terms are 0
    const Vec3n there = load_pixels(i, s.last, target).color, behind = behind_object(background, there);
    const Vec3n wanted = mad3n(behind, image.alpha, sub3n(there, behind));
    const realn weight = load_run(lanes_before(s.last, i), i, residuals + (4 * view + 3) * pixels);
    const Facing facing = load_facing(i, s.last, normals + view * pixels);
    for (uint c = 0; c < DPR_FIT_CHANNELS; ++c) {
      const realn color = channel_of(image.color, first_channel + c);
      realn terms[DPR_TERMS], *const of_channel = sum + c * DPR_FIT_ROOM;
      DPR_UNROLL_ON_GPU
      for (uint k = 0; k < DPR_FACTORS; ++k) terms[k] = color * facing.basis[k];
      terms[DPR_FACTORS] = image.alpha;
      DPR_UNROLL_ON_GPU
      for (uint k = 0; k < DPR_TERMS; ++k) {
        const realn term = weight * terms[k];
        if (has_products) {
          DPR_UNROLL_ON_GPU
          for (uint l = 0; l <= k; ++l) of_channel[DPR_TRIANGLE(k) + l] += term * terms[l];
        }
        if (has_others) {
          of_channel[DPR_FIT_OTHERS + k] += term;
          of_channel[DPR_FIT_OTHERS + DPR_TERMS + k] += term * channel_of(wanted, first_channel + c);
        }
      }
    }
  }
  DPR_UNROLL_ON_GPU
  for (uint c = 0; c < DPR_FIT_CHANNELS; ++c) {
    const uint number = 1 + (first_channel + c) * DPR_LIGHT_SUMS;
    DPR_UNROLL_ON_GPU
    for (uint k = 0; k < DPR_LIGHT_PRODUCTS; ++k) {
      if (has_products) store_sum(sum[c * DPR_FIT_ROOM + k], number + k, s, views, slots, sums);
    }
    DPR_UNROLL_ON_GPU
    for (uint k = 0; k < 2 * DPR_TERMS; ++k) {
      if (has_others)
        store_sum(sum[c * DPR_FIT_ROOM + DPR_FIT_OTHERS + k], number + DPR_LIGHT_PRODUCTS + k, s, views,
                  slots, sums);
    }
  }
}
#endif

/// Number of residuals, of all channels where the object shows, whose size is below thresholds. One part.
/// in   thresholds  float[view][DPR_THRESHOLDS]
kernel void normal_counts(const uint pixels, const uint views, const uint slots,
                          global const float* restrict thresholds, global const float4* restrict colors,
                          global const float* restrict residuals, global float* restrict sums) {
  const Slots s = make_slots(pixels, views, slots);
  if (s.part >= 1) return;
  realn sum[DPR_THRESHOLDS];
  DPR_UNROLL_ON_GPU
  for (uint k = 0; k < DPR_THRESHOLDS; ++k) sum[k] = 0.0f;
  for (uint i = s.first; i < s.last; i += s.step) {
    const realn alpha = load_pixels(i, s.last, colors + (size_t)s.view * pixels).alpha;
    const intn shows = lanes_before(s.last, i) & (alpha > 0.0f);
    if (!any_lane(shows)) continue;
    const Vec3n residual = load_planes(i, s.last, pixels, residuals + 4 * (size_t)s.view * pixels);
    DPR_UNROLL_ON_GPU
    for (uint k = 0; k < DPR_THRESHOLDS; ++k) {
      const realn threshold = thresholds[s.view * DPR_THRESHOLDS + k];
      DPR_UNROLL_ON_GPU
      for (uint c = 0; c < 3; ++c)
        sum[k] += choose(shows & (fabs(channel_of(residual, c)) < threshold), (realn)(1.0f), (realn)(0.0f));
    }
  }
  DPR_UNROLL_ON_GPU
  for (uint k = 0; k < DPR_THRESHOLDS; ++k) store_sum(sum[k], k, s, views, slots, sums);
}

/// Derivatives in the light. One work-item per vector of pixels, view and direction.
/// in   tangents, normal_tangents  float4[direction][view][pixel]  of colors and normals
/// out  lit
kernel void normal_lit(const uint pixels, const uint views, const float4 background,
                       global const float* restrict fits, global const float4* restrict colors,
                       global const float4* restrict normals, global const float4* restrict target,
                       global const float4* restrict tangents, global const float4* restrict normal_tangents,
                       global float* restrict lit) {
  const Moved m = make_moved(pixels, views);
  if (m.image >= DPR_DIRECTIONS * views) return;
  const PixelsN moved = load_pixels(m.first, pixels, tangents + m.image * pixels);
  const Vec3n wanted = load_pixels(m.first, pixels, target).color;
  Vec3n tangent = moved.color;
#if DPR_TERMS == 0
  (void)fits, (void)colors, (void)normals, (void)normal_tangents;
  if (background.w != 0.0f) tangent = mad3n(wanted, -moved.alpha, tangent);
#else
  const size_t view = m.view;
  const PixelsN image = load_pixels(m.first, pixels, colors + view * pixels);
  if (any_lane(image.alpha > 0.0f) || any_lane(moved.alpha != 0.0f)) {  // elsewhere nothing shows
    global const float* light = fits + view * DPR_FIT_LENGTH + 1;
    const Facing facing = load_facing(m.first, pixels, normals + view * pixels);
    tangent = mad3n(sub3n(light_at(light, DPR_FACTORS), behind_object(background, wanted)), moved.alpha,
                    mul3n(tangent, shade(facing.basis, light)));
#if DPR_FACTORS == DPR_HARMONICS
    // The derivative of n / |n| is a symmetric matrix: its product with a gradient is that with a tangent.
    const Vec3n turned =
        normalize3n_backward(facing.normal, facing.inverse_length,
                             load_pixels(m.first, pixels, normal_tangents + m.image * pixels).color);
    realn basis[DPR_HARMONICS];
    harmonic_basis_tangent(facing.normal, turned, basis);
    tangent = mad3n(mul3n(image.color, shade(basis, light)), (realn)(1.0f), tangent);
#else
    (void)normal_tangents;
#endif
  }
#endif
  store_planes(tangent, m.first, pixels, pixels, lit + 3 * m.image * pixels);
}

#if DPR_TERMS > 0
/// Products w t J, from which the host finds the part of a direction that the light makes up for. Parts are the
/// directions; each sums [channel][term].
kernel void normal_cross(const uint pixels, const uint views, const uint slots,
                         global const float4* restrict colors, global const float4* restrict normals,
                         global const float* restrict residuals, global const float* restrict lit,
                         global float* restrict sums) {
  const Slots s = make_slots(pixels, views, slots);
  if (s.part >= DPR_DIRECTIONS) return;
  const size_t view = s.view;
  Vec3n sum[DPR_TERMS];
  DPR_UNROLL_ON_GPU
  for (uint k = 0; k < DPR_TERMS; ++k) sum[k] = zero3n();
  for (uint i = s.first; i < s.last; i += s.step) {
    const PixelsN image = load_pixels(i, s.last, colors + view * pixels);
    if (!any_lane(image.alpha > 0.0f)) continue;
    const realn weight = load_run(lanes_before(s.last, i), i, residuals + (4 * view + 3) * pixels);
    const Vec3n tangent =
        scale3n(load_planes(i, s.last, pixels, lit + 3 * ((size_t)s.part * views + view) * pixels), weight);
    const Vec3n of_color = mul3n(image.color, tangent);
    const Facing facing = load_facing(i, s.last, normals + view * pixels);
    DPR_UNROLL_ON_GPU
    for (uint k = 0; k < DPR_FACTORS; ++k) sum[k] = mad3n(of_color, facing.basis[k], sum[k]);
    sum[DPR_FACTORS] = mad3n(tangent, image.alpha, sum[DPR_FACTORS]);
  }
  DPR_UNROLL_ON_GPU
  for (uint k = 0; k < DPR_TERMS; ++k) {
    const uint number = s.part * 3 * DPR_TERMS + k;
    store_sum(sum[k].x, number, s, views, slots, sums);
    store_sum(sum[k].y, number + DPR_TERMS, s, views, slots, sums);
    store_sum(sum[k].z, number + 2 * DPR_TERMS, s, views, slots, sums);
  }
}

/// Takes the part that the light makes up for from the derivatives, which leaves those of the residuals in the
/// best light (variable projection: Golub and Pereyra 1973, in the approximation of Kaufman 1975). One work-item
/// per vector of pixels, view and direction.
/// in   taken  float[direction][view][channel][term]  change of the light
/// out  left
kernel void normal_left(const uint pixels, const uint views, global const float* restrict taken,
                        global const float4* restrict colors, global const float4* restrict normals,
                        global const float* restrict lit, global float* restrict left) {
  const Moved m = make_moved(pixels, views);
  if (m.image >= DPR_DIRECTIONS * views) return;
  global const float* light = taken + m.image * 3 * DPR_TERMS;
  const PixelsN image = load_pixels(m.first, pixels, colors + (size_t)m.view * pixels);
  const size_t place = 3 * m.image * pixels;
  Vec3n rest = load_planes(m.first, pixels, pixels, lit + place);
  if (any_lane(image.alpha > 0.0f)) {
    const Facing facing = load_facing(m.first, pixels, normals + (size_t)m.view * pixels);
    rest = sub3n(rest, mad3n(light_at(light, DPR_FACTORS), image.alpha,
                             mul3n(image.color, shade(facing.basis, light))));
  }
  store_planes(rest, m.first, pixels, pixels, left + place);
}
#endif

/// Rows and columns of the matrices that a work-item sums: on a GPU, whose registers hold no more, one.
#if DPR_WIDTH == 1
#define DPR_SIDE 1
#else
#define DPR_SIDE DPR_DIRECTIONS
#endif

/// The normal equations. With a pixel's residual r they sum w J^T r, then the lower triangles of w J^T P, made
/// symmetric, and of the products of w P^T r with itself, r and J being those of all kinds of residuals. Parts
/// are the elements of a lower triangle on a GPU, else all are one.
/// in   measured, moved  as normal_measured.cl leaves them; not read unless DPR_MEASURED is set
kernel void normal_equations(const uint pixels, const uint views, const uint slots,
                             global const float* restrict residuals, global const float* restrict measured,
                             global const float* restrict lit, global const float* restrict left,
                             global const float* restrict moved, global float* restrict sums) {
  const Slots s = make_slots(pixels, views, slots);
  uint first_row = 0, first_column = s.part;
  while (first_column > first_row) first_column -= ++first_row;
  if (first_row * DPR_SIDE >= DPR_DIRECTIONS) return;
  realn gradient[DPR_SIDE], hessian[DPR_SIDE][DPR_SIDE], scatter[DPR_SIDE][DPR_SIDE];
  DPR_UNROLL_ON_GPU
  for (uint row = 0; row < DPR_SIDE; ++row) {
    gradient[row] = 0.0f;
    DPR_UNROLL_ON_GPU
    for (uint column = 0; column < DPR_SIDE; ++column) hessian[row][column] = scatter[row][column] = 0.0f;
  }
  const size_t view = s.view;
  for (uint i = s.first; i < s.last; i += s.step) {
    ResidualsN tangents[DPR_SIDE], rests[DPR_SIDE];
    realn largest = 0.0f;
    DPR_UNROLL_ON_GPU
    for (uint row = 0; row < DPR_SIDE; ++row) {
      const size_t place = ((first_row + row) * views + view) * pixels;
      global const float* of_measured = moved + DPR_MEASURED_KINDS * place;
      tangents[row] = load_residuals(i, s.last, pixels, lit + 3 * place, of_measured);
      rests[row] = load_residuals(i, s.last, pixels, left + 3 * place, of_measured);
      largest = add_product(largest, tangents[row], tangents[row], 1.0f);
      largest = add_product(largest, rests[row], rests[row], 1.0f);
    }
    if (!any_lane(largest > 0.0f)) continue;  // most pixels show no edge: nothing there depends on the pose
    const ResidualsN residual = load_residuals(i, s.last, pixels, residuals + 4 * view * pixels,
                                               measured + 2 * DPR_MEASURED_KINDS * view * pixels);
    const realn weight = load_run(lanes_before(s.last, i), i, residuals + (4 * view + 3) * pixels);
    realn scores[DPR_SIDE];
    DPR_UNROLL_ON_GPU
    for (uint row = 0; row < DPR_SIDE; ++row) {
      gradient[row] = add_product(gradient[row], residual, tangents[row], weight);
      scores[row] = add_product(0.0f, residual, rests[row], weight);
    }
    DPR_UNROLL_ON_GPU
    for (uint column = 0; column < DPR_SIDE; ++column) {
      ResidualsN tangent = tangents[column], rest = rests[column];
      realn score = scores[column];
#if DPR_SIDE == 1
      const size_t place = (first_column * views + view) * pixels;
      global const float* of_measured = moved + DPR_MEASURED_KINDS * place;
      tangent = load_residuals(i, s.last, pixels, lit + 3 * place, of_measured);
      rest = load_residuals(i, s.last, pixels, left + 3 * place, of_measured);
      score = add_product(0.0f, residual, rest, weight);
#endif
      DPR_UNROLL_ON_GPU
      for (uint row = column; row < DPR_SIDE; ++row) {
        hessian[row][column] =
            add_symmetric_product(hessian[row][column], tangents[row], rests[row], tangent, rest, weight);
        scatter[row][column] += scores[row] * score;
      }
    }
  }
  DPR_UNROLL_ON_GPU
  for (uint row = 0; row < DPR_SIDE; ++row) {
    const uint k = first_row + row;
    if (first_row == first_column) store_sum(gradient[row], k, s, views, slots, sums);
    DPR_UNROLL_ON_GPU
    for (uint column = 0; column <= row; ++column) {
      const uint number = DPR_DIRECTIONS + DPR_TRIANGLE(k) + first_column + column;
      store_sum(hessian[row][column], number, s, views, slots, sums);
      store_sum(scatter[row][column], number + DPR_TRIANGLE(DPR_DIRECTIONS), s, views, slots, sums);
    }
  }
}

/// Means of blocks of samples x samples. One work-item per pixel.
/// in   width    of the means' images; the samples' is a multiple, and so is their height
/// in   pixels   of all images
/// in   image    float4[image][row][column]  samples
/// out  means    float4[image][row][column]
kernel void normal_means(const uint width, const uint samples, const uint pixels,
                         global const float4* restrict image, global float4* restrict means) {
  const uint i = (uint)get_global_id(0);
  if (i >= pixels) return;
  global const float4* block = image + ((size_t)(i / width) * width * samples + i % width) * samples;
  float4 sum = 0.0f;
  for (uint row = 0; row < samples; ++row, block += width * samples) {
    for (uint column = 0; column < samples; ++column) sum += block[column];
  }
  means[i] = sum / (float)(samples * samples);
}
