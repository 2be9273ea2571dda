// Builds kernel programs from the embedded sources, and keeps them.
#include <algorithm>
#include <set>

#include "device/context.hpp"
#include "device/info.hpp"
#include "device/kernel.hpp"
#include "device/kernel_sources.hpp"

namespace dpr {
namespace {

/// Copies a kernel file with its includes in place, each once. `#line` keeps the compiler's messages true.
void append_source(std::string_view name, std::set<std::string, std::less<>>& included, std::string& out) {
  included.emplace(name);
  out += "#line 1 \"" + std::string(name) + "\"\n";
  std::string_view text = kernel_file(name);
  constexpr std::string_view k_include = "#include \"";
  for (std::size_t line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size() - 1);
    const std::string_view row = text.substr(0, end + 1);
    text.remove_prefix(end + 1);
    if (!row.starts_with(k_include)) {
      out += row;
      continue;
    }
    const std::string_view file =
        row.substr(k_include.size(), row.find('"', k_include.size()) - k_include.size());
    if (!included.contains(file)) append_source(file, included, out);
    out += "#line " + std::to_string(line + 1) + " \"" + std::string(name) + "\"\n";
  }
}

/// The file to build for a kernel file: those that frame.cl includes share a program.
std::string_view program_file(std::string_view name) {
  constexpr std::string_view k_frame = "frame.cl";
  const std::string include = "#include \"" + std::string(name) + "\"";
  return kernel_file(k_frame).find(include) != std::string_view::npos ? k_frame : name;
}

std::string build_log(const cl::Program& program, const cl::Device& device) {
  std::string log;
  program.getBuildInfo(device, CL_PROGRAM_BUILD_LOG, &log);
  return log;
}

}  // namespace

const cl::Program& Device::Impl::program(std::string_view name, const std::string& options) {
  const std::scoped_lock lock(mutex_);
  // Options of its own make a file a program of its own.
  const std::string_view file = options == build_options(*this) ? program_file(name) : name;
  const std::string key = std::string(file) + " " + options;
  const auto known = programs_.find(key);
  if (known != programs_.end()) return known->second;

  std::string source;
  std::set<std::string, std::less<>> included;
  append_source(file, included, source);
  int error = CL_SUCCESS;
  const cl::Program program(context, source, false, &error);
  check_cl(error, "clCreateProgramWithSource");
  if (on_own_thread([&] { return program.build(device, options.c_str()); }) != CL_SUCCESS) {
    throw BuildError(std::string(file), info.name, options, build_log(program, device));
  }
  return programs_.emplace(key, program).first->second;
}

}  // namespace dpr
