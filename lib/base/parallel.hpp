// Loops over many alike things, on the processor's threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <future>
#include <thread>
#include <vector>

namespace dpr {

/// Calls `function(first, last)` with ranges of all of `count` things, some at the same time where there are many.
template <class Function>
void in_parallel(std::size_t count, const Function& function) {
  constexpr std::size_t k_least =
      1U << 14U;  // of a thread: starting one takes as long as some hundred of them
  const std::size_t parts =
      std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, count / k_least + 1);
  std::vector<std::future<void>> others;
  for (std::size_t i = 1; i < parts; ++i)
    others.push_back(std::async(
        [&function, first = count * i / parts, last = count * (i + 1) / parts] { function(first, last); }));
  function(std::size_t{0}, count / parts);
  for (std::future<void>& other : others) other.get();
}

}  // namespace dpr
