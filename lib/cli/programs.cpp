// Commands that are programs of their own beside this one, for what they load: dpr learn loads libtorch, and
// dpr bench, which tells how much memory the library takes, does without the libraries for image files.
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "base/child_process.hpp"
#include "base/module.hpp"
#include "cli/commands.hpp"
#include "cli/completion.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

struct Program {
  std::string command, description;
  std::string build;                                                  // a build that has it
  std::vector<std::pair<std::string, std::string>> environment = {};  // where the user's says nothing else
};

std::filesystem::path file_of(const std::string& command) {
  return std::filesystem::canonical(running_program()).parent_path() / ("dpr-" + command);
}

/// Returns only where the program is missing and its help was asked for.
void run(const Program& program, const std::vector<std::string>& arguments) {
  const std::filesystem::path file = file_of(program.command);
  if (!std::filesystem::exists(file)) {
    const std::string name = file.filename().string();
    const bool wants_help = std::ranges::any_of(
        arguments, [](const std::string& word) { return word == "--help" || word == "-h"; });
    if (!wants_help)
      throw InvalidArgument(program.command + " (dpr)", "a build without " + name, program.build);
    std::printf("%s.\nThis build has no %s, which describes the options: expected %s.\n",
                program.description.c_str(), name.c_str(), program.build.c_str());
    return;
  }
  for (const auto& [variable, value] : program.environment) setenv(variable.c_str(), value.c_str(), 0);
  std::string name = file.string();
  std::vector<std::string> words = arguments;
  std::vector<char*> argv{name.data()};
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  execv(name.c_str(), argv.data());
  throw IoError(file, std::string("cannot be run: ") + std::strerror(errno));
}

void add(CLI::App& application, const Program& program) {
  CLI::App* command = application.add_subcommand(program.command, program.description);
  command->prefix_command();
  command->set_help_flag();  // the other program's
  command->callback([command, program] { run(program, command->remaining()); });
}

}  // namespace

void add_learn_command(CLI::App& application) {
  add(application, {"learn",
                    "Trains and evaluates single-image reconstruction (needs libtorch)",
                    "a build by cmake --preset release where libtorch-dev is installed",
                    // OpenBLAS' threads sleep at once instead of waiting busily while the renderer works, and
                    // freed memory is kept: a step's tensors take the pages of the last one's. Libtorch's
                    // log would tell of every attempt to connect.
                    {{"OPENBLAS_THREAD_TIMEOUT", "4"},
                     {"MALLOC_MMAP_THRESHOLD_", "8589934592"},
                     {"MALLOC_TRIM_THRESHOLD_", "8589934592"},
                     {"GLOG_minloglevel", "3"}}});
}

void add_bench_command(CLI::App& application) {
  add(application, {"bench", "Measures forward and backward passes, compares results, draws them",
                    "a build by cmake --preset release"});
}

void print_entries_of_programs() {
  std::fflush(stdout);
  for (const char* const command : {"learn", "bench"}) {
    std::string name = file_of(command).string(), request = k_completion_request;
    if (!std::filesystem::exists(name)) continue;
    char* const arguments[] = {name.data(), request.data(), nullptr};
    pid_t child = 0;
    if (posix_spawn(&child, name.c_str(), nullptr, nullptr, arguments, environ) == 0)
      waitpid(child, nullptr, 0);
  }
}

}  // namespace dpr::cli
