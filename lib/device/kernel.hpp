// Typed kernel launches: a wrong number, order or type of arguments does not compile; a signature that
// differs from the kernel's source fails by name when the kernel is made, before its first launch. Groups are
// no larger than the device allows for the kernel.
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

/// An argument's type, as a kernel's source has it.
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

/// A kernel of a program, and its work-groups.
struct BuiltKernel {
  cl::Kernel kernel;
  std::size_t group = 0;  ///< work-items that its source asks for; 0: any number
  std::size_t local = 0;  ///< work-items of the groups that it is launched in
};

/// Builds a kernel; one that asks for larger groups than the device runs it in is built for smaller ones.
/// Throws BuildError, DeviceError, and std::logic_error naming kernel and argument where the source differs
/// from the signature.
BuiltKernel build_kernel(Device::Impl& device, std::string_view file, const std::string& name,
                         const std::string& options, std::span<const ArgumentType> signature);

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
    const std::array<ArgumentType, sizeof...(Args)> signature{detail::Argument<Args>::type()...};
    built_ = detail::build_kernel(device, file, name_, options, signature);
  }

  /// Enqueues a range of work-items, rounded up to whole work-groups: kernels guard their range. Nothing for
  /// an empty one.
  void operator()(const Range& range, const typename detail::Argument<Args>::Value&... args) {
    const std::size_t local = built_.local;
    enqueue({range.first, (range.count + local - 1) / local * local}, args...);
  }

  /// Launches a kernel that is written twice: a work-group of a GPU does the work of one work-item of a CPU.
  void in_groups(std::size_t count, const typename detail::Argument<Args>::Value&... args) {
    (*this)(built_.group > 0 ? count * built_.group : count, args...);
  }

 private:
  /// Whole groups.
  void enqueue(const Range& range, const typename detail::Argument<Args>::Value&... args) {
    if (range.count == 0) return;
    if (device_->before_work) device_->before_work(name_);
    unsigned index = 0;
    (check_argument(detail::Argument<Args>::set(built_.kernel, index++, args)), ...);
    cl::Event finished;
    const int error = device_->queue.enqueueNDRangeKernel(
        built_.kernel, cl::NDRange(range.first), cl::NDRange(range.count), cl::NDRange(built_.local), nullptr,
        device_->profile != nullptr ? &finished : nullptr);
    if (error != CL_SUCCESS) {
      throw DeviceError(error, "kernel " + name_ + ", " + std::to_string(range.count) +
                                   " work-items in groups of " + std::to_string(built_.local));
    }
    if (device_->profile != nullptr) device_->profile->record(file_, name_, finished);
  }

  void check_argument(int error) const {
    if (error != CL_SUCCESS) throw DeviceError(error, "clSetKernelArg " + name_);
  }

  Device::Impl* device_;
  std::string file_, name_;
  detail::BuiltKernel built_;
};

}  // namespace dpr
