// Builds kernels, fits their work-groups to the device, and enqueues them.
#include "device/kernel.hpp"

#include <algorithm>

#include "device/info.hpp"

namespace dpr {

namespace {

/// Compiler options that a device needs beside the standard ones.
std::string quirks(const DeviceInfo& info) {
  // oclgrind 21.10 stops at LLVM intrinsics that only optimised code holds
  // (llvm.experimental.noalias.scope.decl), and takes vectors of 64 bytes for uninitialised when they are
  // function arguments.
  return info.platform == "Oclgrind" ? " -cl-opt-disable -DDPR_NODE_LANES=8" : "";
}

/// The options of kernels in such groups.
std::string options_of(const Device::Impl& device, const std::string& more, std::size_t group) {
  // -w: compilers remark on vectors wider than the registers; what is worth a warning, the lint test finds.
  return "-cl-std=CL1.2 -w -DDPR_LANES=" + std::to_string(device.info.lanes) + quirks(device.info) +
         (group == DPR_GROUP ? "" : " -DDPR_GROUP=" + std::to_string(group)) + more;
}

}  // namespace

std::string build_options(const Device::Impl& device, const std::string& more) {
  return options_of(device, more, device.group_size);
}

bool rounds_divisions(const Device::Impl& device) {
  const auto config =
      cl_info<CL_DEVICE_SINGLE_FP_CONFIG>(device.device, "clGetDeviceInfo CL_DEVICE_SINGLE_FP_CONFIG");
  return (config & CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT) != 0;
}

std::string division_option(const Device::Impl& device) {
  return device.info.lanes == 1 && rounds_divisions(device) ? " -cl-fp32-correctly-rounded-divide-sqrt" : "";
}

namespace detail {
namespace {

template <auto property>
auto work_group_info(const cl::Kernel& kernel, const cl::Device& device) {
  int error = CL_SUCCESS;
  const auto value = kernel.getWorkGroupInfo<property>(device, &error);
  check_cl(error, "clGetKernelWorkGroupInfo");
  return value;
}

}  // namespace

BuiltKernel build_kernel(Device::Impl& device, const KernelSource& source, const std::string& options) {
  const std::string name = source.name;
  BuiltKernel built{.source = source, .kernel = {}};
  for (std::size_t group = device.group_size;; group /= 2) {
    int error = CL_SUCCESS;
    built.kernel =
        cl::Kernel(device.program(source.file, options_of(device, options, group)), source.name, &error);
    if (error != CL_SUCCESS) throw DeviceError(error, "clCreateKernel " + name);
    const std::size_t most = work_group_info<CL_KERNEL_WORK_GROUP_SIZE>(built.kernel, device.device);
    built.group = work_group_info<CL_KERNEL_COMPILE_WORK_GROUP_SIZE>(built.kernel, device.device)[0];
    built.local = built.group > 0 ? built.group : std::min(device.local_size(), most);
    if (built.local <= most && built.local > 0) break;
    if (built.group / 2 < DPR_LEAST_GROUP) {
      throw DeviceError(CL_INVALID_WORK_GROUP_SIZE,
                        "kernel " + name + ", which " + device.info.name + " runs in groups of at most " +
                            std::to_string(most) + " work-items, and needs " +
                            std::to_string(std::max<std::size_t>(built.group, 1)));
    }
  }
  return built;
}

void set_arguments(cl::Kernel& kernel, const char* name, std::span<const Argument> arguments) {
  cl_uint index = 0;
  for (const Argument& argument : arguments) {
    const int error = kernel.setArg(index++, argument.size, argument.bytes);
    if (error != CL_SUCCESS) throw DeviceError(error, std::string("clSetKernelArg ") + name);
  }
}

void enqueue(Device::Impl& device, BuiltKernel& built, const Range& range,
             std::span<const Argument> arguments) {
  if (range.count == 0) return;
  if (device.before_work) device.before_work(built.source.name);
  set_arguments(built.kernel, built.source.name, arguments);
  const std::size_t local = built.local, items = (range.count + local - 1) / local * local;
  cl::Event finished;
  const int error = device.queue.enqueueNDRangeKernel(built.kernel, cl::NDRange(range.first),
                                                      cl::NDRange(items), cl::NDRange(local), nullptr,
                                                      device.profile != nullptr ? &finished : nullptr);
  if (error != CL_SUCCESS) {
    throw DeviceError(error, std::string("kernel ") + built.source.name + ", " + std::to_string(items) +
                                 " work-items in groups of " + std::to_string(local));
  }
  if (device.profile != nullptr) device.profile->record(built.source.file, built.source.name, finished);
}

}  // namespace detail
}  // namespace dpr
