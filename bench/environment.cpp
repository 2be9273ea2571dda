#include "environment.hpp"

#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>
#include <string_view>
#include <thread>

#include "cli/process.hpp"

namespace dpr::bench {
namespace {

using cli::Json;

/// Prefixes of the variables of PoCL, the ICD loader, this library, oclgrind, Mesa, Intel, NVIDIA and OpenMP.
constexpr std::string_view k_prefixes[] = {"POCL_", "OCL_",     "OPENCL_", "DPR_",  "OCLGRIND_", "RUSTICL_",
                                           "LP_",   "GALLIUM_", "NEO_",    "CUDA_", "OMP_"};

Json variables() {
  Json found = Json::object();
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string_view text(*entry);
    if (std::ranges::none_of(k_prefixes, [&](std::string_view p) { return text.starts_with(p); })) continue;
    const std::size_t end = text.find('=');
    if (end != text.npos) found[std::string(text.substr(0, end))] = std::string(text.substr(end + 1));
  }
  return found;
}

/// Text after a key and a separator in the first such line of a file; empty without one.
std::string value_of(const char* file, const std::string& key, char separator) {
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    const std::size_t at = line.find(separator);
    if (!line.starts_with(key) || at == line.npos) continue;
    const std::size_t begin = line.find_first_not_of(" \t\"", at + 1);
    if (begin == line.npos) return "";
    return line.substr(begin, line.find_last_not_of(" \t\"") + 1 - begin);
  }
  return "";
}

std::string now() {
  const std::time_t time = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm fields{};
  gmtime_r(&time, &fields);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &fields);
  return text;
}

}  // namespace

Json environment() {
  utsname system{};
  uname(&system);
  return {{"date", now()},
          {"host", system.nodename},
          {"os", value_of("/etc/os-release", "PRETTY_NAME", '=')},
          {"kernel", std::string(system.sysname) + " " + system.release},
          {"cpu", value_of("/proc/cpuinfo", "model name", ':')},
          {"cpus", std::thread::hardware_concurrency()},
          {"clock_mhz", std::atof(value_of("/proc/cpuinfo", "cpu MHz", ':').c_str())},
          {"variables", variables()}};
}

double load() {
  double mean = 0;
  return getloadavg(&mean, 1) == 1 ? mean : 0;
}

}  // namespace dpr::bench
