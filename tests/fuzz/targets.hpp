// The readers of files as functions of bytes: what libFuzzer feeds, and what the test of the corpora feeds.
#pragma once

#include <span>
#include <string_view>

namespace dpr::fuzz {

struct Target {
  std::string_view name;                   ///< of its corpus in tests/data/fuzz too
  void (*read)(std::string_view content);  ///< throws where the content is refused
};

std::span<const Target> targets();

/// True if the reader takes the content, false if it throws one of the library's errors, in one line that C
/// strings hold whole; everything else goes on to the caller.
bool accepts(const Target& target, std::string_view content);

}  // namespace dpr::fuzz
