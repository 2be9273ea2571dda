// The parts that the reports' HTML pages share.
#pragma once

#include <cstdio>
#include <ostream>
#include <string>

namespace dpr::cli {

/// A number as printf writes it.
template <typename... Values>
std::string format(const char* pattern, Values... values) {
  char text[160];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

/// From the doctype to the heading.
void write_page_head(std::ostream& out, const std::string& title);
void write_page_end(std::ostream& out);

/// A row of a table: what, and its value.
void write_row(std::ostream& out, const char* name, const std::string& value);
/// A small picture with its caption, beside others.
void write_picture(std::ostream& out, const char* file, const char* caption);
/// A picture as wide as the page.
void write_wide_picture(std::ostream& out, const char* file, const char* caption);

}  // namespace dpr::cli
