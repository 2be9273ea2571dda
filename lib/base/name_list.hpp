// Lists of names as messages and --help have them.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace dpr {

/// "a, b or c", as messages have it.
std::string one_of(std::span<const std::string_view> names);
/// "a|b|c", as --help has it.
std::string joined(std::span<const std::string_view> names);

}  // namespace dpr
