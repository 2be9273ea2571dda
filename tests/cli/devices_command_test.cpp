// dpr devices: the list, the self-test, and the width of the vectors that the environment asks for.
#include <doctest/doctest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "support/command.hpp"

namespace devices_command_test {

using namespace dpr::test;

TEST_SUITE("pipeline") {
  TEST_CASE("devices --check: every stage agrees with the reference, on vectors and on single lanes") {
    if (is_skipped()) return;
    const TempDir folder;
    for (const std::string lanes : {"1", "16"}) {
      CAPTURE(lanes);
      const Outcome outcome =
          run_command(folder, {"devices", "--check", "--json", "--device", "cpu"}, "DPR_LANES=" + lanes);
      CAPTURE(outcome.out);
      REQUIRE(outcome.status == 0);
      const nlohmann::json devices = nlohmann::json::parse(outcome.out);
      REQUIRE(devices.size() == 1);
      CHECK(std::to_string(devices[0]["lanes"].get<int>()) == lanes);
      const nlohmann::json& check = devices[0]["check"];
      CHECK(check["failed"] == 0);
      CHECK(check["comparisons"] == check["rows"].size());
      CHECK(check["rows"].size() > 40);
      for (const nlohmann::json& row : check["rows"]) {
        CAPTURE(row["stage"].get<std::string>());
        CHECK(row["passed"] == true);
        CHECK(row["worst"].get<double>() <= row["bound"].get<double>());
      }
    }
  }

  TEST_CASE("devices: a device that is not there, and lanes that no kernel has") {
    if (is_skipped()) return;
    const TempDir folder;
    const Outcome none = run_command(folder, {"devices", "--device", "cpu,no such device"});
    CHECK(none.status == 1);
    CHECK(none.err.find("'no such device'") != std::string::npos);
    const Outcome lanes = run_command(folder, {"devices"}, "DPR_LANES=4");
    CHECK(lanes.status == 1);
    CHECK(lanes.err == "dpr: error: DPR_LANES (environment): got '4', expected 1, 8 or 16\n");
  }
}

}  // namespace devices_command_test
