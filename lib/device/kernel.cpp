// Builds kernels, checks their signatures against the source, and fits their work-groups to the device.
#include "device/kernel.hpp"

#include <algorithm>
#include <stdexcept>

#include "device/info.hpp"
#include "device/kernel_sources.hpp"

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

namespace detail {
namespace {

std::string argument_text(const ArgumentType& type) { return (type.is_const ? "const " : "") + type.name; }

/// Takes the text up to a separator, or all of it, off the front.
std::string_view take_until(std::string_view& text, std::string_view separators) {
  const std::size_t end = std::min(text.find_first_of(separators), text.size());
  const std::string_view taken = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  return taken;
}

/// An argument in the text of a kernel, e.g. "global const uint* restrict counts".
ArgumentType parse_argument(std::string_view text) {
  ArgumentType argument{"", false, false};
  bool is_const = false;
  while (!text.empty() && argument.name.empty()) {
    const std::string_view word = take_until(text, " \n");
    if (word == "const") is_const = true;
    if (word != "const" && word != "global") argument.name = word;
  }
  argument.is_pointer = argument.name.ends_with('*');
  argument.is_const = is_const && argument.is_pointer;
  return argument;
}

/// Compares a signature with every definition of the kernel in its file. The source's text is read, not what
/// the driver says of arguments: drivers spell types in ways of their own ("unsigned int*").
void check_signature(std::string_view file, const std::string& name,
                     std::span<const ArgumentType> signature) {
  const std::string definition = "kernel void " + name + "(";
  std::string_view text = kernel_file(file);
  for (std::size_t at = text.find(definition); at != std::string_view::npos; at = text.find(definition)) {
    text.remove_prefix(at + definition.size());
    std::string_view list = text.substr(0, text.find(')'));
    std::vector<ArgumentType> arguments;
    while (!list.empty()) arguments.push_back(parse_argument(take_until(list, ",")));
    if (arguments.size() != signature.size()) {
      throw std::logic_error("kernel " + name + " has " + std::to_string(arguments.size()) +
                             " arguments, its signature " + std::to_string(signature.size()));
    }
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      const ArgumentType &found = arguments[i], &wanted = signature[i];
      if (found.name != wanted.name || found.is_const != wanted.is_const) {
        throw std::logic_error("kernel " + name + ", argument " + std::to_string(i) + ": the source says " +
                               argument_text(found) + ", the signature " + argument_text(wanted));
      }
    }
  }
}

template <auto property>
auto work_group_info(const cl::Kernel& kernel, const cl::Device& device) {
  int error = CL_SUCCESS;
  const auto value = kernel.getWorkGroupInfo<property>(device, &error);
  check_cl(error, "clGetKernelWorkGroupInfo");
  return value;
}

}  // namespace

BuiltKernel build_kernel(Device::Impl& device, std::string_view file, const std::string& name,
                         const std::string& options, std::span<const ArgumentType> signature) {
  BuiltKernel built;
  for (std::size_t group = device.group_size;; group /= 2) {
    int error = CL_SUCCESS;
    built.kernel = cl::Kernel(device.program(file, options_of(device, options, group)), name.c_str(), &error);
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
  check_signature(file, name, signature);
  return built;
}

}  // namespace detail
}  // namespace dpr
