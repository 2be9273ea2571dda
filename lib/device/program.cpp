// Builds kernel programs from the embedded sources, and keeps them.
#include <algorithm>
#include <set>

#include "device/context.hpp"
#include "device/info.hpp"
#include "device/kernel.hpp"
#include "device/kernel_sources.hpp"
#include "device/store.hpp"

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
  const std::string include = "#include \"" + std::string(name) + "\"";
  return kernel_file(k_frame_file).find(include) != std::string_view::npos ? k_frame_file : name;
}

/// Options without the size of work-groups.
std::string without_group(std::string options) {
  const std::size_t at = options.find(" -DDPR_GROUP=");
  if (at != std::string::npos) options.erase(at, options.find(' ', at + 1) - at);
  return options;
}

std::string build_log(const cl::Program& program, const cl::Device& device) {
  std::string log;
  program.getBuildInfo(device, CL_PROGRAM_BUILD_LOG, &log);
  return log;
}

/// The binary of the one device that the program is built for; empty where the driver has none.
std::string binary_of(const cl::Program& program, const cl::Device& device) {
  std::vector<cl::Device> devices;
  std::vector<std::vector<unsigned char>> binaries;
  if (program.getInfo(CL_PROGRAM_DEVICES, &devices) != CL_SUCCESS ||
      program.getInfo(CL_PROGRAM_BINARIES, &binaries) != CL_SUCCESS)
    return "";
  for (std::size_t i = 0; i < std::min(devices.size(), binaries.size()); ++i) {
    if (devices[i]() == device()) return {binaries[i].begin(), binaries[i].end()};
  }
  return "";
}

/// The program of a binary. Null where the driver does not take it.
cl::Program program_of(const std::string& binary, const cl::Context& context, const cl::Device& device,
                       const std::string& options) {
  int error = CL_SUCCESS;
  cl::Program program(context, {device}, {{binary.begin(), binary.end()}}, nullptr, &error);
  return error == CL_SUCCESS && program.build(device, options.c_str()) == CL_SUCCESS ? program
                                                                                     : cl::Program();
}

}  // namespace

std::string program_source(std::string_view file) {
  std::string source;
  std::set<std::string, std::less<>> included;
  append_source(file, included, source);
  return source;
}

cl::Program Device::Impl::build(std::string_view file, const std::string& options) const {
  const std::string source = program_source(file);
  const Store store;
  const bool is_kept = keeps_binaries && store.is_on();
  const std::string key =
      is_kept ? device_key(info) + options + "\n" + std::string(file) + " " + hash_text(source) : "";
  if (const auto binary = is_kept ? store.load(key) : std::nullopt) {
    if (cl::Program known = program_of(*binary, context, device, options); known() != nullptr) return known;
  }
  if (before_work) before_work(file);
  int error = CL_SUCCESS;
  cl::Program program(context, source, false, &error);
  check_cl(error, "clCreateProgramWithSource");
  const auto compile = [&] { return program.build(device, options.c_str()); };
  // oclgrind 21.10's check of initialisation has memory on the thread alone that made the context.
  const int outcome = info.platform == "Oclgrind" ? compile() : on_own_thread(compile);
  if (outcome != CL_SUCCESS) {
    throw BuildError(std::string(file), info.name, options, build_log(program, device));
  }
  if (const std::string binary = is_kept ? binary_of(program, device) : ""; !binary.empty())
    store.save(key, binary);
  return program;
}

const cl::Program& Device::Impl::program(std::string_view name, const std::string& options) {
  const std::scoped_lock lock(mutex_);
  // A file with options of its own is a program of its own. Kernels of a frame in smaller groups come from the
  // frame's source too: two kernels that count and list the same tiles must round alike.
  const bool is_of_frame = without_group(options) == without_group(build_options(*this));
  const std::string_view file = is_of_frame ? program_file(name) : name;
  const std::string key = std::string(file) + " " + options;
  const auto known = programs_.find(key);
  return known != programs_.end() ? known->second
                                  : programs_.emplace(key, build(file, options)).first->second;
}

}  // namespace dpr
