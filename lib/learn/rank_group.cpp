#include "learn/rank_group.hpp"

#include <netdb.h>
#include <sys/socket.h>
#include <torch/csrc/autograd/utils/lambda_post_hook.h>
#include <torch/csrc/autograd/variable.h>
#include <unistd.h>
#include <torch/csrc/distributed/c10d/PrefixStore.hpp>
#include <torch/csrc/distributed/c10d/ProcessGroupGloo.hpp>
#include <torch/csrc/distributed/c10d/TCPStore.hpp>

#include <cstring>

#include "dpr/error.hpp"

namespace dpr::learn {
namespace {

/// The error of an exchange, without the place in Gloo's sources that it begins with.
Error lost_contact(const Ranks& ranks, const std::string& reason) {
  const std::size_t place = reason.starts_with("[") ? reason.find("] ") : std::string::npos;
  return Error(std::string(k_lost_contact) + ": rank " + std::to_string(ranks.rank) + " of " +
               std::to_string(ranks.count) + " got \"" +
               (place == std::string::npos ? reason : reason.substr(place + 2)) +
               "\", expected every rank's answer within " + std::to_string(ranks.timeout.count()) +
               " s; the last checkpoint stands, and the same command goes on from it");
}

#ifdef USE_C10D_GLOO

std::string endpoint(const Ranks& ranks) { return ranks.address + ":" + std::to_string(ranks.port); }

/// This machine's address on the way to rank 0, in digits: names of machines often stand for their loopback.
std::string own_address(const Ranks& ranks) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  const int error = getaddrinfo(ranks.address.c_str(), std::to_string(ranks.port).c_str(), &hints, &found);
  if (error != 0) {
    throw InvalidArgument("MASTER_ADDR (environment)", ranks.address + " (" + gai_strerror(error) + ")",
                          "the name or the address of rank 0's machine");
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owner(found, freeaddrinfo);
  const int descriptor = socket(found->ai_family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_storage own{};
  socklen_t size = sizeof own;
  char text[NI_MAXHOST] = "";
  // Connecting a socket of datagrams sends nothing.
  const bool known = descriptor >= 0 && connect(descriptor, found->ai_addr, found->ai_addrlen) == 0 &&
                     getsockname(descriptor, reinterpret_cast<sockaddr*>(&own), &size) == 0 &&
                     getnameinfo(reinterpret_cast<sockaddr*>(&own), size, text, sizeof text, nullptr, 0,
                                 NI_NUMERICHOST) == 0;
  if (descriptor >= 0) close(descriptor);
  if (!known)
    throw InvalidArgument("MASTER_ADDR (environment)", ranks.address, "an address with a route to it");
  return text;
}

/// Debian's libtorch has no libuv, which torch 2.4 and later use unless told otherwise.
template <class Options>
void leave_libuv(Options& options) {
  if constexpr (requires { options.useLibUV; }) options.useLibUV = false;
}

c10::intrusive_ptr<c10d::Store> open_store(const Ranks& ranks) {
  c10d::TCPStoreOptions options;
  leave_libuv(options);
  options.port = ranks.port;
  options.isServer = ranks.rank == 0 && !ranks.launcher_listens;
  options.numWorkers = static_cast<std::size_t>(ranks.count);
  options.waitWorkers = !ranks.launcher_listens;
  options.timeout = ranks.timeout;
  const auto store = c10::make_intrusive<c10d::TCPStore>(ranks.address, options);
  return c10::make_intrusive<c10d::PrefixStore>("dpr/" + ranks.restarts, store);
}

c10::intrusive_ptr<Exchange> connect_to_others(const Ranks& ranks) {
  using c10d::ProcessGroupGloo;
  constexpr int k_threads =
      4;  // so that the sums of batch normalisation do not queue behind those of gradients
  const char* const interface = std::getenv("GLOO_SOCKET_IFNAME");  // as torch.distributed reads it
  try {
    const auto options = ProcessGroupGloo::Options::create(ranks.timeout);
    options->threads = k_threads;
    options->devices = {interface != nullptr ? ProcessGroupGloo::createDeviceForInterface(interface)
                                             : ProcessGroupGloo::createDeviceForHostname(own_address(ranks))};
    return c10::make_intrusive<ProcessGroupGloo>(open_store(ranks), ranks.rank, ranks.count, options);
  } catch (const Error&) {
    throw;
  } catch (const c10::Error& error) {
    throw lost_contact(ranks, endpoint(ranks) + ": " + error.what_without_backtrace());
  } catch (const std::exception& error) {
    throw lost_contact(ranks, endpoint(ranks) + ": " + error.what());
  }
}

#else

c10::intrusive_ptr<Exchange> connect_to_others(const Ranks& ranks) {
  throw InvalidArgument("ranks (dpr learn)", std::to_string(ranks.count) + " in a build without Gloo",
                        "a build with it: libgloo-dev, and cmake --preset release");
}

#endif

}  // namespace

RankGroup::RankGroup(const Ranks& ranks) : ranks_(ranks) {
  if (!is_alone()) group_ = connect_to_others(ranks);
}

c10::intrusive_ptr<c10d::Work> RankGroup::begin_sum(at::Tensor values) const {
  std::vector<at::Tensor> list{std::move(values)};
  return group_->allreduce(list);
}

void RankGroup::finish(c10d::Work& work) const {
  try {
    work.wait();
  } catch (const std::exception& error) {
    throw lost_contact(ranks_, error.what());
  }
}

void RankGroup::sum(at::Tensor values) const {
  if (!is_alone()) finish(*begin_sum(std::move(values)));
}

bool RankGroup::any(bool here) const {
  const at::Tensor count = torch::full({1}, here ? 1.0F : 0.0F);
  sum(count);
  return count.item<float>() > 0;
}

std::string RankGroup::share(std::string bytes) const {
  if (is_alone()) return bytes;
  const auto send = [&](at::Tensor tensor) {
    std::vector<at::Tensor> list{std::move(tensor)};
    finish(*group_->broadcast(list));
  };
  const at::Tensor size = torch::full({1}, static_cast<std::int64_t>(bytes.size()), torch::kLong);
  send(size);
  bytes.resize(static_cast<std::size_t>(size.item<std::int64_t>()));
  if (!bytes.empty())
    send(torch::from_blob(bytes.data(), {static_cast<std::int64_t>(bytes.size())}, torch::kUInt8));
  return bytes;
}

struct GradientAverage::Bucket {
  at::Tensor values;        // the gradients of its parameters, one after the other
  std::size_t missing = 0;  // of the backward pass that runs
  c10::intrusive_ptr<c10d::Work> sum;
  /// Autograd nodes that put a gradient in its place; our hooks are on them.
  std::vector<std::shared_ptr<torch::autograd::Node>> accumulators;
};

GradientAverage::GradientAverage(RankGroupPtr ranks, const std::vector<at::Tensor>& parameters)
    : ranks_(std::move(ranks)) {
  constexpr std::int64_t k_bucket_bytes = 25 << 20;  // as torch's DistributedDataParallel
  if (ranks_->is_alone()) {
    for (const at::Tensor& parameter : parameters) gradients_.emplace_back(parameter, at::Tensor());
    return;
  }
  std::vector<at::Tensor> bucket;
  std::int64_t bytes = 0;
  // The last layers have their gradients first.
  for (auto parameter = parameters.rbegin(); parameter != parameters.rend(); ++parameter) {
    const auto size = static_cast<std::int64_t>(parameter->nbytes());
    if (!bucket.empty() && bytes + size > k_bucket_bytes) {
      add_bucket(std::exchange(bucket, {}));
      bytes = 0;
    }
    bucket.push_back(*parameter);
    bytes += size;
  }
  add_bucket(bucket);
}

GradientAverage::~GradientAverage() = default;

void GradientAverage::add_bucket(const std::vector<at::Tensor>& parameters) {
  std::int64_t size = 0;
  for (const at::Tensor& parameter : parameters) size += parameter.numel();
  Bucket& bucket = *buckets_.emplace_back(std::make_unique<Bucket>());
  bucket.values = torch::zeros({size});
  std::int64_t first = 0;
  for (const at::Tensor& parameter : parameters) {
    const at::Tensor part = bucket.values.slice(0, first, first + parameter.numel()).view(parameter.sizes());
    gradients_.emplace_back(parameter, part.variable_data());
    first += parameter.numel();
    bucket.accumulators.push_back(torch::autograd::impl::grad_accumulator(parameter));
    bucket.accumulators.back()->add_post_hook(std::make_unique<torch::autograd::utils::LambdaPostHook>(
        [this, &bucket](const auto& outputs, const auto&) {
          if (--bucket.missing == 0) bucket.sum = ranks_->begin_sum(bucket.values);
          return outputs;
        }));
  }
}

void GradientAverage::backward(const at::Tensor& loss) {
  for (const auto& bucket : buckets_) {
    bucket->values.zero_();
    bucket->missing = bucket->accumulators.size();
  }
  // Optimizer::zero_grad of torch 2 takes gradients away.
  for (auto& [parameter, gradient] : gradients_) parameter.mutable_grad() = gradient;
  (loss / ranks_->ranks().count).backward();
  for (const auto& bucket : buckets_) ranks_->finish(*bucket->sum);
}

}  // namespace dpr::learn
