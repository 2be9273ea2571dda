#include "cli/option_names.hpp"

#include <algorithm>

namespace dpr::cli {

std::string option_argument(const CLI::App& command, const OptionNames& names, const std::string& argument) {
  const std::string field = argument.substr(0, argument.find(" ("));
  std::string same = "--" + field;
  std::ranges::replace(same, '_', '-');
  const auto other = names.find(field);
  for (const std::string& option : {other == names.end() ? same : other->second, same}) {
    const CLI::Option* given = command.get_option_no_throw(option);
    if (given != nullptr && given->count() > 0) return option + " (command line)";
  }
  return argument;
}

}  // namespace dpr::cli
