// Checks kernel signatures against the compiled source.
#include "device/kernel.hpp"

#include <stdexcept>

#include "device/info.hpp"

namespace dpr {

namespace {

/// What a device needs beside the standard options.
std::string quirks(const DeviceInfo& info) {
  // oclgrind 21.10 stops at LLVM intrinsics that only optimised code holds
  // (llvm.experimental.noalias.scope.decl), and takes vectors of 64 bytes for uninitialised when they are
  // function arguments.
  return info.platform == "Oclgrind" ? " -cl-opt-disable -DDPR_NODE_LANES=8" : "";
}

}  // namespace

std::string build_options(const Device::Impl& device, const std::string& more) {
  // -w: compilers remark on vectors wider than the registers; what is worth a warning, the lint test finds.
  return "-cl-std=CL1.2 -cl-kernel-arg-info -w -DDPR_LANES=" + std::to_string(device.info.lanes) +
         quirks(device.info) + more;
}

namespace detail {
namespace {

std::string argument_text(const ArgumentType& type) { return (type.is_const ? "const " : "") + type.name; }

/// Without a name where the program keeps none: that is optional for one not built from source.
ArgumentType argument_in_source(const cl::Kernel& kernel, unsigned index) {
  ArgumentType found;
  std::string name;
  const int error = kernel.getArgInfo(index, CL_KERNEL_ARG_TYPE_NAME, &name);
  if (error == CL_KERNEL_ARG_INFO_NOT_AVAILABLE) return found;
  check_cl(error, "clGetKernelArgInfo");
  cl_kernel_arg_type_qualifier qualifiers = CL_KERNEL_ARG_TYPE_NONE;
  check_cl(kernel.getArgInfo(index, CL_KERNEL_ARG_TYPE_QUALIFIER, &qualifiers), "clGetKernelArgInfo");
  // Compilers differ in spacing ("float *", "float*") and in the tag of a struct.
  for (const char c : name) {
    if (c == '\0') break;
    if (c != ' ') found.name += c;
  }
  if (found.name.starts_with("struct")) found.name.erase(0, std::string_view("struct").size());
  found.is_pointer = found.name.ends_with('*');
  found.is_const = found.is_pointer && (qualifiers & CL_KERNEL_ARG_TYPE_CONST) != 0;
  return found;
}

}  // namespace

void check_signature(const cl::Kernel& kernel, const std::string& name,
                     std::span<const ArgumentType> expected) {
  const auto count = cl_info<CL_KERNEL_NUM_ARGS>(kernel, "clGetKernelInfo");
  if (count != expected.size()) {
    throw std::logic_error("kernel " + name + " has " + std::to_string(count) + " arguments, its signature " +
                           std::to_string(expected.size()));
  }
  for (unsigned index = 0; index < count; ++index) {
    const ArgumentType found = argument_in_source(kernel, index);
    if (found.name.empty()) return;
    const ArgumentType& wanted = expected[index];
    if (found.name != wanted.name || found.is_const != wanted.is_const) {
      throw std::logic_error("kernel " + name + ", argument " + std::to_string(index) + ": the source says " +
                             argument_text(found) + ", the signature " + argument_text(wanted));
    }
  }
}

}  // namespace detail
}  // namespace dpr
