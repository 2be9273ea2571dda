// Completion of command lines by the shell, from the description that --help is made of.
#pragma once

#include <CLI/CLI.hpp>
#include <span>
#include <string>
#include <string_view>

namespace dpr::cli {

/// Asked alone of any program of run_application(), prints its completion_entries().
inline constexpr const char* k_completion_request = "--completion-entries";

/// The values of an option, where its type name does not list them. Others stay allowed.
void complete_with(CLI::Option& option, std::span<const std::string_view> words);

/// Assignments to bash's associative array _dpr_words: commands, such as "dpr pose", have the words that may
/// follow them; options, such as "dpr pose --loss", their values. FILES among them stands for names of files,
/// LIST before them for several, separated by commas.
std::string completion_entries(CLI::App& application);

}  // namespace dpr::cli
