// The progress bar.
#include "cli/progress.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

namespace dpr::cli {

Progress::Progress(unsigned total, bool quiet, std::string unit, std::string of)
    : total_(total),
      unit_(std::move(unit)),
      of_(std::move(of)),
      quiet_(quiet),
      is_terminal_(isatty(STDOUT_FILENO) != 0) {}

Progress::~Progress() {
  if (line_is_open_) std::printf("\n");
}

void Progress::update(unsigned done, const std::string& text) {
  if (total_ > 0) update(done, static_cast<double>(done) / total_, text);
}

void Progress::update(unsigned done, double share, const std::string& text) {
  if (quiet_) return;
  if (is_terminal_) {
    constexpr std::size_t k_width = 30;
    const std::string bar(static_cast<std::size_t>(k_width * std::clamp(share, 0.0, 1.0)), '#');
    constexpr const char* k_erase_line = "\r\033[K";
    if (share < last_share_ || !line_is_open_) {
      first_share_ = share;
      first_time_ = Clock::now();
    }
    last_share_ = share;
    std::printf("%s[%-30s] %s  %s%s", k_erase_line, bar.c_str(), count_text(done).c_str(),
                time_left(share).c_str(), text.c_str());
    line_is_open_ = true;
    std::fflush(stdout);
    return;
  }
  const auto tenths = static_cast<unsigned>(10 * share);
  if (tenths == printed_tenths_) return;
  printed_tenths_ = tenths;
  std::printf("%s  %s\n", count_text(done).c_str(), text.c_str());
  std::fflush(stdout);
}

std::string Progress::count_text(unsigned done) const {
  return unit_ + " " + std::to_string(done) + " " + of_ + " " + std::to_string(total_);
}

std::string Progress::time_left(double share) const {
  const double seconds = std::chrono::duration<double>(Clock::now() - first_time_).count();
  const double since = share - first_share_;
  return since > 0
             ? (of_ == "of" ? "" : "at most ") + duration_text(seconds * (1 - share) / since) + " left  "
             : "";
}

std::string duration_text(double seconds) {
  constexpr double k_minute = 60, k_hour = 3600, k_few = 1.5;  // up to 90 of the smaller unit
  char text[32];
  if (seconds < k_few * k_minute) {
    std::snprintf(text, sizeof text, "%.0f s", seconds);
  } else if (seconds < k_few * k_hour) {
    std::snprintf(text, sizeof text, "%.0f min", seconds / k_minute);
  } else {
    std::snprintf(text, sizeof text, "%.1f h", seconds / k_hour);
  }
  return text;
}

}  // namespace dpr::cli
