// Comparing files of results, with made-up ones: the verdicts' rule, which rows belong together, files that
// are none.
#include "compare.hpp"

#include <doctest/doctest.h>

#include "csv.hpp"
#include "dpr/error.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace compare_test {

using dpr::bench::compare;
using dpr::bench::Json;
using dpr::bench::read_results;
using dpr::bench::verdict;
using dpr::test::TempDir;

namespace {

Json timing(double q1, double median, double q3, unsigned n = 15) {
  return {{"median", median}, {"q1", q1}, {"q3", q3}, {"n", n}};
}

Json row(const std::string& workload, const Json& forward, const Json& backward) {
  return {{"workload", workload},  {"preset", "gaussian"},    {"composition", "barrier"},
          {"estimator", "exact"},  {"moves", "shape"},        {"samples", 0},
          {"forward_ms", forward}, {"backward_ms", backward}, {"status", "ok"},
          {"reason", ""}};
}

Json results(const Json& rows) {
  return {{"schema", 1}, {"commit", "0123"}, {"device", {{"name", "made-up"}}}, {"results", rows}};
}

}  // namespace

TEST_SUITE("bench-smoke") {
  TEST_CASE("a verdict needs a change of 5% and middle halves that do not overlap") {
    const Json base = timing(9, 10, 11);
    CHECK(verdict(base, base) == "same");
    CHECK(verdict(base, timing(7, 8, 8.9)) == "faster");
    CHECK(verdict(base, timing(7, 8, 9.1)) == "unclear");  // the halves touch
    CHECK(verdict(base, timing(11.1, 12, 13)) == "slower");
    CHECK(verdict(base, timing(10.9, 12, 13)) == "unclear");
    const Json narrow = timing(9.99, 10, 10.01);
    CHECK(verdict(narrow, timing(10.3, 10.4, 10.5)) == "same");  // 4%
    CHECK(verdict(narrow, timing(10.5, 10.6, 10.7)) == "slower");
    CHECK(verdict(timing(10.5, 10.6, 10.7), narrow) == "faster");
  }

  TEST_CASE("a change that few runs show is unclear") {
    CHECK(verdict(timing(9, 10, 11, 4), timing(4, 5, 6)) == "unclear");
    CHECK(verdict(timing(9, 10, 11), timing(4, 5, 6, 4)) == "unclear");
    CHECK(verdict(timing(9, 10, 11, 5), timing(4, 5, 6, 5)) == "faster");
    CHECK(verdict(timing(9, 10, 11, 4), timing(9, 10, 11, 4)) == "same");
  }

  TEST_CASE("rows are matched by what they are; failed and lonely ones are told") {
    Json failed = row("million", timing(1, 1, 1), timing(1, 1, 1));
    failed["status"] = "failed";
    const Json a = results(Json::array({row("cube128", timing(1, 1, 1), timing(2, 2, 2)),
                                        row("sphere64", timing(1, 1, 1), timing(1, 1, 1)), failed}));
    const Json b = results(Json::array({row("views24", timing(1, 1, 1), timing(1, 1, 1)),
                                        row("million", timing(1, 1, 1), timing(1, 1, 1)),
                                        row("cube128", timing(3, 3, 3), timing(1, 1, 1))}));
    const Json comparison = compare(a, b);
    REQUIRE(comparison["rows"].size() == 1);
    const Json& only = comparison["rows"][0];
    CHECK(only["row"] == "cube128 gaussian barrier exact");
    CHECK(only["forward"]["ratio"].get<double>() == doctest::Approx(3));
    CHECK(only["forward"]["verdict"] == "slower");
    CHECK(only["backward"]["ratio"].get<double>() == doctest::Approx(0.5));
    CHECK(only["backward"]["verdict"] == "faster");
    CHECK(comparison["only_in_a"] == Json::array({"sphere64 gaussian barrier exact"}));
    CHECK(comparison["only_in_b"] ==
          Json::array({"views24 gaussian barrier exact", "million gaussian barrier exact"}));
    const std::string lines = dpr::bench::to_lines(comparison);
    CHECK(dpr::test::contains(lines, "1 faster  1 slower"));
    CHECK(dpr::test::contains(lines, "only in a: sphere64"));
  }

  TEST_CASE("a comparison fails above a ratio where a row is clearly slower, and nowhere else") {
    const Json fast = timing(9, 10, 11), slow = timing(14, 15, 16), unclear = timing(5, 15, 25);
    const auto against = [&](const Json& forward, const Json& backward) {
      return compare(results(Json::array({row("cube128", fast, fast)})),
                     results(Json::array({row("cube128", forward, backward)})));
    };
    dpr::bench::require_none_slower(against(fast, unclear), 1.1);
    dpr::bench::require_none_slower(against(fast, slow), 1.6);
    DPR_CHECK_MESSAGE_HAS(dpr::Error, dpr::bench::require_none_slower(against(fast, slow), 1.4),
                          "cube128 gaussian barrier exact, backward");
    const Json one = results(Json::array({row("cube128", fast, fast)}));
    const Json two = results(Json::array({row("cube128", fast, fast), row("million", fast, fast)}));
    dpr::bench::require_none_slower(compare(one, two), 1.1);
    DPR_CHECK_MESSAGE_HAS(dpr::Error, dpr::bench::require_none_slower(compare(two, one), 1.1), "million");
    DPR_CHECK_MESSAGE_HAS(
        dpr::Error, dpr::bench::require_none_slower(compare(results(Json::array()), one), 1.1), "in common");
  }

  TEST_CASE("what makes files hard to compare is said") {
    Json a = results(Json::array({row("cube128", timing(1, 1, 1), timing(1, 1, 1))}));
    CHECK(compare(a, a)["warnings"].empty());
    a["device"].update(Json{{"driver", "1"}, {"peak_gflops", 100}});
    a["load"] = {{"before", 0.1}, {"after", 0.2}};
    Json b = a;
    b["device"].update(Json{{"driver", "2"}, {"peak_gflops", 150}});
    b["load"]["after"] = 4.0;
    CHECK(compare(a, b)["warnings"] ==
          Json::array({"driver: 1 and 2", "peak GFLOP/s: 100 and 150", "load after: 0.2 and 4.0"}));
    CHECK(dpr::test::contains(dpr::bench::to_lines(compare(a, b)), "not alike: driver"));
  }

  TEST_CASE("values that CSV would take apart are quoted") {
    Json failed = row("million", timing(1, 1, 1), timing(1, 1, 1));
    failed["reason"] = "too large, for \"this\"";
    failed.erase("forward_ms");
    const std::string csv = dpr::bench::to_csv(results(Json::array({failed})));
    CHECK(dpr::test::contains(csv, ",ok,\"too large, for \"\"this\"\"\"\r\n"));
    CHECK(dpr::test::contains(csv, ",,,,,,,1.0,1.0,1.0,,,15,"));
  }

  TEST_CASE("rows of a sweep differ by what it varies") {
    Json few = row("sweep-views", timing(1, 1, 1), timing(1, 1, 1));
    few.update(Json{{"triangles", 1280}, {"width", 128}, {"height", 128}, {"views", 1}});
    Json many = few, still = few;
    many["views"] = 64;
    still.erase("moves");
    CHECK(dpr::bench::row_name(few) != dpr::bench::row_name(many));
    CHECK(dpr::bench::row_name(few) != dpr::bench::row_name(still));
    CHECK(compare(results(Json::array({few, many})), results(Json::array({many})))["rows"].size() == 1);
  }

  TEST_CASE("a file of results is read back as it was, and what is none is an error that says so") {
    const TempDir folder;
    const Json good = results(Json::array({row("cube128", timing(1, 2, 3), timing(4, 5, 6))}));
    const Json read = read_results(folder.write("good.json", good.dump()));
    CHECK(nlohmann::json(read) == nlohmann::json(good));  // but for the order of the keys
    const auto fails = [&](const Json& content, const char* part) {
      const auto file = folder.write("bad.json", content.dump());
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, read_results(file), part);
    };
    Json other = good;
    other["schema"] = 2;
    fails(other, "schema");
    fails(Json{{"results", Json::array()}}, "schema");
    other = good;
    other["results"][0].erase("forward_ms");
    fails(other, "forward_ms");
    other = good;
    other["results"][0]["backward_ms"]["median"] = 0;
    fails(other, "median");
    CHECK_THROWS_AS(read_results(folder / "missing.json"), dpr::IoError);
    CHECK_THROWS_AS(read_results(folder.write("broken.json", "{")), dpr::IoError);
  }
}

}  // namespace compare_test
