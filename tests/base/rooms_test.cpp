// The folders of lib as floors: a file includes only its own folder and those below it.
#include <doctest/doctest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <vector>

#include "support/data.hpp"

namespace rooms_test {

namespace {

/// From the ground up.
const std::vector<std::string> k_floors{"reference", "base",  "image",        "codecs", "mesh",
                                        "smoothing", "scene", "kernels",      "device", "stages",
                                        "renderer",  "loss",  "multi_device", "solve",  "c",
                                        "batch",     "check", "cli",          "learn"};

std::ptrdiff_t floor_of(const std::string& folder) {
  return std::ranges::find(k_floors, folder) - k_floors.begin();
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("rooms: no folder of the library includes one above it") {
    const std::filesystem::path lib = dpr::test::data_folder() / "../../lib";
    const std::regex include(R"rx(^#include "([a-z_]+)/)rx");
    std::size_t arrows = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(lib)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".cpp" && extension != ".hpp") continue;
      const std::string from = entry.path().parent_path().filename().string();
      CAPTURE(entry.path().string());
      REQUIRE(floor_of(from) < std::ssize(k_floors));
      std::ifstream file(entry.path());
      for (std::string line; std::getline(file, line);) {
        std::smatch found;
        if (!std::regex_search(line, found, include) || found[1] == "dpr") continue;
        CAPTURE(line);
        const std::string to = found[1];
        CHECK(floor_of(to) < std::ssize(k_floors));
        CHECK(floor_of(to) <= floor_of(from));
        ++arrows;
      }
    }
    CHECK(arrows > 100);
  }
}

}  // namespace rooms_test
