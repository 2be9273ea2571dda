// Builds kernel programs from the embedded sources, and keeps them.
#include <algorithm>
#include <set>

#include "device/context.hpp"
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

std::string build_log(const cl::Program& program, const cl::Device& device) {
  std::string log;
  program.getBuildInfo(device, CL_PROGRAM_BUILD_LOG, &log);
  return log;
}

}  // namespace

const cl::Program& Device::Impl::program(std::string_view kernel_file, const std::string& options) {
  const std::scoped_lock lock(mutex_);
  const std::string key = std::string(kernel_file) + " " + options;
  const auto known = programs_.find(key);
  if (known != programs_.end()) return known->second;

  std::string source;
  std::set<std::string, std::less<>> included;
  append_source(kernel_file, included, source);
  int error = CL_SUCCESS;
  const cl::Program program(context, source, false, &error);
  check_cl(error, "clCreateProgramWithSource");
  if (program.build(device, options.c_str()) != CL_SUCCESS) {
    throw BuildError(std::string(kernel_file), info.name, options, build_log(program, device));
  }
  return programs_.emplace(key, program).first->second;
}

}  // namespace dpr
