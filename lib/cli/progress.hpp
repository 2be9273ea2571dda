// How far long work has come: a bar on a terminal, plain lines elsewhere.
#pragma once

#include <string>

namespace dpr::cli {

class Progress {
 public:
  /// Prints nothing at all if `quiet`.
  Progress(unsigned total, bool quiet);
  /// Ends the bar's line.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// To be called after each unit of work, with what there is to say about it.
  void update(unsigned done, const std::string& text);

 private:
  unsigned total_;
  bool quiet_, is_terminal_, line_is_open_ = false;
  unsigned printed_tenths_ = 0;
};

}  // namespace dpr::cli
