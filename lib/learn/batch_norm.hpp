// Batch normalisation of images whose batch is spread over ranks.
#pragma once

#include <torch/torch.h>

#include <cstdint>
#include <utility>

#include "learn/rank_group.hpp"

namespace dpr::learn {

/// torch's BatchNorm2d with its defaults, under the same names. Of images that ranks share it normalises, in
/// training, by mean and variance over all of them, of which every rank has as many: the forward and the
/// backward pass are those of the whole batch (Ioffe and Szegedy 2015). Sends two doubles a channel and pass.
/// libtorch does not export what a class derived from its own would need.
class BatchNormImpl : public torch::nn::Module {
 public:
  explicit BatchNormImpl(std::int64_t channels);

  /// From now on.
  void share_batches(RankGroupPtr ranks) { ranks_ = std::move(ranks); }

  /// [image, channel, row, column]
  at::Tensor forward(const at::Tensor& images);

 private:
  at::Tensor normalise_with_others(const at::Tensor& images);

  RankGroupPtr ranks_;
  at::Tensor weight_, bias_, running_mean_, running_variance_, batches_;
};
TORCH_MODULE(BatchNorm);

}  // namespace dpr::learn
