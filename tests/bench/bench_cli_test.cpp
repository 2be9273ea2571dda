// dpr bench as a user runs it: measure, compare, draw; and what it says of wrong input.
#include <doctest/doctest.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "base/input_file.hpp"
#include "results_file.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace bench_cli_test {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::Outcome;
using dpr::test::TempDir;

namespace {

Outcome bench(const TempDir& folder, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "bench");
  return dpr::test::run_command(folder, arguments);
}

void check_fails(const TempDir& folder, const std::vector<std::string>& arguments, const std::string& part) {
  const std::size_t before = folder.entries();
  const Outcome outcome = bench(folder, arguments);
  CAPTURE(outcome.err);
  CHECK(outcome.status == 1);
  CHECK(dpr::test::is_error_line(outcome.err));
  CHECK(contains(outcome.err, part));
  CHECK(folder.entries() == before);
}

constexpr const char* k_sweep_rows =
    R"({"schema": 1, "commit": "0", "device": {"name": "made-up"}, "results": [
  {"workload": "sweep-samples", "preset": "gaussian", "composition": "barrier", "estimator": "monte_carlo",
   "samples": 1, "triangles": 12, "width": 8, "height": 8, "views": 1, "peak_device_bytes": 100, "peak_rss_bytes": 200,
   "forward_ms": {"median": 1, "q1": 1, "q3": 1, "n": 5}, "backward_ms": {"median": 1, "q1": 1, "q3": 1, "n": 5},
   "status": "ok", "reason": ""},
  {"workload": "sweep-samples", "preset": "gaussian", "composition": "barrier", "estimator": "monte_carlo",
   "samples": 8, "triangles": 12, "width": 8, "height": 8, "views": 1, "peak_device_bytes": 100, "peak_rss_bytes": 200,
   "forward_ms": {"median": 3, "q1": 3, "q3": 3, "n": 5}, "backward_ms": {"median": 4, "q1": 4, "q3": 4, "n": 5},
   "status": "ok", "reason": ""}]})";

}  // namespace

