// Lists of names as messages and --help have them.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace dpr {

/// "a, b or c", as messages have it.
std::string one_of(std::span<const std::string_view> names);
/// "a|b|c", as --help has it.
std::string joined(std::span<const std::string_view> names);

/// The name that is mistyped as `word`: the one of the fewest changed letters, at most a third of the word's.
std::optional<std::string_view> nearest_name(std::string_view word, std::span<const std::string_view> names);

}  // namespace dpr
