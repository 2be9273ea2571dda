// Lists of names as messages and --help have them.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace dpr {

/// "a, b or c", as messages have it.
std::string one_of(std::span<const std::string_view> names);
/// "a|b|c", as --help has it.
std::string joined(std::span<const std::string_view> names);

/// "a, b,c" as its items, without the spaces around them. An item may be empty; an empty text has none.
std::vector<std::string> split_list(std::string_view text);

/// Index of a name in the list. Throws InvalidArgument for a word that is not in it; the message calls the
/// word's purpose `argument`.
std::size_t position_of(std::string_view word, std::span<const std::string_view> names,
                        const std::string& argument);

/// The name that is mistyped as `word`: the one of the fewest changed letters, at most a third of the word's.
std::optional<std::string_view> nearest_name(std::string_view word, std::span<const std::string_view> names);

}  // namespace dpr
