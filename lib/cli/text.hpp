// Values as text: for people, and from the command line.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <glm/glm.hpp>
#include <string>

namespace dpr::cli {

/// Text as printf writes it.
template <typename... Values>
std::string format(const char* pattern, Values... values) {
  char text[160];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

/// A number with at least so many digits: "0042".
std::string padded(std::uint64_t number, std::size_t digits);

/// "1 triangle", "2 triangles".
std::string counted(std::size_t count, const std::string& what);

/// "640x480". Throws InvalidArgument.
glm::ivec2 parse_size(const std::string& text);

/// Three numbers separated by commas. Throws InvalidArgument; `argument` says which one in the message.
glm::dvec3 parse_vector(const std::string& text, const std::string& argument);

/// Four numbers separated by commas: x, y, width, height. Throws InvalidArgument.
glm::vec4 parse_box(const std::string& text, const std::string& argument);

/// A whole number of 64 bits. Throws InvalidArgument; `argument` says which one in the message.
std::uint64_t parse_whole_number(const std::string& text, const std::string& argument);

/// The value of --schedule: true for "adaptive", false for "anneal". Throws InvalidArgument for another word.
bool is_adaptive_schedule(const std::string& word);

}  // namespace dpr::cli
