#include "torch/package_calls.hpp"

#include <ATen/Functions.h>

#include <array>
#include <cstdint>

#include "base/name_list.hpp"
#include "dpr/error.hpp"

namespace dpr::torch_op {

void require_count(std::size_t count, std::size_t expected, const char* name) {
  if (count == expected) return;
  throw InvalidArgument(name, std::to_string(count) + " elements", std::to_string(expected));
}

at::Tensor select_smoothing(const at::Tensor& gradients, const Words& names) {
  constexpr std::array<std::string_view, 3> k_order{"sigma", "gamma", "alpha"};
  std::vector<at::Tensor> parts{at::empty({0}, at::kFloat)};
  for (const std::string& name : names) {
    const auto place = static_cast<std::int64_t>(position_of(name, k_order, "smoothing (dpr.render)"));
    parts.push_back(gradients.narrow(0, place, 1));
  }
  return at::cat(parts);
}

}  // namespace dpr::torch_op
