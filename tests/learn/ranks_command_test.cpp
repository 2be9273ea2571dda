// dpr learn train in several processes: the losses of one, and an end for all where one ends.
#include <doctest/doctest.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "support/command.hpp"
#include "support/free_port.hpp"
#include "support/interruptions.hpp"
#include "support/messages.hpp"
#include "support/network.hpp"
#include "support/process.hpp"

namespace dpr::test::ranks_command_test {
namespace {

using Clock = std::chrono::steady_clock;
using Words = std::vector<std::string>;

bool cannot_run() {
#ifdef USE_C10D_GLOO
  return is_skipped();
#else
  MESSAGE("skipped: a build without libgloo-dev");
  return true;
#endif
}

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

Words operator+(Words first, const Words& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

/// A folder with the data of a few objects.
class DataFolder : public TempDir {
 public:
  DataFolder() {
    REQUIRE(run_command(*this, {"learn", "data", "-o", "data", "--classes", "sofa,car", "--train", "4",
                                "--val", "1", "--test", "1", "--quiet"})
                .status == 0);
  }
};

/// A training with few images. Saving a checkpoint of 370 MB takes longer than its steps.
Words training(const std::string& run, int steps, int checkpoint_every) {
  return {"learn", "train", "--data", "data", "--classes", "sofa,car", "-o", run, "--batch", "4", "--quiet",
          // With more, two runs that round differently are apart after fifty steps, in one process too.
          "--learning-rate", "3e-6", "--steps", std::to_string(steps), "--checkpoint-every",
          std::to_string(checkpoint_every)};
}

/// Runs the words as one of two ranks, as a launcher other than ours would. What it prints on stderr goes to
/// the file err<rank> of the folder.
std::unique_ptr<Process> start_rank(const TempDir& folder, int rank, std::uint16_t port, const Words& words,
                                    const Network* network = nullptr) {
  const std::string address = network != nullptr ? Network::address(0) : "127.0.0.1";
  const Words prefix = network != nullptr ? network->prefix(rank) : Words{};
  const Words variables{"env",
                        "RANK=" + std::to_string(rank),
                        "WORLD_SIZE=2",
                        "MASTER_ADDR=" + address,
                        "MASTER_PORT=" + std::to_string(port),
                        "OMP_NUM_THREADS=1",
                        "OPENBLAS_NUM_THREADS=1",
                        "POCL_MAX_PTHREAD_COUNT=1"};
  return std::make_unique<Process>("/usr/bin/env", folder.path(),
                                   prefix + variables + Words{program_path("DPR_CLI")} + words,
                                   folder / ("err" + std::to_string(rank)));
}

/// The losses in losses.csv.
std::vector<double> losses(const TempDir& folder, const std::string& run) {
  std::ifstream file(folder / run / "losses.csv");
  std::string line;
  std::getline(file, line);
  std::vector<double> result;
  while (std::getline(file, line)) result.push_back(std::stod(line.substr(line.find(',') + 1)));
  return result;
}

/// The processes that a process started.
std::vector<pid_t> children_of(const Process& process) {
  const std::string id = std::to_string(process.id());
  std::ifstream file("/proc/" + id + "/task/" + id + "/children");
  return {std::istream_iterator<pid_t>(file), {}};
}

void wait_for_ranks(const Process& process) {
  while (children_of(process).size() < 2) {
    REQUIRE_FALSE(process.has_ended());
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

/// Waits until the run has a checkpoint, and so is at its work.
void wait_for_checkpoint(const TempDir& folder, const std::string& run, const Process& process) {
  while (!std::filesystem::exists(folder / run / "checkpoint.pt")) {
    REQUIRE_FALSE(process.has_ended());
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("ranks: two follow one with the whole batch, in network namespaces where they can be made") {
    if (cannot_run()) return;
    const DataFolder folder;
    constexpr int k_steps = 20;
    REQUIRE(run_command(folder, training("one", k_steps, 1000), "OMP_NUM_THREADS=1").status == 0);
    const Network network;
    if (!network.is_made()) MESSAGE("no network namespaces: on the loopback interface");
    const std::uint16_t port = free_port();
    std::vector<std::unique_ptr<Process>> ranks;
    for (const int rank : {0, 1}) {
      ranks.push_back(start_rank(folder, rank, port, training("two", k_steps, 1000),
                                 network.is_made() ? &network : nullptr));
    }
    for (const auto& rank : ranks) CHECK(rank->wait() == 0);
    CHECK_MESSAGE(folder.read("err0").empty(), folder.read("err0"));
    const std::vector<double> one = losses(folder, "one"), two = losses(folder, "two");
    REQUIRE(one.size() == k_steps);
    REQUIRE(two.size() == k_steps);
    double worst = 0;
    for (std::size_t i = 0; i < one.size(); ++i) worst = std::max(worst, std::abs(two[i] - one[i]) / one[i]);
    MESSAGE("relative difference of the first loss " << std::abs(two[0] - one[0]) / one[0] << ", of all "
                                                     << worst);
    CHECK(std::abs(two[0] - one[0]) <= 1e-6 * one[0]);
    CHECK(worst <= 1e-4);
    // Rank 0's checkpoint is read by any number of ranks.
    const Words further = training("two", k_steps + 2, 1000);
    REQUIRE(run_command(folder, further).status == 0);
    CHECK(losses(folder, "two").size() == k_steps + 2);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("ranks: one of them killed ends the others, and the next run has the same losses in the end") {
    if (cannot_run()) return;
    const DataFolder folder;
    const auto words = [](const std::string& run) { return training(run, 6, 3) + Words{"--ranks", "2"}; };
    const Clock::time_point start = Clock::now();
    REQUIRE(run_command(folder, words("undisturbed")).status == 0);
    const double undisturbed = seconds_since(start);
    const std::string expected = folder.read("undisturbed/losses.csv");
    std::mt19937 generator(7);
    for (int time = 0; time < 2; ++time) {
      const std::string run = "run" + std::to_string(time);
      const double share = static_cast<double>(generator()) / static_cast<double>(std::mt19937::max());
      Process process(program_path("DPR_CLI"), folder.path(), words(run), folder / "err");
      wait_for_ranks(process);
      std::this_thread::sleep_for(std::chrono::duration<double>(share * undisturbed));
      const std::vector<pid_t> ranks = children_of(process);
      const bool disturbed = ranks.size() == 2 && kill(ranks[generator() % 2], SIGKILL) == 0;
      const Clock::time_point death = Clock::now();
      const int status = process.wait();
      CAPTURE(run);
      if (disturbed && status != 0) {
        CHECK(status == 1);
        CHECK_MESSAGE(is_error_line(folder.read("err")), folder.read("err"));
        CHECK(contains(folder.read("err"), "got signal 9"));
        CHECK(seconds_since(death) < 30);
        CHECK(temporaries_in(folder / run) <= 1);  // of the one that was killed
      }
      REQUIRE(run_command(folder, words(run)).status == 0);
      CHECK(folder.read(run + "/losses.csv") == expected);
      CHECK(temporaries_in(folder / run) == 0);
      std::filesystem::remove_all(folder / run);
    }
  }

  TEST_CASE("ranks: one that hangs ends all within the time-out") {
    if (cannot_run()) return;
    const DataFolder folder;
    Process process(program_path("DPR_CLI"), folder.path(),
                    training("run", 1000, 2) + Words{"--ranks", "2", "--timeout", "5"}, folder / "err");
    wait_for_checkpoint(folder, "run", process);
    const std::vector<pid_t> ranks = children_of(process);
    REQUIRE(ranks.size() == 2);
    REQUIRE(kill(ranks[1], SIGSTOP) == 0);
    const Clock::time_point stop = Clock::now();
    CHECK(process.wait() == 1);
    CHECK(seconds_since(stop) < 30);  // 5 s, those of a checkpoint, and those that the stopped one is given
    CHECK_MESSAGE(is_error_line(folder.read("err")), folder.read("err"));
    CHECK(contains(folder.read("err"), "contact (dpr learn): rank 0 of 2"));
    CHECK(kill(ranks[1], 0) != 0);  // none is left behind
    CHECK(temporaries_in(folder / "run") == 0);
  }

  TEST_CASE("ranks: a cut link ends both within the time-out; once it is restored they go on") {
    if (cannot_run()) return;
    const Network network;
    if (!network.is_made()) {
      MESSAGE("skipped: no network namespaces");
      return;
    }
    const DataFolder folder;
    const auto start = [&](int rank, std::uint16_t port, int steps) {
      return start_rank(folder, rank, port, training("run", steps, 2) + Words{"--timeout", "5"}, &network);
    };
    std::uint16_t port = free_port();
    auto first = start(0, port, 1000), second = start(1, port, 1000);
    wait_for_checkpoint(folder, "run", *first);
    REQUIRE(network.cut());
    const Clock::time_point cut = Clock::now();
    CHECK(first->wait() == 1);
    CHECK(second->wait() == 1);
    CHECK(seconds_since(cut) < 30);
    for (const char* const err : {"err0", "err1"}) {
      CHECK_MESSAGE(is_error_line(folder.read(err)), folder.read(err));
      CHECK_MESSAGE(contains(folder.read(err), "contact (dpr learn)"), folder.read(err));
    }
    REQUIRE(network.restore());
    const std::size_t steps = losses(folder, "run").size() + 1;
    port = free_port();
    first = start(0, port, static_cast<int>(steps));
    second = start(1, port, static_cast<int>(steps));
    CHECK(first->wait() == 0);
    CHECK(second->wait() == 0);
    CHECK(losses(folder, "run").size() == steps);
  }

  TEST_CASE("ranks: what does not fit together is one line") {
    if (cannot_run()) return;
    const DataFolder folder;
    const auto check_refused = [&](const Words& words, const std::string& variables,
                                   const std::string& part) {
      const Outcome outcome = run_command(folder, words, variables);
      CHECK(outcome.status == 1);
      CHECK_MESSAGE(is_error_line(outcome.err), outcome.err);
      CHECK_MESSAGE(contains(outcome.err, part), outcome.err);
    };
    const Words words = training("run", 4, 2);
    check_refused(words, "RANK=1", "WORLD_SIZE (environment)");
    check_refused(words + Words{"--ranks", "3"}, "", "a multiple of the 3 ranks");
    check_refused(words + Words{"--ranks", "2", "--method", "hard"}, "", "preset");
    const std::uint16_t port = free_port();
    const auto first = start_rank(folder, 0, port, words + Words{"--timeout", "20"});
    const auto second = start_rank(folder, 1, port, words + Words{"--timeout", "20", "--seed", "4"});
    CHECK(second->wait() == 1);
    CHECK(first->wait() == 1);
    CHECK(contains(folder.read("err1"),
                   "rank 1 (dpr learn): got gaussian with seed 4, expected gaussian with "
                   "seed 1 as rank 0"));
    CHECK_MESSAGE(is_error_line(folder.read("err0")), folder.read("err0"));
    CHECK_FALSE(std::filesystem::exists(folder / "run" / "checkpoint.pt"));
  }
}

}  // namespace dpr::test::ranks_command_test
