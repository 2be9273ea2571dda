// Numbers of binary files, little-endian whatever the machine is.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

namespace dpr {

/// The number whose bytes begin at `offset`; they must be there. Of at most four bytes.
template <typename Number>
Number little_endian(std::string_view bytes, std::size_t offset) {
  std::uint32_t bits = 0;
  for (std::size_t i = sizeof(Number); i-- > 0;)
    bits = bits << 8U | static_cast<std::uint8_t>(bytes[offset + i]);
  if constexpr (std::is_same_v<Number, float>) {
    return std::bit_cast<float>(bits);
  } else {
    return static_cast<Number>(bits);
  }
}

inline void append_little_endian(std::string& bytes, std::uint32_t number) {
  for (unsigned i = 0; i < 4; ++i) bytes += static_cast<char>(number >> 8U * i & 0xffU);
}

inline void append_little_endian(std::string& bytes, float number) {
  append_little_endian(bytes, std::bit_cast<std::uint32_t>(number));
}

}  // namespace dpr
