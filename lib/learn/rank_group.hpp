// Communication between ranks while they train, by libtorch's c10d.
#pragma once

#include <torch/torch.h>
#include <torch/version.h>
#if TORCH_VERSION_MAJOR < 2
#include <torch/csrc/distributed/c10d/ProcessGroup.hpp>
#else
#include <torch/csrc/distributed/c10d/Backend.hpp>
#endif

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "learn/ranks.hpp"

namespace dpr::learn {

/// The class that Gloo's exchanges derive from.
#if TORCH_VERSION_MAJOR < 2
using Exchange = c10d::ProcessGroup;
#else
using Exchange = c10d::Backend;
#endif

/// The connections of a rank to the others; none of one that is alone, for which the operations below do
/// nothing. All ranks call the same operations in the same order. Each throws Error, beginning with
/// k_lost_contact, where another rank ended or does not answer within the time-out. For a number of ranks
/// the results are the same bit by bit, in every run and on every rank.
class RankGroup : public torch::CustomClassHolder {
 public:
  /// Waits for the others, as long as the time-out. Throws InvalidArgument in a build without Gloo.
  explicit RankGroup(const Ranks& ranks);

  const Ranks& ranks() const { return ranks_; }
  bool is_alone() const { return ranks_.count == 1; }

  /// Sums over the ranks, in place.
  void sum(at::Tensor values) const;
  /// Begins a sum, which finish() ends; `values` is left alone until then.
  c10::intrusive_ptr<c10d::Work> begin_sum(at::Tensor values) const;
  void finish(c10d::Work& work) const;
  /// True if `here` is true on any rank.
  bool any(bool here) const;
  /// Sends rank 0's bytes to every rank.
  std::string share(std::string bytes) const;

 private:
  Ranks ranks_;
  c10::intrusive_ptr<Exchange> group_;
};

using RankGroupPtr = c10::intrusive_ptr<RankGroup>;

/// Gradients of the mean of the ranks' losses. They are exchanged in buckets, each as soon as the
/// backward pass has the last gradient of it, while that pass goes on.
///
/// Takes the place of c10d::Reducer, whose header includes others that Debian's libtorch 1.13 lacks.
class GradientAverage {
 public:
  /// Every backward pass must reach each parameter once.
  GradientAverage(RankGroupPtr ranks, const std::vector<at::Tensor>& parameters);
  ~GradientAverage();
  GradientAverage(const GradientAverage&) = delete;
  GradientAverage& operator=(const GradientAverage&) = delete;

  /// The backward pass of the mean of the ranks' losses, and the exchange. Replaces earlier gradients.
  void backward(const at::Tensor& loss);

 private:
  struct Bucket;
  void add_bucket(const std::vector<at::Tensor>& parameters);

  RankGroupPtr ranks_;
  /// Each parameter, and its part of a bucket; undefined on a rank that is alone.
  std::vector<std::pair<at::Tensor, at::Tensor>> gradients_;
  std::vector<std::unique_ptr<Bucket>> buckets_;
};

}  // namespace dpr::learn
