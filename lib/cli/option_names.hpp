// Errors in the words of the command line.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>

#include "dpr/error.hpp"

namespace dpr::cli {

/// Fields of the library that an option sets under another name: {"edge_pixels", "--edge"}. blur_end needs no
/// entry: its option is --blur-end.
using OptionNames = std::map<std::string, std::string>;

/// "--edge (command line)" for "edge_pixels (shape)", if the command was given that option; else the
/// argument.
std::string option_argument(const CLI::App& command, const OptionNames& names, const std::string& argument);

/// Returns the result of `work`. An InvalidArgument that it throws names the option in place of the field.
template <typename Work>
auto with_option_names(const CLI::App& command, const OptionNames& names, Work work) {
  try {
    return work();
  } catch (const InvalidArgument& error) {
    throw InvalidArgument(option_argument(command, names, error.argument()), error.got(), error.expected());
  }
}

}  // namespace dpr::cli
