// Poses of a sequence in CSV and JSON.
#include "cli/track_files.hpp"

#include <algorithm>
#include <array>

#include "cli/pose_report.hpp"
#include "cli/text.hpp"

namespace dpr::cli {
namespace {

/// As RFC 4180 has it.
std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

std::string csv_vector(const glm::dvec3& v) { return format("%.9g,%.9g,%.9g", v.x, v.y, v.z); }

Json row_to_json(const TrackRow& row, const Scene& scene, const PoseBody& body) {
  Json json{{"frame", row.frame}, {"file", row.file}, {"status", std::string(name_of(row.found.status))}};
  if (row.found.status != TrackStatus::lost) {
    json.update(hypothesis_to_json({.pose = row.found.pose, .loss = row.found.loss}, scene, body));
    json.erase("focal_scale");
    if (!row.found.covariance.empty()) json["covariance"] = covariance_to_json(row.found.covariance);
  }
  json["loss"] = row.found.loss;
  json["explained_below"] = row.found.explained_below;
  json["seconds"] = row.seconds;
  return json;
}

}  // namespace

std::string_view name_of(TrackStatus status) {
  static constexpr std::array<std::string_view, 3> names{"found", "tracked", "lost"};
  return names[static_cast<std::size_t>(status)];
}

TrackTable::TrackTable(const std::filesystem::path& file) : output_(file) {
  constexpr std::string_view k_head = "frame,file,status,rx,ry,rz,tx,ty,tz,loss,explained_below,seconds\n";
  output_.write(k_head.data(), k_head.size());
}

void TrackTable::add(const TrackRow& row) {
  const TrackedPose& found = row.found;
  const bool is_lost = found.status == TrackStatus::lost;
  std::string line =
      std::to_string(row.frame) + "," + csv_text(row.file) + "," + std::string(name_of(found.status));
  line += "," + (is_lost ? ",," : csv_vector(vector_from_rotation(found.pose.rotation)));
  line += "," + (is_lost ? ",," : csv_vector(found.pose.translation));
  line += format(",%.9g,%.9g,%.6f\n", found.loss, found.explained_below, row.seconds);
  output_.write(line.data(), line.size());
}

Json track_to_json(const Scene& scene, const std::vector<TrackRow>& rows, const std::string& error) {
  const auto count = [&](TrackStatus status) {
    return std::ranges::count(rows, status, [](const TrackRow& row) { return row.found.status; });
  };
  Json json{{"frames", rows.size()}};
  for (const TrackStatus status : {TrackStatus::found, TrackStatus::tracked, TrackStatus::lost})
    json[std::string(name_of(status))] = count(status);
  if (!error.empty()) json["error"] = error;
  Json& poses = json["poses"] = Json::array();
  const PoseBody body(scene, {});
  for (const TrackRow& row : rows) poses.push_back(row_to_json(row, scene, body));
  return json;
}

}  // namespace dpr::cli
