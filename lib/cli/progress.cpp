// The progress bar.
#include "cli/progress.hpp"

#include <unistd.h>

#include <cstdio>

namespace dpr::cli {

Progress::Progress(unsigned total, bool quiet)
    : total_(total), quiet_(quiet), is_terminal_(isatty(STDOUT_FILENO) != 0) {}

Progress::~Progress() {
  if (line_is_open_) std::printf("\n");
}

void Progress::update(unsigned done, const std::string& text) {
  if (quiet_ || total_ == 0) return;
  if (is_terminal_) {
    constexpr unsigned k_width = 30;
    const std::string bar(k_width * done / total_, '#');
    constexpr const char* k_erase_line = "\r\033[K";
    std::printf("%s[%-30s] %u/%u  %s", k_erase_line, bar.c_str(), done, total_, text.c_str());
    line_is_open_ = true;
    std::fflush(stdout);
    return;
  }
  const unsigned tenths = 10 * done / total_;
  if (tenths == printed_tenths_) return;
  printed_tenths_ = tenths;
  std::printf("%u/%u  %s\n", done, total_, text.c_str());
  std::fflush(stdout);
}

}  // namespace dpr::cli
