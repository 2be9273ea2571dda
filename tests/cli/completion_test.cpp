// The script that completes command lines, as bash runs it.
#include <doctest/doctest.h>

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "support/command.hpp"
#include "support/messages.hpp"

namespace completion_test {

namespace {

using dpr::test::is_skipped;
using dpr::test::run_command;
using dpr::test::run_program;
using dpr::test::TempDir;

/// Candidates that bash would offer for the last of the words.
std::vector<std::string> candidates(const TempDir& folder, const std::vector<std::string>& words) {
  std::string script = "source ./completion; COMP_WORDS=(";
  for (const std::string& word : words) script += dpr::test::quoted(word) + " ";
  script +=
      "); COMP_CWORD=" + std::to_string(words.size() - 1) + "; _dpr; printf '%s\\n' \"${COMPREPLY[@]}\"";
  const auto outcome = run_program("bash", folder, {"-c", script});
  CAPTURE(outcome.err);
  REQUIRE(outcome.status == 0);
  CHECK(outcome.err.empty());
  std::vector<std::string> lines;
  std::istringstream out(outcome.out);
  for (std::string line; std::getline(out, line);) {
    if (!line.empty()) lines.push_back(line);
  }
  std::ranges::sort(lines);
  return lines;
}

using Words = std::vector<std::string>;

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr completion bash: commands, options, their values, and files") {
    if (is_skipped()) return;
    const TempDir folder;
    const auto script = run_command(folder, {"completion", "bash"});
    REQUIRE(script.status == 0);
    folder.write("completion", script.out);
    folder.write("scene one.json", "{}");
    const auto offers = [&](const Words& words) { return candidates(folder, words); };
    CHECK(offers({"dpr", "de"}) == Words{"demo", "devices"});
    CHECK(offers({"dpr", "gradient", "--lo"}) == Words{"--loss"});
    CHECK(offers({"dpr", "gradient", "--loss", ""}) == Words{"l1", "mse", "robust", "silhouette", "ssim"});
    CHECK(offers({"dpr", "pose", "--search", "--method", "d"}) == Words{"descent"});
    CHECK(offers({"dpr", "render", "--device", ""}) == Words{"cpu", "gpu"});
    CHECK(offers({"dpr", "pose", "--scene", "scene"}) == Words{"scene one.json"});
    CHECK(offers({"dpr", "info", "sc"}) == Words{"scene one.json"});
    CHECK(offers({"dpr", "pose", "--seed", ""}).empty());
    CHECK(offers({"dpr", "completion", ""}) == Words{"bash"});
    CHECK(offers({"dpr", "nonsense"}).empty());
    const Words workloads = offers({"dpr", "bench", "--workload", ""});
    if (!workloads.empty()) CHECK(std::ranges::count(workloads, "sphere256") == 1);  // where it is built
    if (!offers({"dpr", "learn", ""}).empty()) {
      CHECK(offers({"dpr", "learn", "data", "--classes", "ch"}) == Words{"chair"});
      CHECK(offers({"dpr", "learn", "data", "--classes", "chair,s"}) == Words{"chair,sofa", "chair,speaker"});
    }
    const Words options = offers({"dpr", "fit", "--"});
    for (const char* option : {"--views", "--output", "--report", "--preset", "--help"})
      CHECK(std::ranges::count(options, option) == 1);
  }

  TEST_CASE("dpr completion: another shell is refused") {
    if (is_skipped()) return;
    const TempDir folder;
    const auto outcome = run_command(folder, {"completion", "tcsh"});
    CHECK(outcome.status == 1);
    CHECK(dpr::test::is_error_line(outcome.err));
  }
}

}  // namespace completion_test
