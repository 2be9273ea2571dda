// Loops over many alike things, on the processor's threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <future>
#include <thread>
#include <vector>

namespace dpr {

/// Things of a thread, at least: starting one takes as long as some hundred of them.
inline constexpr std::size_t k_least_of_thread = 1U << 14U;

/// Calls `function(first, last)` with ranges of all of `count` things, some at the same time where there are many.
template <class Function>
void in_parallel(std::size_t count, const Function& function,
                 std::size_t least_of_thread = k_least_of_thread) {
  const std::size_t parts = std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1,
                                                    std::max<std::size_t>(count / least_of_thread, 1));
  std::vector<std::future<void>> others;
  for (std::size_t i = 1; i < parts; ++i)
    others.push_back(std::async(
        [&function, first = count * i / parts, last = count * (i + 1) / parts] { function(first, last); }));
  function(std::size_t{0}, count / parts);
  for (std::future<void>& other : others) other.get();
}

/// The same one by one: `function(i)`.
template <class Function>
void for_each_in_parallel(std::size_t count, const Function& function,
                          std::size_t least_of_thread = k_least_of_thread) {
  const auto in_turn = [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) function(i);
  };
  in_parallel(count, in_turn, least_of_thread);
}

/// Calls `function()`, which does so many things: on a thread of its own, or when the result is waited for.
template <class Function>
std::future<void> aside(std::size_t count, const Function& function) {
  const bool is_small = count < k_least_of_thread;
  return std::async(is_small ? std::launch::deferred : std::launch::async | std::launch::deferred, function);
}

}  // namespace dpr
