// A program that is interrupted again and again, at moments of chance, and goes on each time.
#pragma once

#include <doctest/doctest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "support/process.hpp"

namespace dpr::test {

/// A command that goes on from its checkpoint.
struct Resumable {
  std::string program;
  std::filesystem::path folder;
  std::vector<std::string> arguments;
  std::filesystem::path checkpoint;
  /// Looks at what a run left behind that has finished, or that was interrupted.
  std::function<void(bool finished)> check;
  /// Removes what runs leave behind, for a fresh start.
  std::function<void()> clear;
};

/// Hidden temporary files in a folder, which need not be there.
inline std::size_t temporaries_in(const std::filesystem::path& folder) {
  std::size_t count = 0;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(folder, none)) {
    if (entry.path().filename().string().starts_with(".dpr-")) ++count;
  }
  return count;
}

/// Runs the command once undisturbed, and then until it was interrupted so many times, by SIGKILL, SIGTERM or
/// SIGINT, between its start and its end or soon after a checkpoint, by the chances of the seed. Handled
/// signals leave no temporary files, and the last run none at all. Returns how many interruptions came after
/// a checkpoint.
inline unsigned interrupt(const Resumable& command, unsigned times, unsigned seed) {
  using Clock = std::chrono::steady_clock;
  const std::filesystem::path folder = command.checkpoint.parent_path();
  const auto run = [&] { return Process(command.program, command.folder, command.arguments).wait(); };
  const auto start = Clock::now();
  REQUIRE(run() == 0);
  const std::chrono::duration<double> undisturbed = Clock::now() - start;
  command.check(true);
  command.clear();
  std::mt19937 generator(seed);
  constexpr int k_signals[] = {SIGKILL, SIGTERM, SIGINT};
  unsigned interrupted = 0, after_checkpoint = 0;
  for (unsigned runs = 0; interrupted < times; ++runs) {
    REQUIRE(runs < 10 * times);
    const int signal = k_signals[generator() % std::size(k_signals)];
    const double share = static_cast<double>(generator()) / static_cast<double>(std::mt19937::max());
    const std::size_t before = temporaries_in(folder);
    Process process(command.program, command.folder, command.arguments);
    // However busy the machine is now, every second run comes to a checkpoint first.
    const auto has_begun = [&] { return runs % 2 == 0 || std::filesystem::exists(command.checkpoint); };
    while (!has_begun() && !process.has_ended()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    std::this_thread::sleep_for((runs % 2 == 0 ? share : share / 8) * undisturbed);
    process.kill(signal);
    const int end = process.wait();
    CAPTURE(runs);
    CAPTURE(signal);
    REQUIRE((end == 0 || end == -signal));
    CHECK(temporaries_in(folder) <= before + (signal == SIGKILL ? 1 : 0));
    command.check(end == 0);
    if (end == 0) {
      command.clear();
    } else {
      ++interrupted;
      if (std::filesystem::exists(command.checkpoint)) ++after_checkpoint;
    }
  }
  REQUIRE(run() == 0);
  command.check(true);
  CHECK(temporaries_in(folder) == 0);
  return after_checkpoint;
}

}  // namespace dpr::test
