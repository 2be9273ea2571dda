#include "csv.hpp"

#include <algorithm>
#include <vector>

namespace dpr::bench {
namespace {

/// JSON paths of the columns within a row.
std::vector<std::string> columns() {
  std::vector<std::string> paths{"workload", "preset", "composition", "estimator", "samples", "sigma",
                                 "seed",     "moves",  "triangles",   "width",     "height",  "views"};
  for (const char* const timing : {"forward_ms", "backward_ms"}) {
    for (const char* const part : {"median", "q1", "q3", "min", "p95", "n"})
      paths.push_back(std::string(timing) + "/" + part);
  }
  for (const char* const key :
       {"fragments", "bands", "peak_device_bytes", "peak_rss_bytes", "transfers/bytes_to_device",
        "transfers/bytes_from_device", "transfers/host_waits", "status", "reason"})
    paths.emplace_back(key);
  return paths;
}

/// Text is quoted where it has to be.
std::string cell(const Json& row, const std::string& path) {
  const Json::json_pointer pointer("/" + path);
  if (!row.contains(pointer)) return "";
  const Json& value = row[pointer];
  if (!value.is_string()) return value.dump();
  const std::string text = value.get<std::string>();
  if (text.find_first_of(",\"\r\n") == text.npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

std::string to_csv(const Json& results) {
  const std::vector<std::string> paths = columns();
  std::string text;
  for (const std::string& path : paths) {
    std::string name = path;
    std::ranges::replace(name, '/', '_');
    text += (text.empty() ? "" : ",") + name;
  }
  for (const Json& row : results["results"]) {
    text += "\r\n";
    for (const std::string& path : paths) text += (path == paths.front() ? "" : ",") + cell(row, path);
  }
  return text + "\r\n";
}

}  // namespace dpr::bench
