// Typed kernel launches: a wrong number, order or type of arguments does not compile; a signature that
// differs from the kernel's source fails by name when the kernel is made, before its first launch.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <type_traits>

#include "device/buffer.hpp"
#include "device/profile.hpp"
#include "shared_types.h"

namespace dpr {

/// Argument kinds of a kernel signature: `const global T*`, `global T*`; anything else is passed by value.
template <class T>
struct In {};
template <class T>
struct Out {};

/// The OpenCL C name of a type that host and kernels share.
template <class T>
inline constexpr std::string_view k_cl_type_name = T::k_cl_name;
template <>
inline constexpr std::string_view k_cl_type_name<float> = "float";
template <>
inline constexpr std::string_view k_cl_type_name<cl_uint> = "uint";
template <>
inline constexpr std::string_view k_cl_type_name<cl_uchar> = "uchar";
template <>
inline constexpr std::string_view k_cl_type_name<cl_ulong> = "ulong";
template <>
inline constexpr std::string_view k_cl_type_name<cl_float2> = "float2";
template <>
inline constexpr std::string_view k_cl_type_name<cl_uint2> = "uint2";
template <>
inline constexpr std::string_view k_cl_type_name<cl_float4> = "float4";
template <>
inline constexpr std::string_view k_cl_type_name<cl_uint4> = "uint4";

/// What a kernel's source must say of an argument.
struct ArgumentType {
  std::string name;
  bool is_pointer, is_const;
};

namespace detail {

template <class T>
struct Argument {
  using Value = T;
  static ArgumentType type() { return {std::string(k_cl_type_name<T>), false, false}; }
  static int set(cl::Kernel& kernel, unsigned index, const T& value) {
    return kernel.setArg(index, sizeof(T), &value);
  }
};

template <class T>
struct BufferArgument {
  using Value = BufferRef<T>;
  static int set(cl::Kernel& kernel, unsigned index, const BufferRef<T>& buffer) {
    const cl_mem handle = buffer.handle();
    return kernel.setArg(index, sizeof(handle), &handle);
  }
};

template <class T>
struct Argument<In<T>> : BufferArgument<T> {
  static ArgumentType type() { return {std::string(k_cl_type_name<T>) + "*", true, true}; }
};

template <class T>
struct Argument<Out<T>> : BufferArgument<T> {
  static ArgumentType type() { return {std::string(k_cl_type_name<T>) + "*", true, false}; }
};

/// Throws std::logic_error naming kernel and argument where the source differs from the signature.
void check_signature(const cl::Kernel& kernel, const std::string& name,
                     std::span<const ArgumentType> expected);

}  // namespace detail

/// The options every kernel of a device is built with.
std::string build_options(const Device::Impl& device, const std::string& more = "");

/// Work-items [first, first + count) of a launch; a count alone starts at 0.
struct Range {
  Range(std::size_t count_) : count(count_) {}
  Range(std::size_t first_, std::size_t count_) : first(first_), count(count_) {}
  cl_uint last() const { return static_cast<cl_uint>(first + count); }

  std::size_t first = 0, count = 0;
};

/// One kernel of one program. `Args` are In<T>, Out<T> or value types, in the order of the source.
template <class... Args>
class Kernel {
 public:
  Kernel(Device::Impl& device, std::string_view file, const char* name, const std::string& options = "")
      : device_(&device), file_(file), name_(name) {
    int error = CL_SUCCESS;
    kernel_ = cl::Kernel(device.program(file, build_options(device, options)), name, &error);
    if (error != CL_SUCCESS) throw DeviceError(error, "clCreateKernel " + name_);
    const std::array<ArgumentType, sizeof...(Args)> expected{detail::Argument<Args>::type()...};
    detail::check_signature(kernel_, name_, expected);
  }

  /// Enqueues a range of work-items, rounded up to whole work-groups: kernels guard their range. Nothing for
  /// an empty one.
  void operator()(const Range& range, const typename detail::Argument<Args>::Value&... args) {
    const std::size_t local = device_->local_size();
    enqueue({range.first, (range.count + local - 1) / local * local}, local, args...);
  }

  /// For kernels of one work-item per element, whose work-items help each other on GPUs: in groups of
  /// DPR_GROUP.
  void sharing(std::size_t count, const typename detail::Argument<Args>::Value&... args) {
    if (device_->info.lanes == 1) {
      enqueue((count + DPR_GROUP - 1) / DPR_GROUP * DPR_GROUP, DPR_GROUP, args...);
    } else {
      (*this)(count, args...);
    }
  }

  /// For kernels that are written twice: on GPUs a work-group of DPR_GROUP does what on CPUs one work-item
  /// does.
  void in_groups(std::size_t count, const typename detail::Argument<Args>::Value&... args) {
    if (device_->info.lanes == 1) {
      enqueue(count * DPR_GROUP, DPR_GROUP, args...);
    } else {
      (*this)(count, args...);
    }
  }

 private:
  /// Whole groups of `local` work-items.
  void enqueue(const Range& range, std::size_t local, const typename detail::Argument<Args>::Value&... args) {
    if (range.count == 0) return;
    unsigned index = 0;
    (check_argument(detail::Argument<Args>::set(kernel_, index++, args)), ...);
    cl::Event finished;
    const int error = device_->queue.enqueueNDRangeKernel(
        kernel_, cl::NDRange(range.first), cl::NDRange(range.count), cl::NDRange(local), nullptr,
        device_->profile != nullptr ? &finished : nullptr);
    if (error != CL_SUCCESS) {
      throw DeviceError(error, "kernel " + name_ + ", " + std::to_string(range.count) +
                                   " work-items in groups of " + std::to_string(local));
    }
    if (device_->profile != nullptr) device_->profile->record(file_, name_, finished);
  }

  void check_argument(int error) const {
    if (error != CL_SUCCESS) throw DeviceError(error, "clSetKernelArg " + name_);
  }

  Device::Impl* device_;
  std::string file_, name_;
  cl::Kernel kernel_;
};

}  // namespace dpr
