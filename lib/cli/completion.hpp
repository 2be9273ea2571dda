// Completion of command lines by the shell, from the description that --help is made of.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace dpr::cli {

/// Asked alone of any program of run_application(), prints its completion_entries().
inline constexpr const char* k_completion_request = "--completion-entries";

/// Assignments to bash's associative array _dpr_words: commands, such as "dpr pose", have the words that may
/// follow them; options, such as "dpr pose --loss", their values. FILES among them stands for names of files.
std::string completion_entries(const CLI::App& application);

}  // namespace dpr::cli
