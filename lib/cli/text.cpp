// Sizes, vectors and numbers from text, independent of the locale.
#include "cli/text.hpp"

#include <cmath>
#include <limits>

#include "base/checks.hpp"
#include "base/from_chars.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

/// Reads a number and what must follow it (0: the end), and moves on. False if the text is not of that form.
template <typename Number>
bool take(const char*& at, const char* end, Number& number, char follower) {
  const auto [stop, error] = from_chars(at, end, number);
  if (error != std::errc()) return false;
  if (follower == 0) return stop == end;
  if (stop == end || *stop != follower) return false;
  at = stop + 1;
  return true;
}

}  // namespace

std::string padded(std::uint64_t number, std::size_t digits) {
  const std::string text = std::to_string(number);
  return std::string(text.size() < digits ? digits - text.size() : 0, '0') + text;
}

glm::ivec2 parse_size(const std::string& text) {
  const char *at = text.data(), *end = at + text.size();
  glm::ivec2 size(0);
  const auto is_side = [](int pixels) { return pixels >= 1 && pixels <= checks::k_largest_side; };
  if (take(at, end, size.x, 'x') && take(at, end, size.y, 0) && is_side(size.x) && is_side(size.y))
    return size;
  throw InvalidArgument(
      "--size (command line)", "\"" + text + "\"",
      "WIDTHxHEIGHT, e.g. 640x480, at most " + std::to_string(checks::k_largest_side) + " on a side");
}

glm::dvec3 parse_vector(const std::string& text, const std::string& argument) {
  const char *at = text.data(), *end = at + text.size();
  glm::dvec3 v(0.0);
  const bool complete = take(at, end, v.x, ',') && take(at, end, v.y, ',') && take(at, end, v.z, 0);
  if (complete && std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z)) return v;
  throw InvalidArgument(argument, "\"" + text + "\"",
                        "three finite numbers separated by commas, e.g. 0.1,0,-0.5");
}

glm::vec4 parse_box(const std::string& text, const std::string& argument) {
  const char *at = text.data(), *end = at + text.size();
  glm::dvec4 v(0.0);
  const bool complete =
      take(at, end, v.x, ',') && take(at, end, v.y, ',') && take(at, end, v.z, ',') && take(at, end, v.w, 0);
  const glm::vec4 box(v);
  if (complete && std::isfinite(box.x + box.y) && std::isfinite(box.z + box.w)) return box;
  throw InvalidArgument(argument, "\"" + text + "\"",
                        "X,Y,WIDTH,HEIGHT in pixels from the upper left corner, e.g. 120,80,64,48");
}

std::uint64_t parse_whole_number(const std::string& text, const std::string& argument) {
  const char *at = text.data(), *end = at + text.size();
  std::uint64_t number = 0;
  if (take(at, end, number, 0)) return number;
  throw InvalidArgument(
      argument, text,
      "a whole number from 0 to " + std::to_string(std::numeric_limits<std::uint64_t>::max()));
}

std::string counted(std::size_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

bool is_adaptive_schedule(const std::string& word) {
  if (word == "adaptive") return true;
  if (word == "anneal") return false;
  throw InvalidArgument("--schedule (command line)", "\"" + word + "\"", "anneal or adaptive");
}

}  // namespace dpr::cli
