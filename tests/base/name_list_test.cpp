// Lists of names, and words that are looked up in them.
#include "base/name_list.hpp"

#include <doctest/doctest.h>

#include <array>

#include "dpr/error.hpp"
#include "support/messages.hpp"

namespace name_list_test {

TEST_SUITE("unit") {
  TEST_CASE("a list is split at commas, without the spaces around its items") {
    using List = std::vector<std::string>;
    CHECK(dpr::split_list("") == List{});
    CHECK(dpr::split_list("a") == List{"a"});
    CHECK(dpr::split_list(" a b ,c,  d") == List{"a b", "c", "d"});
    CHECK(dpr::split_list(",a,,") == List{"", "a", "", ""});
    CHECK(dpr::split_list(" ") == List{""});
  }

  TEST_CASE("a word is one of the names, or an error that lists them") {
    constexpr std::array<std::string_view, 3> names{"none", "back", "front"};
    CHECK(dpr::position_of("front", names, "cull") == 2);
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::position_of("fron", names, "cull"),
                          "cull: got \"fron\", expected none, back or front");
  }
}

}  // namespace name_list_test
