// What the operators of the Python package share.
#pragma once

#include <ATen/core/LegacyTypeDispatch.h>
#include <ATen/core/Tensor.h>
#include <ATen/core/dispatch/Dispatcher.h>

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace dpr::torch_op {

using Words = std::vector<std::string>;

/// Throws InvalidArgument for a list, called `name`, of another length.
void require_count(std::size_t count, std::size_t expected, const char* name);

/// The names' gradients out of those of sigma, gamma and alpha. Throws InvalidArgument for another name.
at::Tensor select_smoothing(const at::Tensor& gradients, const Words& names);

/// Calls an operator below the derivatives, whatever computes it there: the renderer, or what traces a graph.
template <typename Function, typename... Arguments>
auto call_operator(const char* name, Function*, Arguments&&... arguments) {
  at::AutoDispatchBelowADInplaceOrView below;
  return c10::Dispatcher::singleton().findSchemaOrThrow(name, "").typed<Function>().call(
      std::forward<Arguments>(arguments)...);
}

}  // namespace dpr::torch_op
