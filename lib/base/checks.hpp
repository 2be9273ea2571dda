// Helpers that the checks of the scene's parts share: a value's text in messages, and common conditions.
#pragma once

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <string>

#include "dpr/error.hpp"
#include "dpr/image.hpp"

namespace dpr::checks {

/// Largest side of an image, in pixels.
inline constexpr int k_largest_side = 16384;

/// The shortest text that reads back as the same number; independent of the locale.
template <typename Number>
std::string text(Number value) {
  char buffer[64];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
  return {buffer, end};
}

inline std::string text(const glm::vec3& v) {
  return "(" + text(v.x) + ", " + text(v.y) + ", " + text(v.z) + ")";
}

inline bool is_finite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Place of the first number that is not finite; as many as there are where all are. Blocks are compared without a
/// branch.
inline std::size_t first_not_finite(std::span<const float> numbers) {
  constexpr std::size_t k_block = 1024;
  constexpr std::uint32_t k_exponent = 0x7f800000;
  const auto is_bad = [](float x) { return (std::bit_cast<std::uint32_t>(x) & k_exponent) == k_exponent; };
  for (std::size_t first = 0; first < numbers.size(); first += k_block) {
    const std::span<const float> block = numbers.subspan(first, std::min(k_block, numbers.size() - first));
    std::uint32_t bad = 0;
    for (const float x : block) bad |= is_bad(x) ? 1U : 0U;
    if (bad != 0)
      return first + static_cast<std::size_t>(std::ranges::find_if(block, is_bad) - block.begin());
  }
  return numbers.size();
}

/// Throws for an enumerator beyond the last.
template <typename Enum>
void require_enumerator(Enum value, Enum last, const std::string& name) {
  const auto number = static_cast<int>(value), most = static_cast<int>(last);
  if (number < 0 || number > most)
    throw InvalidArgument(name, std::to_string(number), "an enumerator, 0 to " + std::to_string(most));
}

/// Throws for no channels, and for more than any image has, whose products might not be numbers.
inline void require_channels(std::size_t channels, const std::string& name) {
  constexpr std::size_t k_most_channels = std::size_t{1} << 20;
  if (channels < 1 || channels > k_most_channels)
    throw InvalidArgument(name, std::to_string(channels), "1 to " + std::to_string(k_most_channels));
}

/// Throws unless there are as many, all of them finite.
inline void require_numbers(std::span<const float> numbers, std::size_t count, const std::string& name) {
  if (numbers.size() != count)
    throw InvalidArgument(name, std::to_string(numbers.size()) + " numbers", std::to_string(count));
  const std::size_t bad = first_not_finite(numbers);
  if (bad != count) throw InvalidArgument(name, text(numbers[bad]), "finite numbers");
}

/// The numbers of vectors of floats.
template <class Vector>
std::span<const float> floats_of(std::span<const Vector> vectors) {
  return {reinterpret_cast<const float*>(vectors.data()), vectors.size() * (sizeof(Vector) / sizeof(float))};
}

/// "640x480"
inline std::string size(int width, int height) {
  // Appended piece by piece: at sums of strings GCC 12 gives a false alarm (its bug 105651).
  std::string result = std::to_string(width);
  return result.append("x").append(std::to_string(height));
}

/// "positions[7]"
inline std::string element(const std::string& list, std::size_t index) {
  return list + "[" + std::to_string(index) + "]";
}

/// "sigma (smoothing)": what, and where it stands.
inline std::string in(const std::string& what, const std::string& where) { return what + " (" + where + ")"; }

inline void require_finite(const glm::vec3& value, const std::string& argument) {
  if (!is_finite(value)) throw InvalidArgument(argument, text(value), "finite numbers");
}

inline void require_finite(float value, const std::string& argument) {
  if (!std::isfinite(value)) throw InvalidArgument(argument, text(value), "a finite number");
}

/// `argument` is called only where something is wrong.
template <class Argument>
void require_opacity(float value, const Argument& argument) {
  if (!(value >= 0 && value <= 1)) throw InvalidArgument(argument(), text(value), "a number from 0 to 1");
}

inline void require_positive(float value, const std::string& argument) {
  if (value > 0 && std::isfinite(value)) return;
  throw InvalidArgument(argument, text(value), "a finite number > 0");
}

/// Throws unless the first channel of a mask can say how much pixels count: from 0 to `most`, not all 0.
inline void require_weights(const Image& mask, const std::string& name, float most,
                            const std::string& expected) {
  double sum = 0;
  for (const glm::vec4& pixel : mask.pixels) {
    if (!(pixel.x >= 0 && pixel.x <= most))
      throw InvalidArgument("pixel of the " + name, text(pixel.x), expected);
    sum += static_cast<double>(pixel.x);
  }
  if (!(sum > 0)) throw InvalidArgument("sum of the " + name, text(sum), "a pixel above 0");
}

/// Throws unless the matrix is finite, affine and far enough from singular that its inverse means something.
inline void require_affine(const glm::mat4& matrix, const std::string& argument) {
  constexpr float k_last_row_tolerance = 1e-5F;  // a product of single-precision inverses leaves that much
  constexpr double k_smallest_volume = 1e-6;     // of the columns, each scaled to length one
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      if (std::isfinite(matrix[column][row])) continue;
      throw InvalidArgument(
          argument,
          text(matrix[column][row]) + " in row " + std::to_string(row) + ", column " + std::to_string(column),
          "finite numbers");
    }
  }
  const glm::vec4 last_row(matrix[0][3], matrix[1][3], matrix[2][3], matrix[3][3]);
  if (glm::length(last_row - glm::vec4(0, 0, 0, 1)) > k_last_row_tolerance) {
    throw InvalidArgument(argument,
                          "the last row (" + text(last_row.x) + ", " + text(last_row.y) + ", " +
                              text(last_row.z) + ", " + text(last_row.w) + ")",
                          "an affine matrix, whose last row is (0, 0, 0, 1)");
  }
  const glm::dmat3 linear(matrix);
  const double volume = std::abs(glm::determinant(linear));
  const double box = glm::length(linear[0]) * glm::length(linear[1]) * glm::length(linear[2]);
  if (!(volume > k_smallest_volume * box)) {
    throw InvalidArgument(argument, "a singular matrix of determinant " + text(glm::determinant(linear)),
                          "an invertible matrix");
  }
}

inline void require_finite(std::span<const glm::vec4> pixels, const std::string& argument) {
  const std::span<const float> numbers = floats_of(pixels);
  if (first_not_finite(numbers) == numbers.size()) return;
  throw InvalidArgument(argument, "a pixel that is not finite", "finite values");
}

/// Throws unless the image has the pixels its size asks for, all finite.
inline void require_pixels(const Image& image, const std::string& argument) {
  const std::size_t expected = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (image.pixels.size() != expected) {
    throw InvalidArgument(argument, std::to_string(image.pixels.size()) + " pixels",
                          std::to_string(expected) + ", width x height");
  }
  require_finite(image.pixels, argument);
}

}  // namespace dpr::checks

namespace dpr {

/// Throws InvalidArgument unless `ok`.
template <typename Number>
void require(bool ok, const char* argument, Number got, const char* expected) {
  if (!ok) throw InvalidArgument(argument, checks::text(got), expected);
}

}  // namespace dpr