TEST_SUITE("bench-smoke") {
  TEST_CASE("bench: measures, keeps, compares and draws") {
    if (is_skipped()) return;
    const TempDir folder;
    const Outcome measured =
        bench(folder, {"--workload", "cube128", "--repetitions", "1", "--max-seconds", "0", "--stage",
                       "aggregate", "-o", "a.json", "--csv", "a.csv", "--workload", "cube128"});
    CAPTURE(measured.err);
    REQUIRE(measured.status == 0);
    CHECK(contains(measured.out, "cube128 gaussian barrier monte_carlo M=128"));
    CHECK(contains(measured.out, "% of peak"));
    const dpr::bench::Json results = dpr::bench::read_results(folder / "a.json");
    CHECK(results["device"]["peak_gflops"].get<double>() > 0);
    CHECK(results["first_image_ms"].get<double>() > 0);
    CHECK(contains(results["build_options"].get<std::string>(), "-cl-std=CL1.2"));
    CHECK(contains(results["environment"]["date"].get<std::string>(), "Z"));
    CHECK(results["environment"]["cpus"].get<unsigned>() > 0);
    std::set<std::string> names;
    for (const auto& row : results["results"]) {
      CHECK(row["status"] == "ok");
      CHECK(row["stages"].size() == 1);
      CHECK(row["forward_ms"]["runs"].size() == 1);
      names.insert(dpr::bench::row_name(row));
    }
    CHECK(names.size() == results["results"].size());  // a workload that is named twice is measured once
    const std::string csv = dpr::read_file(folder / "a.csv");
    CHECK(csv.starts_with("workload,preset,"));
    CHECK(dpr::test::contains(
        csv, ",transfers_bytes_to_device,transfers_bytes_from_device,transfers_host_waits,"));
    CHECK(static_cast<std::size_t>(std::ranges::count(csv, '\n')) == results["results"].size() + 1);
    const Outcome compared = bench(folder, {"--compare", "a.json", "a.json", "-o", "c.json"});
    CHECK(compared.status == 0);
    CHECK(contains(compared.out, std::to_string(2 * results["results"].size()) + " same"));
    folder.write("sweep.json", k_sweep_rows);
    const Outcome drawn = bench(folder, {"--report", "report", "a.json", "sweep.json"});
    CAPTURE(drawn.err);
    CHECK(drawn.status == 0);
    for (const char* const picture :
         {"stages.png", "roofline.png", "scaling.png", "memory.png", "devices.png"}) {
      CHECK(std::filesystem::file_size(folder / "report" / picture) > 1000);
    }
  }

  TEST_CASE("bench: a frame in several bands has times, but no rates") {
    if (is_skipped()) return;
    const TempDir folder;
    const auto rasterize = [&](const std::string& budget) {
      const Outcome measured =
          bench(folder, {"--workload", "sphere20k", "--repetitions", "1", "--max-seconds", "0",
                         "--memory-budget", budget, "-o", "r.json"});
      CAPTURE(measured.err);
      REQUIRE(measured.status == 0);
      const dpr::bench::Json results = dpr::bench::read_results(folder / "r.json");
      CHECK(results["memory_budget_bytes"].get<std::size_t>() == std::stoul(budget) << 20U);
      CHECK((results["results"][0]["bands"].get<std::size_t>() > 1) == (budget == "64"));
      return results["results"][0]["stages"]["rasterize"];
    };
    CHECK(rasterize("1024").contains("gflops"));
    const dpr::bench::Json in_bands = rasterize("64");
    CHECK(in_bands["forward_ms"].get<double>() > 0);
    CHECK_FALSE(in_bands.contains("gflops"));
  }

  TEST_CASE("bench: a preset chooses rows, in which the shape or the camera moves") {
    if (is_skipped()) return;
    const TempDir folder;
    const Outcome measured = bench(folder, {"--workload", "cube128", "--repetitions", "1", "--max-seconds",
                                            "0", "--preset", "pixel", "-o", "r.json"});
    CAPTURE(measured.err);
    REQUIRE(measured.status == 0);
    std::set<std::string> moves;
    const dpr::bench::Json results = dpr::bench::read_results(folder / "r.json");
    for (const auto& row : results["results"]) {
      CHECK(row["preset"] == "pixel");
      moves.insert(row["moves"].get<std::string>());
    }
    CHECK(moves == std::set<std::string>{"camera", "shape"});
  }

  TEST_CASE("bench: the help lists every workload") {
    if (is_skipped()) return;
    const Outcome help = bench(TempDir(), {"--help"});
    CHECK(help.status == 0);
    for (const char* const name : {"cube128", "million", "views24", "sweep-triangles"}) {
      CHECK(contains(help.out, name));
    }
  }

  TEST_CASE("bench: wrong input is one line, before anything is measured or written") {
    if (is_skipped()) return;
    const TempDir folder;
    folder.write("other.json", R"({"schema": 9, "commit": "", "device": {"name": ""}, "results": []})");
    folder.write("empty.json", R"({"schema": 1, "commit": "", "device": {"name": ""}, "results": []})");
    folder.write("text.json", "no results");
    check_fails(folder, {"--workload", "sphere", "-o", "r.json"}, "sphere256");
    check_fails(folder, {"--workload", "cube128", "--stage", "nonsense"}, "rasterize");
    check_fails(folder, {"--workload", "cube128", "--preset", "nonsense"},
                "--preset (command line): got \"nonsense\", expected gaussian, softras, default, pixel, "
                "pixel-sharp or sharp");
    check_fails(folder, {"--devices", "gpu"}, "--devices (command line): got \"gpu\", expected all");
    check_fails(folder, {"--repetitions", "0"}, "expected a number from 1 to 1000");
    check_fails(folder, {"--workload", "cube128", "--preset", "softras", "-o", "r.json"}, "softras");
    check_fails(folder, {"--workload", "cube128", "-o", "no_folder/r.json"}, "no_folder");
    check_fails(folder, {"--repetitions", "0"}, "--repetitions");
    check_fails(folder, {"--compare", "empty.json"}, "--compare");
    check_fails(folder, {"--compare", "empty.json", "missing.json"}, "missing.json");
    check_fails(folder, {"--compare", "empty.json", "other.json"}, "schema");
    check_fails(folder, {"--compare", "text.json", "empty.json"}, "text.json");
    check_fails(folder, {"--fail-above", "1.1"}, "--compare");
    check_fails(folder, {"--report", "report"}, "files");
    check_fails(folder, {"--report", "report", "empty.json"}, "no measured rows");
    check_fails(folder, {"empty.json"}, "--report");
    check_fails(folder, {"--workload", "cube128", "--quiet"}, "--quiet (command line): got nothing to write");
    check_fails(folder, {"--compare", "empty.json", "empty.json", "--quiet"}, "--quiet");
  }
}

}  // namespace bench_cli_test
