// The names of the smoothing's enumerations: one table for files, command line, operator and messages.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "base/name_list.hpp"
#include "dpr/smoothing.hpp"

namespace dpr {

template <SmoothingChoice Choice>
struct NamedChoice {
  Choice value;
  std::string_view name;
};

/// All values of an enumeration with their names, in the order of their declaration.
template <SmoothingChoice Choice>
std::span<const NamedChoice<Choice>> choice_names();

template <SmoothingChoice Choice>
std::vector<std::string_view> names_of_choices() {
  std::vector<std::string_view> names;
  for (const auto& row : choice_names<Choice>()) names.push_back(row.name);
  return names;
}

/// Throws InvalidArgument, which calls the argument `where`, for what is no preset's name.
void require_preset(std::string_view name, std::string_view where);

}  // namespace dpr
