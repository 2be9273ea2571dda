// dpr learn: a program of its own, since loading libtorch takes longer than all that the other commands do.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "cli/commands.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

[[noreturn]] void run(const std::vector<std::string>& arguments) {
  const std::filesystem::path program =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / "dpr-learn";
  if (!std::filesystem::exists(program)) {
    throw InvalidArgument("learn (dpr)", "a build without libtorch",
                          "one with it: libtorch-dev, then cmake again");
  }
  std::string name = program.string();
  std::vector<std::string> words = arguments;
  std::vector<char*> argv{name.data()};
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  execv(name.c_str(), argv.data());
  throw IoError(program, std::string("cannot be run: ") + std::strerror(errno));
}

}  // namespace

void add_learn_command(CLI::App& application) {
  CLI::App* command = application.add_subcommand(
      "learn", "Trains and evaluates single-image reconstruction (needs libtorch)");
  command->prefix_command();
  command->set_help_flag();  // the other program's
  command->callback([command] { run(command->remaining()); });
}

}  // namespace dpr::cli
