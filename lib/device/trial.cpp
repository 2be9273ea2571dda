#include "device/trial.hpp"

#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "base/child_process.hpp"
#include "base/module.hpp"
#include "device/context.hpp"
#include "dpr/error.hpp"

namespace dpr {
namespace {

constexpr std::string_view k_runs = "runs ", k_fails = "fails ", k_started = "started";

bool is_switched_off() {
  const char* const wanted = std::getenv("DPR_TRIAL");
  return wanted != nullptr && std::string_view(wanted) == "off";
}

std::string key_of(const DeviceInfo& info) {
  return "trial " + trial_name(info) + " " + std::to_string(trial_seconds()) + "\n" + device_key(info);
}

/// True if a process crashed by itself or took too long, rather than being ended by a user or for want of memory.
bool is_failure(int signal) {
  constexpr std::array k_failures{SIGABRT, SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGALRM};
  return std::ranges::find(k_failures, signal) != k_failures.end();
}

/// This process' environment for the trial, which opens the device with these lanes, and without a trial.
std::vector<std::string> environment_of(const DeviceInfo& info) {
  std::vector<std::string> variables{"DPR_TRIAL=off", "DPR_LANES=" + std::to_string(info.lanes)};
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string_view text = *variable;
    if (!text.starts_with("DPR_TRIAL=") && !text.starts_with("DPR_LANES=")) variables.emplace_back(text);
  }
  return variables;
}

/// The trial's process: what it printed, and how it ended.
struct Ending {
  std::string kernel, text;  // the last that was begun; the driver's last line
  double milliseconds = 0;
  int status = 0;  // of waitpid()
};

Ending run_trial(const DeviceInfo& info, const std::filesystem::path& command) {
  ChildProcess process({command.string(), "devices", "--trial", trial_name(info)}, /*takes_errors=*/true,
                       environment_of(info));
  Ending ending;
  process.for_each_line([&](std::string_view line) {
    constexpr std::string_view k_begins = "begins ", k_milliseconds = "milliseconds ";
    if (line.starts_with(k_begins)) {
      ending.kernel = line.substr(k_begins.size());
    } else if (line.starts_with(k_milliseconds)) {
      ending.milliseconds = std::strtod(line.data() + k_milliseconds.size(), nullptr);
    } else if (!line.empty()) {
      ending.text = line;
    }
  });
  ending.status = process.wait();
  return ending;
}

std::string describe(const DeviceInfo& info, const Ending& ending) {
  constexpr std::size_t k_most_characters = 160;  // of a line that may be a stack trace's
  const int signal = WTERMSIG(ending.status);
  std::string failure = info.name + " (" + info.platform + ", driver " + info.driver + ") is not used with " +
                        std::to_string(info.lanes) + " lanes: its driver " +
                        (signal == SIGALRM ? "does not finish " : "ends the process at ") +
                        (ending.kernel.empty() ? std::string(k_frame_file) : ending.kernel);
  failure += signal == SIGALRM ? " in " + std::to_string(trial_seconds()) + " s (DPR_TRIAL_SECONDS)"
                               : std::string(", ") + strsignal(signal);
  if (!ending.text.empty()) failure += " (" + ending.text.substr(0, k_most_characters) + ")";
  return failure;
}

}  // namespace

std::string trial_name(const DeviceInfo& info) {
  return hash_text(device_key(info) + program_source(k_frame_file));
}

unsigned trial_seconds() {
  constexpr unsigned k_default = 300;  // a slow machine's compiler takes a minute
  const char* const wanted = std::getenv("DPR_TRIAL_SECONDS");
  const long seconds = wanted == nullptr ? 0 : std::strtol(wanted, nullptr, 10);
  return seconds > 0 ? static_cast<unsigned>(seconds) : k_default;
}

std::optional<Trial> remembered_trial(const DeviceInfo& info, const Store& store) {
  const std::optional<std::string> found = store.load(key_of(info));
  if (!found) return std::nullopt;
  if (found->starts_with(k_fails)) return Trial{0, found->substr(k_fails.size())};
  if (!found->starts_with(k_runs)) return std::nullopt;
  return Trial{std::strtod(found->c_str() + k_runs.size(), nullptr), ""};
}

std::optional<Trial> try_device(const DeviceInfo& info, const Store& store) {
  if (is_switched_off()) return std::nullopt;
  if (auto known = remembered_trial(info, store)) return known;
  const std::filesystem::path command = command_file();
  if (command.empty()) return std::nullopt;
  const std::string key = key_of(info);
  store.save(key, k_started);
  if (store.load(key) != k_started) return std::nullopt;  // every start would try anew
  Ending ending;
  try {
    ending = run_trial(info, command);
  } catch (const IoError&) {
    return std::nullopt;
  }
  if (WIFSIGNALED(ending.status) && is_failure(WTERMSIG(ending.status))) {
    store.save(key, std::string(k_fails) + describe(info, ending));
  } else if (WIFEXITED(ending.status) && WEXITSTATUS(ending.status) == 0 && ending.milliseconds > 0) {
    store.save(key, std::string(k_runs) + std::to_string(ending.milliseconds));
  }
  return remembered_trial(info, store);
}

}  // namespace dpr
