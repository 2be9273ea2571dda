#include "results_file.hpp"

#include <fstream>

#include "base/json_node.hpp"
#include "dpr/error.hpp"

namespace dpr::bench {
namespace {

void check_timing(const JsonNode& timing) {
  for (const char* const key : {"median", "q1", "q3"}) {
    const JsonNode value = timing.at(key);
    if (!(value.number() > 0)) value.fail(std::to_string(value.number()), "milliseconds above 0");
  }
  timing.at("n").whole_number(1U << 20U);
}

void check_row(const JsonNode& row) {
  for (const char* const key : {"workload", "preset", "composition", "estimator", "status"}) {
    row.at(key).string();
  }
  row.at("samples").whole_number(1U << 20U);
  if (row.at("workload").string().starts_with("sweep-")) {
    for (const char* const key : {"triangles", "width", "views"}) row.at(key).whole_number(1U << 30U);
  }
  if (row.at("status").string() != "ok") return;
  check_timing(row.at("forward_ms"));
  check_timing(row.at("backward_ms"));
}

}  // namespace

Json read_results(const std::filesystem::path& file) {
  const nlohmann::json document = read_json(file);
  const JsonNode root(document, file);
  const JsonNode schema = root.at("schema");
  if (schema.number() != k_results_schema) {
    schema.fail(std::to_string(schema.number()), std::to_string(k_results_schema));
  }
  root.at("device").at("name").string();
  for (const JsonNode& row : root.at("results").elements()) check_row(row);
  return Json(document);
}

std::string row_name(const Json& row) {
  const std::string name = row["workload"].get<std::string>();
  std::string text = name;
  if (name == "sweep-triangles" || name == "sweep-tessellation") text += "/" + row["triangles"].dump();
  if (name == "sweep-sigma") text += "/" + row["sigma"].dump();
  if (name == "sweep-pixels") text += "/" + row["width"].dump();
  if (name == "sweep-views") text += "/" + row["views"].dump();
  for (const char* const key : {"preset", "composition", "estimator"}) {
    text += " " + row[key].get<std::string>();
  }
  if (const auto samples = row["samples"].get<unsigned>(); samples > 0)
    text += " M=" + std::to_string(samples);
  // Files of 0.2 lack the key: their scenes do not move.
  const std::string moves = row.value("moves", "nothing");
  return moves == "shape" ? text : text + ", " + moves + " moves";
}

bool is_measured(const Json& row) { return row["status"] == "ok"; }

double total_ms(const Json& row, const char* figure) {
  return row["forward_ms"][figure].get<double>() + row["backward_ms"][figure].get<double>();
}

}  // namespace dpr::bench
