// Lines, words and numbers of text files; independent of the locale.
#pragma once

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/from_chars.hpp"

namespace dpr::scan {

inline bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

/// The text behind the byte-order mark that some editors begin UTF-8 with.
inline std::string_view without_byte_order_mark(std::string_view text) {
  constexpr std::string_view k_mark = "\xEF\xBB\xBF";
  return text.starts_with(k_mark) ? text.substr(k_mark.size()) : text;
}

/// Takes the text apart line by line; "\n" and "\r\n" both end one, and the last may have no end.
class Lines {
 public:
  explicit Lines(std::string_view text) : rest_(text) {}

  bool next() {
    if (rest_.empty()) return false;
    const std::size_t end = rest_.find('\n');
    line_ = rest_.substr(0, end);
    rest_ = end == std::string_view::npos ? std::string_view{} : rest_.substr(end + 1);
    ++number_;
    return true;
  }

  std::string_view line() const { return line_; }
  std::string_view rest() const { return rest_; }
  std::size_t number() const { return number_; }  ///< of the line, from 1

 private:
  std::string_view rest_, line_;
  std::size_t number_ = 0;
};

/// The words of a line. `words` is reused from line to line to save allocations.
inline void split(std::string_view line, std::vector<std::string_view>& words) {
  words.clear();
  std::size_t i = 0;
  while (i < line.size()) {
    while (i < line.size() && is_space(line[i])) ++i;
    const std::size_t begin = i;
    while (i < line.size() && !is_space(line[i])) ++i;
    if (i > begin) words.push_back(line.substr(begin, i - begin));
  }
}

/// Rest of a line behind one of its words, trimmed: a name that may have spaces inside.
inline std::string_view behind(std::string_view line, std::string_view word) {
  std::string_view rest = line.substr(static_cast<std::size_t>(word.data() + word.size() - line.data()));
  while (!rest.empty() && is_space(rest.front())) rest.remove_prefix(1);
  while (!rest.empty() && is_space(rest.back())) rest.remove_suffix(1);
  return rest;
}

template <typename Number>
std::optional<Number> parse(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  Number value{};
  const auto [end, error] = from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return {};
  return value;
}

/// True if a decimal number that no double can hold is too small, false if it is too large.
inline bool underflows(std::string_view word) {
  const std::size_t exponent_at = std::min(word.find_first_of("eE"), word.size());
  const std::string_view mantissa = word.substr(0, exponent_at);
  const std::size_t first = mantissa.find_first_of("123456789");
  const std::size_t point = std::min(mantissa.find('.'), mantissa.size());
  std::int64_t exponent = static_cast<std::int64_t>(point) - static_cast<std::int64_t>(first);
  if (exponent_at < word.size()) {
    const std::string_view digits = word.substr(exponent_at + 1);
    // An exponent that no integer can hold outweighs the digits before it.
    constexpr std::int64_t k_beyond = std::numeric_limits<std::int64_t>::max() / 2;
    const std::optional<std::int32_t> value = parse<std::int32_t>(digits);
    exponent += value ? *value : digits.starts_with('-') ? -k_beyond : k_beyond;
  }
  return exponent < 0;
}

/// A finite float; what is too small for one becomes a zero.
inline std::optional<float> parse_coordinate(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  double value = 0;
  const auto [end, error] = from_chars(word.data(), word.data() + word.size(), value);
  if (end != word.data() + word.size()) return {};
  if (error == std::errc::result_out_of_range && underflows(word)) return 0.0F;
  const auto coordinate = static_cast<float>(value);
  return error == std::errc{} && std::isfinite(coordinate) ? std::optional(coordinate) : std::nullopt;
}

inline std::string quoted(std::string_view word) { return "\"" + std::string(word) + "\""; }

}  // namespace dpr::scan
