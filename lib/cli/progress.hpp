// Progress of long work: a bar on a terminal, plain lines elsewhere.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace dpr::cli {

class Progress {
 public:
  /// `total` units of work, printed as "step 3 of 9"; `of` is "of at most" where the work may end earlier.
  /// Prints nothing at all if `quiet`.
  Progress(unsigned total, bool quiet, std::string unit = "step", std::string of = "of");
  /// Ends the bar's line.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// To be called after each unit of work, with what there is to say about it.
  void update(unsigned done, const std::string& text);
  /// The same where something else than the number of units may end the work, such as a time limit: `share`,
  /// in [0, 1], is how near the end is.
  void update(unsigned done, double share, const std::string& text);

 private:
  using Clock = std::chrono::steady_clock;

  /// "3 of 9", with the unit.
  std::string count_text(unsigned done) const;
  /// "12 s left", or nothing while there is nothing to tell it from.
  std::string time_left(double share) const;

  unsigned total_;
  std::string unit_, of_;
  bool quiet_, is_terminal_, line_is_open_ = false;
  std::optional<unsigned> printed_tenths_;
  /// Share at the update from which time is counted: earlier runs may have done much of the work, and a
  /// further attempt begins anew.
  double first_share_ = 0, last_share_ = 0;
  Clock::time_point first_time_;
};

/// "45 s", "12 min", "3.5 h".
std::string duration_text(double seconds);

}  // namespace dpr::cli
