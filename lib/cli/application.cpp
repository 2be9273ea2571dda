#include "cli/commands.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "base/input_file.hpp"
#include "base/name_list.hpp"
#include "cli/completion.hpp"
#include "cli/file_options.hpp"
#include "cli/option_names.hpp"
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

/// The command that was chosen, or the program.
const CLI::App& chosen_command(const CLI::App& application) {
  const auto chosen = application.get_subcommands();
  return chosen.empty() ? application : *chosen.front();
}

/// The command as it was typed, as far as it was understood: "dpr render".
std::string command_name(const CLI::App& application) {
  const CLI::App& command = chosen_command(application);
  const std::string& name = application.get_name();
  return &command == &application ? name : name + " " + command.get_name();
}

std::vector<const CLI::App*> commands_of(const CLI::App& application) {
  return application.get_subcommands([](const CLI::App*) { return true; });
}

/// "X, or " where the word is nearly X: one of the commands, or, of a chosen command, of the options.
std::string did_you_mean(const CLI::App& application, const std::string& word, bool is_command) {
  std::vector<std::string> known;
  if (is_command) {
    for (const CLI::App* command : commands_of(application)) known.push_back(command->get_name());
  } else {
    for (const CLI::Option* option : chosen_command(application).get_options()) {
      for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
    }
  }
  const std::vector<std::string_view> names(known.begin(), known.end());
  const auto nearest = nearest_name(word, names);
  return nearest ? std::string(*nearest) + ", or " : "";
}

/// The option that a message of the options' library names first; the longest of several that begin there.
const CLI::Option* option_in(const CLI::App& command, const std::string& message) {
  const CLI::Option* first = nullptr;
  std::size_t first_at = std::string::npos;
  for (const CLI::Option* option : command.get_options()) {
    const std::size_t at = message.find(option->get_name());
    if (at == std::string::npos || at > first_at) continue;
    if (at == first_at && option->get_name().size() < first->get_name().size()) continue;
    first = option;
    first_at = at;
  }
  return first;
}

/// What an option takes, in words: its type, such as FLOAT or OUT.png, or the check after a colon, such as
/// "N:INT in [1 - 9]".
std::string expected_value(const CLI::Option& option, const std::string& got) {
  if (option.get_expected_max() == 0) return "no value";
  const std::string type = option.get_type_name();
  const std::size_t colon = type.find(':');
  const std::string kind = type.substr(0, colon);
  const std::string check = colon == std::string::npos ? "" : type.substr(colon + 1);
  // "INT in [1 - 9]"
  const std::size_t low = check.find("in [") + 4, high = check.find(" - ");
  if (low < high && high != std::string::npos)
    return "a number from " + check.substr(low, high - low) + " to " +
           check.substr(high + 3, check.find(']') - high - 3);
  if (check == "POSITIVE") return "a number above 0";
  if (check == "NONNEGATIVE") return "a number that is not negative";
  if (check.starts_with('{') && check.ends_with('}')) {
    const std::vector<std::string> words = split_list(check.substr(1, check.size() - 2));
    return one_of(std::vector<std::string_view>(words.begin(), words.end()));
  }
  if (!check.empty()) return check;
  const bool is_whole =
      !got.empty() && got.find_first_not_of("0123456789", got[0] == '-') == std::string::npos;
  if (kind == "N")
    return is_whole ? got[0] == '-' ? "a whole number that is not negative" : "a smaller number"
                    : "a whole number";
  return kind == "FLOAT" || kind == "[FLOAT]" ? "a number" : kind;
}

std::string in_quotes(const std::string& text) { return "\"" + text + "\""; }

/// "-o WORD for a file to write, or ", where the command writes a file that is not given yet.
std::string as_output(const CLI::App& command, const std::string& word) {
  const CLI::Option* output = command.get_option_no_throw("--output");
  return output != nullptr && output->count() == 0 ? "-o " + word + " for a file to write, or " : "";
}

