// The library's errors as torch's, and the check of the tensors that are given.
#pragma once

#include <ATen/core/Tensor.h>
#include <c10/util/Exception.h>

#include <exception>
#include <initializer_list>
#include <string>

#include "dpr/error.hpp"

namespace dpr::torch_op {

/// Torch's error, with the library's that it was.
class RenderError : public c10::Error {
 public:
  /// Of the exception that is being handled.
  explicit RenderError(const dpr::Error& error)
      : c10::Error(std::string("dpr: error: ") + error.what(),
                   /*backtrace=*/{}),  // a string, later a pointer
        original_(std::current_exception()) {}
  std::exception_ptr original() const { return original_; }

 private:
  std::exception_ptr original_;
};

/// Runs the action; the library's errors become torch's.
template <typename Action>
auto with_torch_errors(Action action) {
  try {
    return action();
  } catch (const Error& error) {
    throw RenderError(error);
  }
}

/// "[2, 642, 3]"
inline std::string shape_text(const at::Tensor& tensor) {
  std::string text = "[";
  for (const std::int64_t size : tensor.sizes()) text += (text.size() > 1 ? ", " : "") + std::to_string(size);
  return text + "]";
}

/// The tensor itself, if it is contiguous. -1 stands for any size.
inline at::Tensor checked(const at::Tensor& tensor, const std::string& name,
                          std::initializer_list<std::int64_t> shape, const std::string& expected) {
  if (tensor.scalar_type() != at::kFloat || !tensor.device().is_cpu()) {
    throw InvalidArgument(name + " (dpr::render)", tensor.toString(), "a float32 tensor on the CPU");
  }
  bool fits = tensor.dim() == static_cast<std::int64_t>(shape.size());
  for (std::size_t i = 0; fits && i < shape.size(); ++i) {
    const std::int64_t wanted = shape.begin()[i];
    fits = wanted < 0 || tensor.size(static_cast<std::int64_t>(i)) == wanted;
  }
  if (!fits) throw InvalidArgument(name + " (dpr::render)", shape_text(tensor), expected);
  return tensor.contiguous();
}

}  // namespace dpr::torch_op
