#include "compare.hpp"

#include <cmath>
#include <cstdio>
#include <map>
#include <utility>

#include "cli/text.hpp"
#include "dpr/error.hpp"

namespace dpr::bench {
namespace {

constexpr double k_least_change = 1.05;
constexpr unsigned k_least_runs = 5;
constexpr double k_like_peaks = 1.1, k_like_load = 1;

double ratio(const Json& first, const Json& second) {
  return second["median"].get<double>() / first["median"].get<double>();
}

Json compare_timings(const Json& first, const Json& second) {
  return {{"a_ms", first["median"]},
          {"b_ms", second["median"]},
          {"ratio", ratio(first, second)},
          {"verdict", verdict(first, second)}};
}

Json where_from(const Json& results) {
  return {{"commit", results["commit"]}, {"device", results["device"]}};
}

/// A value of a results file as text; empty where it is older than the value.
std::string text_at(const Json& results, const char* path) {
  const Json::json_pointer pointer(path);
  if (!results.contains(pointer)) return "";
  const Json& value = results[pointer];
  return value.is_string() ? value.get<std::string>() : value.dump();
}

Json differences(const Json& a, const Json& b) {
  Json warnings = Json::array();
  constexpr std::pair<const char*, const char*> k_settings[] = {{"device", "/device/name"},
                                                                {"driver", "/device/driver"},
                                                                {"build options", "/build_options"},
                                                                {"memory budget", "/memory_budget_bytes"},
                                                                {"host", "/environment/host"},
                                                                {"processor", "/environment/cpu"},
                                                                {"variables", "/environment/variables"}};
  for (const auto& [name, path] : k_settings) {
    const std::string in_a = text_at(a, path), in_b = text_at(b, path);
    if (in_a != in_b && !in_a.empty() && !in_b.empty())
      warnings.push_back(std::string(name) + ": " + in_a + " and " + in_b);
  }
  return warnings;
}

double number_at(const Json& results, const char* path) {
  const Json::json_pointer pointer(path);
  return results.contains(pointer) ? results[pointer].get<double>() : 0;
}

/// The same device is not always as fast, nor alone.
void add_conditions(const Json& a, const Json& b, Json& warnings) {
  for (const auto& [name, path] : {std::pair{"peak GFLOP/s", "/device/peak_gflops"},
                                   std::pair{"peak GB/s", "/device/peak_gbytes_per_s"}}) {
    const double in_a = number_at(a, path), in_b = number_at(b, path);
    if (in_a > 0 && in_b > 0 && std::fmax(in_a / in_b, in_b / in_a) > k_like_peaks)
      warnings.push_back(cli::format("%s: %.4g and %.4g", name, in_a, in_b));
  }
  for (const char* const when : {"before", "after"}) {
    const std::string path = std::string("/load/") + when;
    const double in_a = number_at(a, path.c_str()), in_b = number_at(b, path.c_str());
    if (a.contains("load") && b.contains("load") && std::fabs(in_a - in_b) > k_like_load)
      warnings.push_back(cli::format("load %s: %.1f and %.1f", when, in_a, in_b));
  }
}

std::map<std::string, const Json*> measured_rows(const Json& results) {
  std::map<std::string, const Json*> rows;
  for (const Json& row : results["results"]) {
    if (is_measured(row)) rows.emplace(row_name(row), &row);
  }
  return rows;
}

/// The names in the order of the file.
Json names_without_partner(const Json& results, const std::map<std::string, const Json*>& others) {
  Json names = Json::array();
  for (const Json& row : results["results"]) {
    if (is_measured(row) && !others.contains(row_name(row))) names.push_back(row_name(row));
  }
  return names;
}

std::string line(const char* format, const std::string& name, const Json& timing) {
  char text[160];
  std::snprintf(text, sizeof text, format, name.c_str(), timing["a_ms"].get<double>(),
                timing["b_ms"].get<double>(), timing["ratio"].get<double>(),
                timing["verdict"].get<std::string>().c_str());
  return text;
}

}  // namespace

std::string verdict(const Json& first, const Json& second) {
  const double change = ratio(first, second);
  if (std::fmax(change, 1 / change) <= k_least_change) return "same";
  for (const Json* timing : {&first, &second}) {
    if ((*timing)["n"].get<unsigned>() < k_least_runs) return "unclear";
  }
  if (second["q3"].get<double>() < first["q1"].get<double>()) return "faster";
  return second["q1"].get<double>() > first["q3"].get<double>() ? "slower" : "unclear";
}

Json compare(const Json& a, const Json& b) {
  const auto in_a = measured_rows(a), in_b = measured_rows(b);
  Json rows = Json::array(), warnings = differences(a, b);
  add_conditions(a, b, warnings);
  for (const Json& row : a["results"]) {
    const auto partner = in_b.find(row_name(row));
    if (!is_measured(row) || partner == in_b.end()) continue;
    rows.push_back({{"row", row_name(row)},
                    {"forward", compare_timings(row["forward_ms"], (*partner->second)["forward_ms"])},
                    {"backward", compare_timings(row["backward_ms"], (*partner->second)["backward_ms"])}});
  }
  return {{"a", where_from(a)},
          {"b", where_from(b)},
          {"warnings", warnings},
          {"rows", rows},
          {"only_in_a", names_without_partner(a, in_b)},
          {"only_in_b", names_without_partner(b, in_a)}};
}

void require_none_slower(const Json& comparison, double ratio) {
  if (comparison["rows"].empty()) throw Error("the files have no measured row in common");
  if (const Json& lost = comparison["only_in_a"]; !lost.empty())
    throw Error("measured in the first file alone: " + lost.front().get<std::string>() +
                (lost.size() > 1 ? " and " + std::to_string(lost.size() - 1) + " more" : ""));
  std::string names;
  for (const Json& row : comparison["rows"]) {
    for (const char* const pass : {"forward", "backward"}) {
      const Json& timing = row[pass];
      if (timing["verdict"] == "slower" && timing["ratio"].get<double>() > ratio)
        names += (names.empty() ? "" : "; ") + row["row"].get<std::string>() + ", " + pass;
    }
  }
  if (!names.empty()) throw Error(cli::format("slower by more than %g times: ", ratio) + names);
}

std::string to_lines(const Json& comparison) {
  std::string text;
  for (const char* const side : {"a", "b"}) {
    text += std::string(side) + ": " + comparison[side]["commit"].get<std::string>() + ", " +
            comparison[side]["device"]["name"].get<std::string>() + "\n";
  }
  for (const Json& warning : comparison["warnings"])
    text += "not alike: " + warning.get<std::string>() + "\n";
  std::map<std::string, unsigned> verdicts;
  for (const Json& row : comparison["rows"]) {
    for (const char* const pass : {"forward", "backward"}) {
      const std::string name = row["row"].get<std::string>() + ", " + pass;
      text += line("%-58s %10.3f ms %10.3f ms  x %5.2f  %s\n", name, row[pass]);
      ++verdicts[row[pass]["verdict"].get<std::string>()];
    }
  }
  for (const char* const side : {"a", "b"}) {
    for (const Json& name : comparison["only_in_" + std::string(side)]) {
      text += "only in " + std::string(side) + ": " + name.get<std::string>() + "\n";
    }
  }
  for (const auto& [name, count] : verdicts) text += std::to_string(count) + " " + name + "  ";
  return text + "\n";
}

}  // namespace dpr::bench
