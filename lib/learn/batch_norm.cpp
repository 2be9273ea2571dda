#include "learn/batch_norm.hpp"

namespace dpr::learn {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

constexpr double k_epsilon = 1e-5, k_momentum = 0.1;  // torch's

/// y = (x - mean) / sqrt(variance + eps) weight + bias, where mean and variance are those of x over all
/// ranks.
struct WholeBatchNorm : torch::autograd::Function<WholeBatchNorm> {
  static at::Tensor forward(AutogradContext* context, const at::Tensor& x, const at::Tensor& weight,
                            const at::Tensor& bias, const at::Tensor& mean, const at::Tensor& variance,
                            const RankGroupPtr& ranks) {
    context->save_for_backward({x, weight, mean, variance});
    context->saved_data["ranks"] = c10::IValue::make_capsule(ranks);
    return at::batch_norm(x, weight, bias, mean, variance, /*training=*/false, k_momentum, k_epsilon,
                          /*cudnn_enabled=*/false);
  }

  /// With s = weight / sqrt(variance + eps) and n values of a channel over all ranks,
  /// dL/dx = s (dL/dy - sum(dL/dy) / n - (x - mean) / (variance + eps) sum(dL/dy (x - mean)) / n).
  static variable_list backward(AutogradContext* context, const variable_list& gradients) {
    const auto saved = context->get_saved_variables();
    const at::Tensor &x = saved[0], &weight = saved[1], &mean = saved[2], &variance = saved[3];
    const auto& ranks = static_cast<const RankGroup&>(*context->saved_data["ranks"].toCapsule());
    const at::Tensor inverse = torch::rsqrt(variance + k_epsilon);
    auto [grad_x, grad_weight, grad_bias] =
        at::native_batch_norm_backward(gradients[0].contiguous(), x, weight, mean, variance, mean, inverse,
                                       /*train=*/false, k_epsilon, {true, true, true});
    const at::Tensor sums = torch::stack({grad_weight, grad_bias}).to(torch::kDouble);
    ranks.sum(sums);
    const auto count = static_cast<double>(x.numel() / x.size(1) * ranks.ranks().count);
    const at::Tensor means = (sums / count).to(torch::kFloat);
    const at::Tensor slope = -weight * inverse * inverse * means[0];
    const at::Tensor constant = -weight * inverse * means[1] - slope * mean;
    const auto by_channel = [](const at::Tensor& values) { return values.view({1, -1, 1, 1}); };
    grad_x.add_(by_channel(constant)).addcmul_(x, by_channel(slope));
    return {grad_x, grad_weight, grad_bias, {}, {}, {}};
  }
};

}  // namespace

BatchNormImpl::BatchNormImpl(std::int64_t channels)
    : weight_(register_parameter("weight", torch::ones({channels}))),
      bias_(register_parameter("bias", torch::zeros({channels}))),
      running_mean_(register_buffer("running_mean", torch::zeros({channels}))),
      running_variance_(register_buffer("running_var", torch::ones({channels}))),
      batches_(register_buffer("num_batches_tracked", torch::zeros({}, torch::kLong))) {}

at::Tensor BatchNormImpl::forward(const at::Tensor& images) {
  if (is_training()) batches_.add_(1);
  if (is_training() && ranks_ && !ranks_->is_alone()) return normalise_with_others(images);
  return torch::batch_norm(images, weight_, bias_, running_mean_, running_variance_, is_training(),
                           k_momentum, k_epsilon, /*cudnn_enabled=*/false);
}

at::Tensor BatchNormImpl::normalise_with_others(const at::Tensor& images) {
  at::Tensor mean, variance;
  {
    const torch::NoGradGuard no_gradients;  // WholeBatchNorm has them
    const double ranks = ranks_->ranks().count;
    const auto [own_variance, own_mean] = at::var_mean(images, {0, 2, 3}, /*unbiased=*/false);
    const at::Tensor wide_mean = own_mean.to(torch::kDouble);
    const at::Tensor moments = torch::stack({wide_mean, own_variance + wide_mean.square()});
    ranks_->sum(moments);
    const at::Tensor whole_mean = moments[0] / ranks,
                     whole_variance = moments[1] / ranks - whole_mean.square();
    mean = whole_mean.to(torch::kFloat);
    variance = whole_variance.to(torch::kFloat);
    const double values = ranks * static_cast<double>(images.numel() / images.size(1));
    running_mean_.lerp_(mean, k_momentum);
    running_variance_.lerp_(variance * (values / (values - 1)), k_momentum);
  }
  return WholeBatchNorm::apply(images, weight_, bias_, mean, variance, ranks_);
}

}  // namespace dpr::learn
