#include "cli/commands.hpp"

#include <algorithm>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "base/name_list.hpp"
#include "cli/completion.hpp"
#include "cli/process.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

// Exit statuses other than 0.
constexpr int k_wrong_input = 1;
constexpr int k_device_failed = 2;

int fail(std::string message, int status) {
  std::ranges::replace(message, '\n', ' ');
  std::fflush(stdout);
  std::fprintf(stderr, "dpr: error: %s\n", message.c_str());
  return status;
}

/// The command as it was typed, as far as it was understood: "dpr render".
std::string command_name(const CLI::App& application) {
  const auto chosen = application.get_subcommands();
  const std::string& name = application.get_name();
  return chosen.empty() ? name : name + " " + chosen.front()->get_name();
}

/// All names of the commands, or, of a command, of the options.
std::vector<std::string> known_words(const CLI::App& application) {
  const auto chosen = application.get_subcommands();
  std::vector<std::string> words;
  if (chosen.empty()) {
    for (const CLI::App* command : application.get_subcommands([](const CLI::App*) { return true; }))
      words.push_back(command->get_name());
  } else {
    for (const CLI::Option* option : chosen.front()->get_options()) {
      for (const std::string& name : option->get_lnames()) words.push_back("--" + name);
    }
  }
  return words;
}

/// "X, or Y" where the word is nearly Y.
std::string did_you_mean(const CLI::App& application, const std::string& word) {
  const std::vector<std::string> known = known_words(application);
  const std::vector<std::string_view> names(known.begin(), known.end());
  const auto nearest = nearest_name(word, names);
  return nearest ? std::string(*nearest) + ", or " : "";
}

int fail_to_parse(const CLI::App& application, const CLI::ParseError& error) {
  const std::string name = command_name(application);
  const auto unknown = application.remaining(/*recurse=*/true);
  const bool is_command = name == application.get_name() && !unknown.empty();
  const bool is_option = !is_command && !unknown.empty() && unknown.front().starts_with("--");
  // --help and --version arrive as errors too.
  if (error.get_exit_code() == 0 && !is_command) return application.exit(error);
  std::string problem = error.what(), expected;
  if (is_command) problem = "no such command: " + unknown.front();
  if (is_option) problem = "no such option: " + unknown.front();
  if (is_command || is_option) expected = did_you_mean(application, unknown.front());
  // "--output is required"
  constexpr std::string_view k_missing = " is required";
  const std::string got = problem.ends_with(k_missing)
                              ? "no " + problem.substr(0, problem.size() - k_missing.size())
                              : "\"" + problem + "\"";
  return fail("arguments (" + name + "): got " + got + ", expected " + expected + "what \"" + name +
                  " --help\" describes",
              k_wrong_input);
}

/// The program by its name, and its arguments, quoted where a shell needs it.
std::string command_line(const CLI::App& application, int argc, char** argv) {
  constexpr const char* k_plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_@%+=:,./-";
  std::string line = application.get_name();
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool is_plain = !word.empty() && word.find_first_not_of(k_plain) == std::string::npos;
    line += " " + (is_plain ? word : "'" + word + "'");
  }
  return line;
}

/// Runs the command; the exit status.
int run(CLI::App& application, int argc, char** argv) {
  if (argc == 2 && argv[1] == std::string_view(k_completion_request)) {
    std::printf("%s", completion_entries(application).c_str());
    return 0;
  }
  try {
    application.parse(argc, argv);
    return 0;
  } catch (const CLI::ParseError& error) {
    return fail_to_parse(application, error);
  }
}

}  // namespace

int run_application(CLI::App& application, CommonOptions& common, int argc, char** argv) {
  prepare_process();
  common.command_line = command_line(application, argc, argv);
  try {
    const int status = run(application, argc, argv);
    require_printed();
    return status;
  } catch (const BuildError& error) {
    const int status = fail(error.what(), k_device_failed);
    if (common.verbose) std::fprintf(stderr, "%s\n", error.log().c_str());
    return status;
  } catch (const DeviceError& error) {
    return fail(error.what(), k_device_failed);
  } catch (const std::exception& error) {
    return fail(error.what(), k_wrong_input);
  }
}

}  // namespace dpr::cli
