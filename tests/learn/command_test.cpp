// dpr learn as a user runs it.
#include <doctest/doctest.h>
#include <sys/stat.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "support/command.hpp"
#include "support/messages.hpp"

namespace dpr::test::command_test {
namespace {

Outcome learn(const TempDir& folder, const std::vector<std::string>& arguments) {
  std::vector<std::string> words{"learn"};
  for (const std::string& argument : arguments) words.push_back(argument);
  return run_command(folder, words);
}

void check_refused(const Outcome& outcome, const std::string& part) {
  CHECK(outcome.status == 1);
  CHECK_MESSAGE(is_error_line(outcome.err), outcome.err);
  CHECK_MESSAGE(contains(outcome.err, part), outcome.err);
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("learn: data, train, eval and show, and one line for what is wrong") {
    if (is_skipped()) return;
    const TempDir folder;
    Outcome outcome = learn(
        folder, {"data", "-o", "data", "--classes", "sofa", "--train", "4", "--val", "1", "--test", "1"});
    REQUIRE_MESSAGE(outcome.status == 0, outcome.err);
    CHECK(contains(outcome.out, "contact_sheet.png"));
    const std::vector<std::string> data{"--data", "data", "--classes", "sofa"};
    const auto with_data = [&](std::vector<std::string> words) {
      for (const std::string& word : data) words.push_back(word);
      return learn(folder, words);
    };
    outcome = with_data({"train", "-o", "run", "--steps", "2", "--batch", "2"});
    REQUIRE_MESSAGE(outcome.status == 0, outcome.err);
    CHECK(contains(outcome.out, "in the renderer"));
    outcome = with_data({"eval", "--checkpoint", "run/checkpoint.pt", "--views", "2", "-o", "iou.json"});
    REQUIRE_MESSAGE(outcome.status == 0, outcome.err);
    CHECK(contains(folder.read("iou.json"), "\"mean_iou\""));
    outcome = with_data({"show", "--checkpoint", "run/checkpoint.pt", "-o", "figure.png"});
    REQUIRE_MESSAGE(outcome.status == 0, outcome.err);
    CHECK(folder.read("figure.png").size() > 1000);

    check_refused(learn(folder, {"eval", "--checkpoint", "run/checkpoint.pt", "--data", "data"}),
                  "02691156_test_images.npz");
    check_refused(with_data({"eval", "--checkpoint", "none.pt"}), "none.pt");
    const std::vector<std::pair<std::string, std::string>> irregular{
        {"data", "folder"}, {"/dev/zero", "regular file"}, {"pipe.pt", "regular file"}};
    REQUIRE(mkfifo((folder / "pipe.pt").c_str(), 0600) == 0);
    for (const auto& [file, part] : irregular) {
      check_refused(with_data({"eval", "--checkpoint", file}), part);
      check_refused(with_data({"show", "--checkpoint", file, "-o", "f.png"}), part);
    }
    REQUIRE(std::filesystem::create_directory(folder / "piped"));
    std::filesystem::rename(folder / "pipe.pt", folder / "piped" / "checkpoint.pt");
    check_refused(with_data({"train", "-o", "piped", "--steps", "1", "--batch", "2"}), "regular file");
    check_refused(with_data({"eval", "--checkpoint", "run/checkpoint.pt", "-o", "/proc/iou.json"}),
                  "cannot be written");
    check_refused(with_data({"train", "-o", "unwanted", "--method", "hard"}), "hard");
    CHECK_FALSE(std::filesystem::exists(folder / "unwanted"));
    check_refused(with_data({"train", "-o", "run", "--palette", "3"}), "palette colours");
    check_refused(with_data({"train", "-o", "run", "--seed", "-1"}), "--seed");
    check_refused(with_data({"show", "--checkpoint", "run/checkpoint.pt", "-o", "f.png", "--object", "9"}),
                  "below 1");
    outcome = with_data({"train", "-o", "wild", "--steps", "50", "--batch", "2", "--learning-rate", "1e30"});
    check_refused(outcome, "got");
    check_refused(with_data({"show", "--checkpoint", "no.pt", "-o", "f.nonsense"}), "got the extension");
    CHECK_FALSE(contains(outcome.err, "error: dpr"));
    check_refused(learn(folder, {"train", "-o", "run", "--data", "data", "--classes", "horse"}), "horse");
    check_refused(learn(folder, {"fly"}), "unknown command \"fly\"");
    CHECK(learn(folder, {"--help"}).status == 0);
  }
}

}  // namespace dpr::test::command_test
