// First-order optimizers over a flat vector of parameters, in double precision on the host.
#pragma once

#include <span>
#include <vector>

namespace dpr {

enum class OptimizerKind { adam, sgd };

struct OptimizerOptions {
  OptimizerKind kind = OptimizerKind::adam;
  double learning_rate = 5e-2;  ///< > 0
  double beta1 = 0.9;           ///< Adam's first moment, SGD's momentum; in [0, 1)
  double beta2 = 0.999;         ///< Adam's second moment; in [0, 1)
  double epsilon = 1e-8;        ///< > 0
};

/// Adam (Kingma & Ba 2015) with bias correction, or SGD with momentum, v <- beta1 v + g.
class Optimizer {
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

 private:
  OptimizerOptions options_;
  std::vector<double> first_moment_, second_moment_, step_;
  unsigned iteration_ = 0;
};

}  // namespace dpr
