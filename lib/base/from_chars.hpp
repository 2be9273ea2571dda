// std::from_chars, also for the floating-point numbers that some standard libraries lack (libc++ before 20).
#pragma once

#include <locale.h>
#include <stdlib.h>

#include <charconv>
#include <cmath>
#include <string>
#include <string_view>
#include <system_error>

namespace dpr {

/// std::from_chars(double) by the C library's strtod: for decimal numbers, infinity and NaN.
inline std::from_chars_result from_chars_by_strtod(const char* begin, const char* end, double& value) {
  const std::string text(begin, end);
  const std::size_t digits = text.starts_with('-') ? 1 : 0;
  // Forms that strtod takes and std::from_chars does not: spaces, a plus sign, hexadecimal numbers.
  const char first = digits < text.size() ? text[digits] : ' ';
  if (std::string_view(" \t\n\v\f\r+-").find(first) != std::string_view::npos)
    return {begin, std::errc::invalid_argument};
  const std::size_t hexadecimal = text.find_first_of("xX");
  const std::string decimal =
      text.substr(0, hexadecimal == digits + 1 && first == '0' ? hexadecimal : text.size());
  static const locale_t c_locale = newlocale(LC_ALL_MASK, "C", nullptr);
  char* stop = nullptr;
  const double number = strtod_l(decimal.c_str(), &stop, c_locale);
  const char* const rest = begin + (stop - decimal.c_str());
  if (rest == begin) return {begin, std::errc::invalid_argument};
  const std::string_view read(begin, rest);
  const bool names_infinity = read.find_first_of("iI") != std::string_view::npos;
  const bool overflows = std::isinf(number) && !names_infinity;
  const bool underflows =
      number == 0 &&
      read.substr(0, read.find_first_of("eE")).find_first_of("123456789") != std::string_view::npos;
  if (overflows || underflows) return {rest, std::errc::result_out_of_range};
  value = number;
  return {rest, {}};
}

template <typename Number>
std::from_chars_result from_chars(const char* begin, const char* end, Number& value) {
  return std::from_chars(begin, end, value);
}

#ifndef __cpp_lib_to_chars
inline std::from_chars_result from_chars(const char* begin, const char* end, double& value) {
  return from_chars_by_strtod(begin, end, value);
}
#endif

}  // namespace dpr
