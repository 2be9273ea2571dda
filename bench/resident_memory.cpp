#include "resident_memory.hpp"

#include <sys/resource.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <fstream>
#include <string>

namespace dpr::bench {

void reset_peak_resident_bytes() {
#ifdef __GLIBC__
  malloc_trim(0);  // what earlier work has freed is not this one's
#endif
  std::ofstream("/proc/self/clear_refs") << "5";  // proc(5): sets the peak to what is held
}

std::size_t peak_resident_bytes() {
  constexpr std::size_t k_kibibyte = 1024;
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    std::size_t kibibytes = 0;
    if (word == "VmHWM:" && status >> kibibytes) return kibibytes * k_kibibyte;
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::size_t>(usage.ru_maxrss) * k_kibibyte;
}

}  // namespace dpr::bench
