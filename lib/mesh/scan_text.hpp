// Lines, words and numbers of text files; independent of the locale.
#pragma once

#include <cctype>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace dpr::scan {

inline bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

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

template <typename Number>
std::optional<Number> parse(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  Number value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return {};
  return value;
}

/// A finite float; what is too small for one becomes a zero.
inline std::optional<float> parse_coordinate(std::string_view word) {
  const std::optional<double> value = parse<double>(word);
  if (!value) return {};
  const auto coordinate = static_cast<float>(*value);
  return std::isfinite(coordinate) ? std::optional(coordinate) : std::nullopt;
}

inline std::string quoted(std::string_view word) { return "\"" + std::string(word) + "\""; }

}  // namespace dpr::scan
