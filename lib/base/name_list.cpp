#include "base/name_list.hpp"

#include <algorithm>
#include <numeric>

#include "dpr/error.hpp"

namespace dpr {
namespace {

/// Levenshtein's distance.
std::size_t changed_letters(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

}  // namespace

std::string one_of(std::span<const std::string_view> names) {
  std::string list;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) list += i + 1 < names.size() ? ", " : " or ";
    list += names[i];
  }
  return list;
}

std::string joined(std::span<const std::string_view> names) {
  std::string list;
  for (const std::string_view name : names) list += (list.empty() ? "" : "|") + std::string(name);
  return list;
}

std::vector<std::string> split_list(std::string_view text) {
  std::vector<std::string> items;
  while (!text.empty() || !items.empty()) {
    const std::size_t comma = std::min(text.find(','), text.size());
    const std::string_view item = text.substr(0, comma);
    const std::size_t begin = std::min(item.find_first_not_of(' '), item.size());
    items.emplace_back(item.substr(begin, item.find_last_not_of(' ') + 1 - begin));
    if (comma == text.size()) break;
    text.remove_prefix(comma + 1);
  }
  return items;
}

std::size_t position_of(std::string_view word, std::span<const std::string_view> names,
                        const std::string& argument) {
  const auto found = std::ranges::find(names, word);
  if (found == names.end()) throw InvalidArgument(argument, "\"" + std::string(word) + "\"", one_of(names));
  return static_cast<std::size_t>(found - names.begin());
}

std::optional<std::string_view> nearest_name(std::string_view word, std::span<const std::string_view> names) {
  const auto distance = [&](std::string_view name) { return changed_letters(word, name); };
  const auto nearest = std::ranges::min_element(names, {}, distance);
  if (nearest == names.end() || 3 * distance(*nearest) > word.size()) return {};
  return *nearest;
}

}  // namespace dpr
