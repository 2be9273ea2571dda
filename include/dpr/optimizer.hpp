// First-order optimizers over a flat vector of parameters, in double precision on the host.
#pragma once

#include <span>
#include <vector>

#include "dpr/export.h"

namespace dpr {

/// uniform_adam: Adam with one second moment for all parameters, the largest, so that steps keep the
/// gradient's direction in the large (Nicolet, Jacobson & Jakob 2021, section 3.4).
enum class OptimizerKind { adam, sgd, uniform_adam };

struct OptimizerOptions {
  OptimizerKind kind = OptimizerKind::adam;
  double learning_rate = 5e-2;  ///< > 0
  double beta1 = 0.9;           ///< Adam's first moment, SGD's momentum; in [0, 1)
  double beta2 = 0.999;         ///< Adam's second moment; in [0, 1)
  double epsilon = 1e-8;        ///< > 0
};

/// State of an optimizer between steps; empty before the first.
struct OptimizerState {
  std::vector<double> first_moment, second_moment;
  unsigned iteration = 0;
};

/// Adam (Kingma & Ba 2015) with bias correction, or SGD with momentum, v <- beta1 v + g.
class DPR_API Optimizer {
 public:
  /// Throws InvalidArgument for options out of range.
  explicit Optimizer(const OptimizerOptions& options);

  /// The step to add to the parameters for this gradient. Throws InvalidArgument if its length changes
  /// between steps or it is not finite.
  std::span<const double> step(std::span<const double> gradient);
  void set_learning_rate(double learning_rate);
  double learning_rate() const { return options_.learning_rate; }
  /// Forgets the moments.
  void restart();

  const OptimizerState& state() const { return state_; }
  /// Goes on where another optimizer was. Throws InvalidArgument if the moments differ in length.
  void set_state(OptimizerState state);

 private:
  OptimizerOptions options_;
  OptimizerState state_;
  std::vector<double> step_;
};

}  // namespace dpr