/// Error about a word that no option takes.
InvalidArgument unexpected_word(const CLI::App& application, const std::string& word) {
  const CLI::App& command = chosen_command(application);
  const std::string name = command_name(application), help = in_quotes(name + " --help");
  const std::string where = "arguments (" + name + ")";
  if (word.starts_with("-")) {
    return {where, "the unknown option " + in_quotes(word),
            did_you_mean(application, word, false) + "an option that " + help + " describes"};
  }
  if (&command == &application && !commands_of(application).empty()) {
    return {where, "the unknown command " + in_quotes(word),
            did_you_mean(application, word, true) + "a command that " + help + " lists"};
  }
  return {where, in_quotes(word) + ", which belongs to no option",
          as_output(command, word) + "what " + help + " describes"};
}

/// "MESH" with its value, or "--scene".
std::string given(const CLI::Option* option) {
  const bool has_name = option->nonpositional() || option->results().empty();
  return has_name ? option->get_name() : option->get_name() + " (" + option->results().front() + ")";
}

/// The error of the options' library in the words of all others.
InvalidArgument in_own_words(const CLI::App& application, const CLI::ParseError& error) {
  if (const auto unknown = application.remaining(/*recurse=*/true); !unknown.empty())
    return unexpected_word(application, unknown.front());
  const CLI::App& command = chosen_command(application);
  const std::string message = error.what(), name = command_name(application);
  const std::string where = "arguments (" + name + ")", help = in_quotes(name + " --help");
  const CLI::Option* option = option_in(command, message);
  if (option == nullptr) return {where, in_quotes(message), "what " + help + " describes"};
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) {
    const std::string type = option->nonpositional() ? " " + option->get_type_name() : "";
    return {where, "no " + option->get_name(), option->get_name() + type + ", as " + help + " describes"};
  }
  if (dynamic_cast<const CLI::ExcludesError*>(&error) != nullptr) {
    const CLI::Option* other = option_in(command, message.substr(option->get_name().size()));
    const std::string output = option->nonpositional() ? "" : as_output(command, option->results().front());
    return {where, "both " + given(option) + " and " + given(other), output + "one of the two"};
  }
  const std::vector<std::string>& values = option->results();
  const std::string last = values.empty() ? "" : values.back();
  std::string got = in_quotes(last), expected = expected_value(*option, last);
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) {
    got = values.size() < 2 ? "no value" : std::to_string(values.size()) + " values";
    if (values.size() > 1) expected = "one value";
  }
  return {option->get_name() + " (command line)", got, expected};
}

int fail_to_parse(const CLI::App& application, const CLI::ParseError& error) {
  const bool is_unknown_command =
      &chosen_command(application) == &application && !application.remaining().empty();
  // --help and --version arrive as errors too.
  if (error.get_exit_code() == 0 && !is_unknown_command) return application.exit(error);
  return fail(in_own_words(application, error).what(), k_wrong_input);
}

/// The error, which names the option where one set the field of the smoothing at fault.
InvalidArgument in_words_of_options(const CLI::App& application, const InvalidArgument& error) {
  if (!error.argument().ends_with(" (smoothing)")) return error;
  const OptionNames names{{"occupancy_estimator", "--estimator"}, {"aggregation_estimator", "--estimator"}};
  return {option_argument(chosen_command(application), names, error.argument()), error.got(),
          error.expected()};
}

/// Refuses empty words in the place of numbers: the options' library reads 0, or as if the option were not given.
void refuse_empty_numbers(CLI::App& command) {
  constexpr std::array<std::string_view, 4> k_numbers{"N", "FLOAT", "MiB", "SIZE"};
  for (CLI::Option* option : command.get_options()) {
    const std::string type = option->get_type_name();
    if (std::ranges::find(k_numbers, type.substr(0, type.find(':'))) == k_numbers.end()) continue;
    option->check(
        CLI::Validator([](const std::string& word) { return std::string(word.empty() ? "empty" : ""); }, ""));
  }
  for (CLI::App* other : command.get_subcommands({})) refuse_empty_numbers(*other);
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
  if (argc == 1 && application.get_require_subcommand_min() > 0) {
    std::printf("%s", application.help().c_str());
    return 0;
  }
  refuse_empty_numbers(application);
  refuse_shared_files(application);
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
  guard_inputs();
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
  } catch (const InvalidArgument& error) {
    return fail(in_words_of_options(application, error).what(), k_wrong_input);
  } catch (const std::exception& error) {
    return fail(error.what(), k_wrong_input);
  }
}

}  // namespace dpr::cli
