// dpr learn train, killed at any moment: nothing half-written, and the same losses in the end.
#include <doctest/doctest.h>

#include <filesystem>

#include "support/command.hpp"
#include "support/interruptions.hpp"

namespace dpr::test::train_interruption_test {

TEST_SUITE("robustness") {
  TEST_CASE("dpr learn train: killed 20 times it ends with the losses of an undisturbed run") {
    if (is_skipped()) return;
    const TempDir folder;
    REQUIRE(run_command(folder, {"learn", "data", "-o", "data", "--classes", "sofa", "--train", "2", "--val",
                                 "1", "--test", "1"})
                .status == 0);
    const std::filesystem::path run = folder / "run";
    std::string expected;
    const auto check = [&](bool finished) {
      const std::string losses = folder.read("run/losses.csv");
      if (finished && expected.empty()) expected = losses;
      // Interrupted, the file holds the steps up to a checkpoint.
      CHECK((finished ? losses == expected : expected.starts_with(losses)));
    };
    const auto clear = [&] { std::filesystem::remove_all(run); };
    const unsigned resumed =
        interrupt({program_path("DPR_CLI"),
                   folder.path(),
                   {"learn", "train", "--data", "data", "--classes", "sofa", "-o", "run", "--steps", "2",
                    "--batch", "2", "--checkpoint-every", "1", "--quiet"},
                   run / "checkpoint.pt",
                   check,
                   clear},
                  20, 1);
    CHECK(resumed > 0);
    CHECK(folder.read("run/losses.csv") == expected);
  }
}

}  // namespace dpr::test::train_interruption_test
