// Exchange between ranks, against the same computed from the whole: the ranks are threads here.
#include "learn/rank_group.hpp"

#include <doctest/doctest.h>
#include <torch/torch.h>

#include <functional>
#include <thread>
#include <vector>

#include "dpr/error.hpp"
#include "learn/batch_norm.hpp"
#include "support/free_port.hpp"
#include "support/messages.hpp"

namespace dpr::test::rank_group_test {
namespace {

using namespace learn;

bool is_without_gloo() {
#ifdef USE_C10D_GLOO
  return false;
#else
  MESSAGE("skipped: a build without libgloo-dev");
  return true;
#endif
}

/// Runs the action once a rank, each in a thread of its own.
void with_ranks(int count, std::chrono::seconds timeout,
                const std::function<void(const RankGroupPtr&)>& action) {
  Ranks ranks;
  ranks.count = count;
  ranks.address = "127.0.0.1";
  ranks.port = free_port();
  ranks.timeout = timeout;
  std::vector<std::thread> threads;
  for (int rank = 0; rank < count; ++rank) {
    ranks.rank = rank;
    threads.emplace_back([&action, ranks] {
      try {
        action(c10::make_intrusive<RankGroup>(ranks));
      } catch (const std::exception& error) {
        FAIL_CHECK(std::string(error.what()));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
}

at::Tensor part_of(const at::Tensor& whole, const Ranks& ranks) {
  const auto size = static_cast<std::size_t>(whole.size(0));
  return whole.slice(0, static_cast<std::int64_t>(ranks.first(size)),
                     static_cast<std::int64_t>(ranks.last(size)));
}

double largest(const at::Tensor& difference) { return difference.abs().max().item<double>(); }

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("rank group: sums, and what rank 0 shares") {
    if (is_without_gloo()) return;
    constexpr int k_ranks = 3;
    std::vector<double> sums(k_ranks);
    std::vector<std::string> shared(k_ranks);
    std::vector<int> any(k_ranks), none(k_ranks);
    with_ranks(k_ranks, std::chrono::seconds(30), [&](const RankGroupPtr& ranks) {
      const auto rank = static_cast<std::size_t>(ranks->ranks().rank);
      const at::Tensor value = torch::full({1}, 1.0 + static_cast<double>(rank), torch::kDouble);
      ranks->sum(value);
      sums[rank] = value.item<double>();
      shared[rank] = ranks->share(rank == 0 ? std::string("a\0b", 3) : "of nobody's interest");
      any[rank] = ranks->any(rank == 2) ? 1 : 0;
      none[rank] = ranks->any(false) ? 1 : 0;
      CHECK(ranks->share("").empty());
    });
    CHECK(sums == std::vector<double>(k_ranks, 6));
    CHECK(shared == std::vector<std::string>(k_ranks, std::string("a\0b", 3)));
    CHECK(any == std::vector<int>(k_ranks, 1));
    CHECK(none == std::vector<int>(k_ranks, 0));
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("rank group: every step of an optimizer on ranks is that on the whole batch") {
    if (is_without_gloo()) return;
    constexpr int k_ranks = 3;
    torch::manual_seed(5);
    const at::Tensor inputs = torch::randn({6, 4}), wanted = torch::randn({6, 2});
    const at::Tensor initial = torch::randn({2, 4});
    const auto train = [&](const RankGroupPtr& ranks) {
      const at::Tensor weight = initial.clone().requires_grad_();
      GradientAverage average(ranks, {weight});
      torch::optim::SGD optimizer({weight}, /*lr=*/0.1);  // Adam would not show a gradient's scale
      for (int step = 0; step < 4; ++step) {
        if (step != 2) optimizer.zero_grad();  // which backward does not need
        const at::Tensor found = part_of(inputs, ranks->ranks()).matmul(weight.t());
        average.backward((found - part_of(wanted, ranks->ranks())).square().mean());
        optimizer.step();
      }
      return weight.detach();
    };
    const at::Tensor whole = train(c10::make_intrusive<RankGroup>(Ranks{}));
    CHECK(largest(whole - initial) > 0.1);
    std::vector<at::Tensor> found(k_ranks);
    with_ranks(k_ranks, std::chrono::seconds(30), [&](const RankGroupPtr& ranks) {
      found[static_cast<std::size_t>(ranks->ranks().rank)] = train(ranks);
    });
    for (const at::Tensor& weight : found) CHECK(largest(weight - whole) < 1e-5);
  }

  // The reference is torch's BatchNorm2d in double precision, on the whole batch in one process.
  TEST_CASE("batch normalisation: of parts on ranks as of the whole, forward and backward") {
    if (is_without_gloo()) return;
    constexpr int k_ranks = 3;
    torch::manual_seed(5);
    // Means far from zero: a variance from sums of squares in single precision would be wrong.
    const at::Tensor images = torch::randn({6, 4, 5, 3}) + 20 * torch::randn({1, 4, 1, 1});
    const at::Tensor slopes = torch::randn({6, 4, 5, 3});
    const at::Tensor scale = torch::rand({4}) + 0.5, shift = torch::randn({4});

    const at::Tensor x = images.to(torch::kDouble).requires_grad_();
    torch::nn::BatchNorm2d reference(4);
    reference->to(torch::kDouble);
    {
      const torch::NoGradGuard guard;
      reference->weight.copy_(scale);
      reference->bias.copy_(shift);
    }
    const at::Tensor expected = reference->forward(x);
    (expected * slopes).sum().backward();

    struct Found {
      at::Tensor y, grad_x, grad_weight, grad_bias, mean, variance;
    };
    std::vector<Found> found(k_ranks);
    with_ranks(k_ranks, std::chrono::seconds(30), [&](const RankGroupPtr& ranks) {
      BatchNorm layer(4);
      layer->share_batches(ranks);
      auto parameters = layer->named_parameters();
      {
        const torch::NoGradGuard guard;
        parameters["weight"].copy_(scale);
        parameters["bias"].copy_(shift);
      }
      const at::Tensor own = part_of(images, ranks->ranks()).clone().requires_grad_();
      const at::Tensor y = layer->forward(own);
      // The loss of the whole is the mean of the ranks' losses, as a step has it.
      GradientAverage average(ranks, layer->parameters());
      average.backward(k_ranks * (y * part_of(slopes, ranks->ranks())).sum());
      const auto buffers = layer->named_buffers();
      found[static_cast<std::size_t>(ranks->ranks().rank)] = {y.detach(),
                                                              own.grad(),
                                                              parameters["weight"].grad().clone(),
                                                              parameters["bias"].grad().clone(),
                                                              buffers["running_mean"],
                                                              buffers["running_var"]};
    });
    std::vector<at::Tensor> y, grad_x;
    for (const Found& rank : found) {
      y.push_back(rank.y);
      grad_x.push_back(rank.grad_x);
      CHECK(largest(rank.grad_weight - reference->weight.grad()) < 1e-4);
      CHECK(largest(rank.grad_bias - reference->bias.grad()) < 1e-4);
      CHECK(largest(rank.mean - reference->running_mean) < 1e-5);
      CHECK(largest(rank.variance - reference->running_var) < 1e-5);
      CHECK(rank.grad_weight.equal(found.front().grad_weight));  // bit by bit
    }
    CHECK(largest(torch::cat(y) - expected) < 1e-4);
    CHECK(largest(torch::cat(grad_x) - x.grad()) < 1e-4);
    // In one process it is torch's layer, whose mean over a part is another.
    BatchNorm alone(4);
    torch::nn::BatchNorm2d same(4);
    CHECK(alone->forward(images).equal(same->forward(images)));
    CHECK(alone->named_buffers()["running_var"].equal(same->running_var));
    CHECK(largest(alone->forward(images.slice(0, 0, 2)) - same->forward(images).slice(0, 0, 2)) > 0.01);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("rank group: a rank that does not answer, and one that never comes") {
    if (is_without_gloo()) return;
    std::string message;
    // Two seconds at least: who comes before rank 0 listens tries again after one.
    with_ranks(2, std::chrono::seconds(3), [&](const RankGroupPtr& ranks) {
      if (ranks->ranks().rank == 1) std::this_thread::sleep_for(std::chrono::seconds(5));
      if (ranks->ranks().rank == 0) message = message_of<Error>([&] { ranks->sum(torch::ones({1})); });
    });
    CHECK(message.starts_with(k_lost_contact));
    CHECK(contains(message, "rank 0 of 2 got \"Timed out"));
    CHECK(contains(message, "within 3 s"));
    Ranks ranks;
    ranks.count = 2;
    ranks.rank = 1;
    ranks.address = "127.0.0.1";
    ranks.port = free_port();
    ranks.timeout = std::chrono::seconds(1);
    message = message_of<Error>([&] { RankGroup{ranks}; });
    CHECK(message.starts_with(k_lost_contact));
    CHECK(contains(message, "127.0.0.1:" + std::to_string(ranks.port)));
    ranks.address = "no-such-machine.invalid";
    CHECK(contains(message_of<Error>([&] { RankGroup{ranks}; }), "MASTER_ADDR"));
  }
}

}  // namespace dpr::test::rank_group_test
