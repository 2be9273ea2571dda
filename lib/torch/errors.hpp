// The library's errors as torch's.
#pragma once

#include <ATen/core/Tensor.h>
#include <c10/util/Exception.h>

#include <exception>
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

}  // namespace dpr::torch_op
