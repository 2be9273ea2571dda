// The device of the tests, and kernels of a test's own with the text of the shared headers in front.
#pragma once

#include <functional>
#include <initializer_list>
#include <limits>
#include <set>
#include <string>
#include <string_view>
#include <type_traits>

#include "device/buffer.hpp"
#include "device/kernel.hpp"
#include "device/kernel_sources.hpp"

namespace dpr::test {

inline const Device& test_device() {
  // Never released: OpenCL implementations may be gone before static objects are.
  static const Device& device = *new Device(open_device());
  return device;
}

inline Device::Impl& device_impl() { return impl_of(test_device()); }

/// Content of output buffers before a launch that should fill them.
inline constexpr float k_poison = std::numeric_limits<float>::quiet_NaN();

template <class T>
void poison(Buffer<T>& buffer, std::size_t count, const T& value) {
  buffer.resize(device_impl(), count);
  buffer.fill(value);
}
inline void poison(Buffer<float>& buffer, std::size_t count) { poison(buffer, count, k_poison); }

/// The planes of fragments of a frame (DPR_PLANE_...), all of them poisoned but for those given, of as many
/// fragments each; `size` is that of a plane.
inline void set_planes(Buffer<float>& buffer, std::size_t size,
                       const std::vector<std::pair<std::size_t, std::vector<float>>>& planes) {
  std::vector<float> all((DPR_PLANE_BASE + 3) * size, k_poison);
  for (const auto& [plane, values] : planes)
    std::ranges::copy(values, all.begin() + static_cast<std::ptrdiff_t>(plane * size));
  buffer.upload(device_impl(), all);
}

/// A kernel file with what it includes in place, but for what `included` names: each file once.
inline std::string header_text(std::string_view name, std::set<std::string, std::less<>>& included) {
  if (!included.emplace(name).second) return {};
  std::string_view text = kernel_file(name);
  constexpr std::string_view k_include = "#include \"";
  std::string out;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size() - 1);
    const std::string_view line = text.substr(0, end + 1);
    text.remove_prefix(end + 1);
    if (!line.starts_with(k_include)) {
      out += line;
    } else {
      const std::size_t quote = line.find('"', k_include.size());
      out += header_text(line.substr(k_include.size(), quote - k_include.size()), included);
    }
  }
  return out;
}

/// A kernel file with all it includes.
inline std::string header_text(std::string_view name) {
  std::set<std::string, std::less<>> included;
  return header_text(name, included);
}

/// One kernel, `probe`, of a program made of headers and a text. Arguments are not checked.
class Probe {
 public:
  Probe(std::initializer_list<std::string_view> headers, const std::string& text,
        const std::string& options = "") {
    std::string source;
    std::set<std::string, std::less<>> included;
    for (const std::string_view header : headers) source += header_text(header, included);
    Device::Impl& device = device_impl();
    const std::string all_options = build_options(device, options);
    const cl::Program program(device.context, source + text, false);
    if (program.build(device.device, all_options.c_str()) != CL_SUCCESS) {
      std::string log;
      program.getBuildInfo(device.device, CL_PROGRAM_BUILD_LOG, &log);
      throw BuildError("probe", device.info.name, all_options, log);
    }
    int error = CL_SUCCESS;
    kernel_ = cl::Kernel(program, "probe", &error);
    check_cl(error, "clCreateKernel probe");
  }

  /// Buffers or values, in the order of the source.
  template <class... Args>
  void operator()(std::size_t items, const Args&... args) {
    unsigned index = 0;
    (check_cl(set(index++, args), "clSetKernelArg probe"), ...);
    check_cl(
        device_impl().queue.enqueueNDRangeKernel(kernel_, cl::NullRange, cl::NDRange(items), cl::NullRange),
        "probe");
  }

 private:
  template <class T>
  int set(unsigned index, const Buffer<T>& buffer) {
    return kernel_.setArg(index, buffer.cl_buffer());
  }
  template <class T>
  int set(unsigned index, const T& value) {
    return kernel_.setArg(index, sizeof(T), &value);
  }

  cl::Kernel kernel_;
};

}  // namespace dpr::test
