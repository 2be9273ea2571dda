// Runs a program of this project as a user would: in a folder, with arguments, and looks at what it printed.
#pragma once

#include <doctest/doctest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "support/reduced.hpp"
#include "support/temp_dir.hpp"

namespace dpr::test {

/// The path that an environment variable names, or empty where programs cannot be run.
inline std::string program_path(const char* variable) {
  const char* path = std::getenv(variable);
  if (path == nullptr || is_reduced()) return {};
  return path;
}

/// True if a test has no program to run, and says so.
inline bool is_skipped(const char* variable = "DPR_CLI") {
  if (!program_path(variable).empty()) return false;
  MESSAGE("skipped: " << variable << " is not set, or DPR_TEST_REDUCED is");
  return true;
}

/// A word of a shell's command line.
inline std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) {
    if (c == '\'') {
      text += "'\\''";
    } else {
      text += c;
    }
  }
  return text + "'";
}

struct Outcome {
  int status = -1;
  std::string out, err;
};

/// Runs a program in the folder. `environment` is NAME=VALUE or empty.
inline Outcome run_program(const std::string& program, const TempDir& folder,
                           const std::vector<std::string>& arguments, const std::string& environment = "") {
  const TempDir streams;
  // Appended piece by piece: at sums of strings GCC 12 gives a false alarm (its bug 105651).
  std::string line = "cd ";
  line.append(quoted(folder.path().string())).append(" && env ");
  if (!environment.empty()) line.append(quoted(environment)).append(" ");
  line.append(quoted(program));
  for (const std::string& argument : arguments) line.append(" ").append(quoted(argument));
  line.append(" >").append(quoted((streams / "out").string()));
  line.append(" 2>").append(quoted((streams / "err").string())).append(" </dev/null");
  const int result = std::system(line.c_str());
  Outcome outcome;
  if (WIFEXITED(result)) outcome.status = WEXITSTATUS(result);
  outcome.out = streams.read("out");
  outcome.err = streams.read("err");
  return outcome;
}

/// Runs `dpr ARGUMENTS` in the folder. `environment` is NAME=VALUE or empty.
inline Outcome run_command(const TempDir& folder, const std::vector<std::string>& arguments,
                           const std::string& environment = "") {
  return run_program(program_path("DPR_CLI"), folder, arguments, environment);
}

/// Runs `dpr LINE` in the folder; spaces part the arguments.
inline Outcome run_line(const TempDir& folder, const std::string& line) {
  std::istringstream words(line);
  return run_command(folder, {std::istream_iterator<std::string>(words), {}});
}

/// Runs `dpr ARGUMENTS`, which must succeed.
inline Outcome succeed(const TempDir& folder, const std::vector<std::string>& arguments) {
  const Outcome outcome = run_command(folder, arguments);
  CAPTURE(outcome.err);
  CHECK(outcome.status == 0);
  return outcome;
}

/// "dpr: error: WHAT (WHERE): got ..., expected ...": one line and nothing else.
inline bool is_error_line(const std::string& text) {
  return text.starts_with("dpr: error: ") && text.size() > 13 && text.ends_with('\n') &&
         std::ranges::count(text, '\n') == 1;
}

}  // namespace dpr::test
