// Smoothing from coarse to fine on a fixed schedule.
#pragma once

#include "dpr/export.h"
#include "dpr/smoothing.hpp"

namespace dpr {

/// End of annealing. It begins with the given smoothing and learning rate.
struct AnnealSchedule {
  unsigned levels = 20;             ///< > 0: steps in which the smoothing shrinks, evenly spread
  float sigma_end = 3e-6F;          ///< > 0
  float gamma_end = 1e-3F;          ///< > 0
  double learning_rate_end = 5e-4;  ///< > 0
};

/// Lets sigma, gamma and the learning rate fall geometrically to their end values, one level after another.
/// A value that starts below its end stays. A blur radius given explicitly shrinks with sigma.
class DPR_API AnnealedSmoothing {
 public:
  /// Plans a descent of that many iterations. Throws InvalidArgument for a schedule out of range.
  AnnealedSmoothing(const AnnealSchedule& schedule, unsigned iterations, const Smoothing& start,
                    double learning_rate);

  /// To be called once an iteration. Returns true if the next iteration belongs to another level; `smoothing`
  /// and `learning_rate` are then that level's.
  bool update(unsigned iteration, Smoothing& smoothing, double& learning_rate) const;

 private:
  AnnealSchedule schedule_;
  unsigned iterations_;
  Smoothing start_;
  double learning_rate_;
};

}  // namespace dpr
