// Typed kernel launches. The build makes a struct of every kernel's arguments (cmake/EmbedKernels.cmake). A
// launch with an argument left out, or of another name, order or type, does not compile. Groups are no larger
// than the device allows for the kernel.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <span>
#include <string>

#include "device/buffer.hpp"
#include "device/profile.hpp"
#include "shared_types.h"

namespace dpr {

/// The bytes that clSetKernelArg takes.
struct Argument {
  std::size_t size;
  const void* bytes;
};

/// Members of the structs that the build makes of the kernels (cmake/EmbedKernels.cmake), for `const T`,
/// `const global T*` and `global T*`. None has a default, and each takes its own type alone. K::pick() takes
/// them by name from an object that has those of several kernels.
template <class T>
class Value {
 public:
  template <std::same_as<T> U>
  Value(const U& value) : value_(value) {}
  operator Argument() const { return {sizeof(value_), &value_}; }

 private:
  T value_;
};

template <class T>
class Input {
 public:
  Input(const Buffer<T>& buffer) : handle_(buffer.cl_buffer()()) {}
  Input(const BufferRef<T>& buffer) : handle_(buffer.handle()) {}
  operator Argument() const { return {sizeof(handle_), &handle_}; }

 private:
  cl_mem handle_;
};

template <class T>
class Output {
 public:
  Output(Buffer<T>& buffer) : handle_(buffer.cl_buffer()()) {}
  Output(const BufferRef<T>& buffer) : handle_(buffer.handle()) {}
  operator Argument() const { return {sizeof(handle_), &handle_}; }

 private:
  cl_mem handle_;
};

/// File and name of a kernel, e.g. "scan.cl" and "scan_sum".
struct KernelSource {
  const char *file, *name;
};

/// The options every kernel of a device is built with.
std::string build_options(const Device::Impl& device, const std::string& more = "");

/// True if the device rounds divisions and roots in single precision correctly where it is asked to. OpenCL allows an
/// error of 2.5 ulp where it is not.
bool rounds_divisions(const Device::Impl& device);
/// The option that asks a GPU for that; empty where it cannot. CPUs divide by an instruction that rounds correctly.
std::string division_option(const Device::Impl& device);

/// Work-items [first, first + count) of a launch; a count alone starts at 0.
struct Range {
  Range(std::size_t count_) : count(count_) {}
  Range(std::size_t first_, std::size_t count_) : first(first_), count(count_) {}
  cl_uint last() const { return static_cast<cl_uint>(first + count); }

  std::size_t first = 0, count = 0;
};

namespace detail {

/// A kernel of a program, and its work-groups.
struct BuiltKernel {
  KernelSource source;
  cl::Kernel kernel;
  std::size_t group = 0;  ///< work-items that its source asks for; 0: any number
  std::size_t local = 0;  ///< work-items of the groups that it is launched in
};

/// Builds a kernel; one that asks for larger groups than the device runs it in is built for smaller ones.
/// Throws BuildError and DeviceError.
BuiltKernel build_kernel(Device::Impl& device, const KernelSource& source, const std::string& options);

/// Throws DeviceError.
void set_arguments(cl::Kernel& kernel, const char* name, std::span<const Argument> arguments);

/// Rounds the range up to whole groups. Throws DeviceError.
void enqueue(Device::Impl& device, BuiltKernel& kernel, const Range& range,
             std::span<const Argument> arguments);

}  // namespace detail

template <class K, class... Ks>
concept OneOf = (std::same_as<K, Ks> || ...);

/// Kernels of a device, each by the struct of its arguments: `launch(range, kernel::scan_sum{.count = ...})`.
template <class... Ks>
class Launcher {
 public:
  /// Builds them, in their order. Throws BuildError and DeviceError.
  explicit Launcher(Device::Impl& device, const std::string& options = "")
      : device_(&device), built_{{detail::build_kernel(device, Ks::k_source, options)...}} {}

  /// Enqueues a range of work-items, rounded up to whole work-groups: kernels guard their range. Nothing for
  /// an empty one.
  template <OneOf<Ks...> K>
  void operator()(const Range& range, const K& arguments) {
    detail::enqueue(*device_, built_[k_index<K>], range, arguments.arguments());
  }

  /// Launches a kernel that is written twice: a work-group of a GPU does the work of one work-item of a CPU.
  template <OneOf<Ks...> K>
  void in_groups(std::size_t count, const K& arguments) {
    const std::size_t group = built_[k_index<K>].group;
    (*this)(group > 0 ? count * group : count, arguments);
  }

 private:
  template <class K>
  static constexpr std::size_t k_index = [] {
    std::size_t before = 0;
    static_cast<void>(((std::same_as<K, Ks> || (++before, false)) || ...));
    return before;
  }();

  Device::Impl* device_;
  std::array<detail::BuiltKernel, sizeof...(Ks)> built_;
};

}  // namespace dpr
