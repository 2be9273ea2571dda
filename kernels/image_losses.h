// Every loss between an image and its target, for host and kernels. A loss is a file, loss_<name>.h, and a
// name in the list:
//
//   enum { <name>_sums,          how many numbers it sums over the pixels of a view
//          <name>_reads_alpha }  1: it counts only where the target has a silhouette
//
// on the device
//
//   <name>_add(pixel, sums)               writes what a pixel adds to them
//   <name>_gradient(weight, pixel, sums)  weight times its derivative by the pixel's RGBA, from the sums of
//                                         the view; of RGB, times the number of pixels and colour channels
//                                         of a view
//
// and on the host
//
//   <name>_value(weight, sums, channels)  weight times the loss of a view of so many pixels times colour
//                                         channels
//
// Pixels that a mask weighs count as so many pixels.
#ifndef DPR_IMAGE_LOSSES_H
#define DPR_IMAGE_LOSSES_H

#ifndef __OPENCL_C_VERSION__
namespace dpr::shared {
#endif

#ifdef __OPENCL_C_VERSION__
/// A pixel's inputs to losses.
typedef struct {
  float4 image, target;  // RGBA
  float inverse_scale_squared;
} LossPixel;
#endif

#include "loss_l1.h"
#include "loss_mse.h"
#include "loss_robust.h"
#include "loss_silhouette.h"
#include "loss_ssim.h"

/// In the order of dpr::LossKind.
#define DPR_IMAGE_LOSSES(X) X(mse) X(l1) X(silhouette) X(robust) X(ssim)

/// Their numbers.
#define DPR_LOSS_NUMBER(name) name##_number,
enum { DPR_IMAGE_LOSSES(DPR_LOSS_NUMBER) DPR_LOSS_COUNT };

#ifndef __OPENCL_C_VERSION__
}  // namespace dpr::shared
#endif
#endif
