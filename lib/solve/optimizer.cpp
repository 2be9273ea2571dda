// Adam and SGD with momentum.
#include "dpr/optimizer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/checks.hpp"

namespace dpr {
namespace {

void require_learning_rate(double learning_rate) {
  require(learning_rate > 0 && std::isfinite(learning_rate), "learning_rate (optimizer)", learning_rate,
          "a finite number above 0");
}

}  // namespace

Optimizer::Optimizer(const OptimizerOptions& options) : options_(options) {
  require_learning_rate(options.learning_rate);
  checks::require_enumerator(options.kind, OptimizerKind::uniform_adam, "kind (optimizer)");
  require(options.beta1 >= 0 && options.beta1 < 1, "beta1 (optimizer)", options.beta1, "a number in [0, 1)");
  require(options.beta2 >= 0 && options.beta2 < 1, "beta2 (optimizer)", options.beta2, "a number in [0, 1)");
  require(options.epsilon > 0 && std::isfinite(options.epsilon), "epsilon (optimizer)", options.epsilon,
          "a finite number above 0");
}

std::span<const double> Optimizer::step(std::span<const double> gradient) {
  auto& [first, second, iteration] = state_;
  if (iteration == 0) {
    for (auto* moment : {&first, &second}) moment->assign(gradient.size(), 0.0);
  }
  step_.resize(first.size());
  require(gradient.size() == step_.size(), "length of the gradient (optimizer)", gradient.size(),
          "the same length in every step");
  const auto wrong = std::ranges::find_if(gradient, [](double g) { return !std::isfinite(g); });
  require(wrong == gradient.end(), "gradient (optimizer)", wrong == gradient.end() ? 0.0 : *wrong,
          "finite numbers");

  ++iteration;
  const bool is_sgd = options_.kind == OptimizerKind::sgd;
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    const double g = gradient[i];
    first[i] = options_.beta1 * first[i] + (is_sgd ? g : (1 - options_.beta1) * g);
    second[i] = options_.beta2 * second[i] + (1 - options_.beta2) * g * g;
  }
  // Kingma & Ba 2015, Algorithm 1; the corrections undo the bias of moments that start at zero.
  const double correction1 = 1 - std::pow(options_.beta1, iteration);
  const double correction2 = 1 - std::pow(options_.beta2, iteration);
  const double largest = second.empty() ? 0.0 : *std::ranges::max_element(second);
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    const double moment = options_.kind == OptimizerKind::uniform_adam ? largest : second[i];
    const double scale = std::sqrt(moment / correction2) + options_.epsilon;
    step_[i] = -options_.learning_rate * (is_sgd ? first[i] : first[i] / correction1 / scale);
  }
  return step_;
}

void Optimizer::set_learning_rate(double learning_rate) {
  require_learning_rate(learning_rate);
  options_.learning_rate = learning_rate;
}

void Optimizer::restart() { state_ = {}; }

void Optimizer::set_state(OptimizerState state) {
  require(state.first_moment.size() == state.second_moment.size(), "length of the moments (optimizer)",
          state.second_moment.size(), "that of the first moment");
  const auto is_finite = [](double moment) { return std::isfinite(moment); };
  if (!std::ranges::all_of(state.first_moment, is_finite) ||
      !std::ranges::all_of(state.second_moment, is_finite))
    throw InvalidArgument("moments (optimizer)", "numbers that are not finite", "finite ones");
  state_ = std::move(state);
}

}  // namespace dpr
