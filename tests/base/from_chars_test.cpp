// Numbers read by strtod are those that std::from_chars reads.
#include "base/from_chars.hpp"

#include <doctest/doctest.h>

#include <bit>
#include <cstdint>
#include <string>

namespace from_chars_test {

#ifdef __cpp_lib_to_chars
TEST_SUITE("unit") {
  TEST_CASE("from_chars: numbers, their ends and their errors are the same by strtod") {
    for (const std::string text : {"0",
                                   "-0",
                                   "1",
                                   "-1.5",
                                   "0.1e",
                                   "1e5",
                                   "1e+5",
                                   "1E-5",
                                   "1e-5x",
                                   ".5",
                                   "5.",
                                   "1.2.3",
                                   "1,5",
                                   "0x1p4",
                                   "-0X2",
                                   "0x",
                                   "1x",
                                   "x1",
                                   "",
                                   " 1",
                                   "\t1",
                                   "+1",
                                   "-+1",
                                   "--1",
                                   "-",
                                   "- 1",
                                   ".",
                                   "e5",
                                   "inf",
                                   "-infinity",
                                   "infinit",
                                   "nan",
                                   "-NaN",
                                   "1e400",
                                   "-1e400",
                                   "1e-400",
                                   "-0.00001e-320",
                                   "0e-400",
                                   "4.9e-324",
                                   "1.7976931348623157e308",
                                   "3.4028235e38",
                                   "0.3000000000000000444089209850062616169452667236328125",
                                   "123456789012345678901234567890"}) {
      CAPTURE(text);
      constexpr double k_before = 42;
      double expected = k_before, found = k_before;
      const char *begin = text.data(), *end = begin + text.size();
      const auto by_library = std::from_chars(begin, end, expected);
      const auto by_strtod = dpr::from_chars_by_strtod(begin, end, found);
      CHECK((by_strtod.ec == by_library.ec));
      CHECK(by_strtod.ptr - begin == by_library.ptr - begin);
      CHECK(std::bit_cast<std::uint64_t>(found) == std::bit_cast<std::uint64_t>(expected));
    }
  }
}
#endif

}  // namespace from_chars_test
