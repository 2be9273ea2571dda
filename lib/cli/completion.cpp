// dpr completion bash: a script for the shell.
#include "cli/completion.hpp"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <sstream>

#include "cli/commands.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

constexpr const char* k_files = "FILES";
constexpr const char* k_several = "LIST";
constexpr const char* k_words = "words: ";  // begins the name of a validator that holds them

// Commands are followed down to the last one; then the word before the cursor may be an option with a value.
// Options are offered after a dash only. LIST before words says that commas separate several of them.
constexpr const char* k_bash_begin =
    R"(# Completion of dpr for bash. In ~/.bashrc: source <(dpr completion bash)
declare -A _dpr_words
)";
constexpr const char* k_bash_end = R"(_dpr() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]} key=dpr word lead= i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    word=${COMP_WORDS[i]}
    [[ $word != -* && ${_dpr_words["$key $word"]+set} ]] && key+=" $word"
  done
  [[ $previous == -* && ${_dpr_words["$key $previous"]+set} ]] && key+=" $previous"
  COMPREPLY=()
  for word in ${_dpr_words["$key"]}; do
    if [[ $word == FILES ]]; then
      [[ $current == -* ]] && continue
      compopt -o filenames 2>/dev/null
      while read -r word; do COMPREPLY+=("$word"); done < <(compgen -f -- "$current")
    elif [[ $word == LIST ]]; then
      [[ $current == *,* ]] && lead=${current%,*},
    elif [[ $lead$word == "$current"* && ($word != -* || $current == -*) ]]; then
      COMPREPLY+=("$lead$word")
    fi
  done
}
complete -F _dpr dpr
)";

/// Those of complete_with(), or none.
std::string given_words(CLI::Option& option) {
  try {
    for (int i = 0;; ++i) {
      const std::string& name = option.get_validator(i)->get_name();
      if (name.starts_with(k_words)) return name.substr(std::string(k_words).size());
    }
  } catch (const CLI::OptionNotFound&) {
    return {};
  }
}

/// Those of complete_with(), or the lower-case words of "cpu|gpu|INDEX"; files for types that are names of
/// some; else nothing.
std::string values_of(CLI::Option& option) {
  if (const std::string words = given_words(option); !words.empty())
    return (option.get_delimiter() == ',' ? std::string(k_several) + " " : "") + words;
  const std::string type = option.get_type_name();
  if (type.find('.') != std::string::npos || type == "DIR" || type == "FILE") return k_files;
  const auto is_plain = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_'; };
  std::string words;
  std::istringstream alternatives(type);
  for (std::string word; std::getline(alternatives, word, '|');) {
    if (std::ranges::all_of(word, is_plain)) words += (words.empty() ? "" : " ") + word;
  }
  return words;
}

std::string entry(const std::string& key, const std::string& words) {
  return "_dpr_words['" + key + "']='" + words + "'\n";
}

void append(std::string& entries, CLI::App& application, const std::string& path) {
  std::string words;
  const auto add = [&](const std::string& word) { words += (words.empty() ? "" : " ") + word; };
  for (CLI::App* command : application.get_subcommands([](CLI::App*) { return true; })) {
    add(command->get_name());
    append(entries, *command, path + " " + command->get_name());
  }
  for (CLI::Option* option : application.get_options([](CLI::Option*) { return true; })) {
    if (option->get_group().empty()) continue;
    std::vector<std::string> names;
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    if (names.empty()) add(option->get_type_name().empty() ? k_files : values_of(*option));
    for (const std::string& name : names) {
      add(name);
      if (option->get_expected_max() > 0) entries += entry(path + " " + name, values_of(*option));
    }
  }
  entries += entry(path, words);
}

void run(const std::string& shell, CLI::App& application) {
  if (shell != "bash") throw InvalidArgument("SHELL (command line)", "\"" + shell + "\"", "bash");
  std::printf("%s%s", k_bash_begin, completion_entries(application).c_str());
  print_entries_of_programs();
  std::printf("%s", k_bash_end);
}

}  // namespace

void complete_with(CLI::Option& option, std::span<const std::string_view> words) {
  std::string name = k_words;
  for (const std::string_view word : words) name.append(word).append(" ");
  name.pop_back();
  option.check(CLI::Validator([](std::string&) { return std::string(); }, "", name));
}

std::string completion_entries(CLI::App& application) {
  std::string entries;
  append(entries, application, application.get_name());
  return entries;
}

void add_completion_command(CLI::App& application) {
  CLI::App* command = application.add_subcommand(
      "completion", "Prints a script with which the shell completes dpr's arguments");
  const auto shell = std::make_shared<std::string>();
  command->add_option("SHELL", *shell, "Shell to write the script for")->required()->type_name("bash");
  command->footer("Example: source <(dpr completion bash)");
  command->callback([shell, &application] { run(*shell, application); });
}

}  // namespace dpr::cli
