#include "stages/reduce.hpp"

namespace dpr {
namespace {

constexpr std::size_t k_slots = 64;  // DPR_REDUCE_SLOTS

std::string options() { return " -DDPR_REDUCE_SLOTS=" + std::to_string(k_slots); }

}  // namespace

Reduce::Reduce(Device::Impl& device)
    : device_(device),
      partial_sums_(device, "reduce.cl", "reduce_partial", options()),
      final_sums_(device, "reduce.cl", "reduce_final", options()) {}

void Reduce::operator()(std::size_t count, std::size_t channels, std::size_t segments, std::size_t stride,
                        const Buffer<cl_uint>& starts, const Buffer<float>& values, Buffer<float>& sums) {
  const auto c = static_cast<cl_uint>(channels), s = static_cast<cl_uint>(segments);
  partial_.resize(device_, channels * segments * k_slots);
  sums.resize(device_, channels * segments);
  partial_sums_(channels * segments * k_slots, static_cast<cl_uint>(count), c, s,
                static_cast<cl_uint>(stride), starts, values, partial_);
  final_sums_(channels * segments, c, s, partial_, sums);
}

std::vector<float> Reduce::read(std::size_t count, std::size_t channels, std::size_t segments,
                                std::size_t stride, const Buffer<cl_uint>& starts,
                                const Buffer<float>& values) {
  (*this)(count, channels, segments, stride, starts, values, sums_);
  return sums_.download();
}

}  // namespace dpr
