// Work of a frame, in the units of the cost table (costs.hpp).
#pragma once

#include "dpr/renderer.hpp"

namespace dpr::bench {

struct FrameWork {
  double pairs = 0;      ///< (8x8 tile, triangle)
  double fragments = 0;  ///< (pixel, triangle)
  double pixels = 0;     ///< of all views; with noise of the pixel, samples
  /// Slots (fragments, and the background) that aggregation visits, times the nodes or samples at which it
  /// does. 0 for a prior whose rule is not counted here.
  double forward_evaluations = 0, backward_evaluations = 0;
};

/// Counts the renderer's last frame on the host, by the rules of kernels/quadrature.h and the aggregate
/// kernels: nodes of crowded pixels, slots out of reach, clusters of the joint composition. Downloads the
/// fragments. Throws InvalidArgument before the first forward(), and for a frame of several bands, of which
/// only the last one's fragments are there.
FrameWork count_work(const Renderer& renderer);

}  // namespace dpr::bench
