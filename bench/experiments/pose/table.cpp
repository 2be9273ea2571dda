// Rows of a pose experiment.
#include "experiments/pose/table.hpp"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>

#include "cli/progress.hpp"
#include "cli/provenance.hpp"
#include "dpr/error.hpp"
#include "experiments/pose/methods.hpp"

namespace dpr::bench {
namespace {

using cli::Json;

constexpr int k_schema = 1;
constexpr double k_same_image = 1e-3;  // part of the pixels: below it, two poses show the same

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values.empty() ? 0 : values[values.size() / 2];
}

std::vector<double> column(const Json& rows, const char* name) {
  std::vector<double> values;
  for (const Json& row : rows) values.push_back(row.at(name).get<double>());
  return values;
}

template <typename Condition>
double part(const Json& rows, const Condition& condition) {
  if (rows.empty()) return 0;
  const auto count = std::ranges::count_if(rows, condition);
  return static_cast<double>(count) / static_cast<double>(rows.size());
}

Json summary(const Json& rows) {
  const auto below = [&](double degrees) {
    return part(rows, [&](const Json& row) { return row.at("end_degrees") < degrees; });
  };
  const std::vector<double> angles = column(rows, "end_degrees");
  double sum = 0;
  for (const double angle : angles) sum += angle;
  const auto same = [](const Json& row) {
    return row.at("end_degrees") < 10 || row.at("differing_pixels") < k_same_image;
  };
  const auto in_space = [](const Json& row) {
    return row.at("end_degrees") < 5 && row.at("end_translation") < 0.02;
  };
  return {{"problems", rows.size()},
          {"below_10_degrees", below(10)},
          {"below_10_degrees_or_same_image", part(rows, same)},
          {"below_5_degrees", below(5)},
          {"below_5_degrees_and_2_percent", part(rows, in_space)},
          {"below_2_degrees", below(2)},
          {"average_degrees", angles.empty() ? 0.0 : sum / static_cast<double>(angles.size())},
          {"median_degrees", median(angles)},
          {"median_seconds", median(column(rows, "seconds"))},
          {"median_cpu_seconds", median(column(rows, "cpu_seconds"))}};
}

/// One problem solved.
Json solve_row(const Device& device, const Scene& scene, RigidCamera& camera, const PoseRun& run,
               std::size_t index) {
  const PoseProblem& problem = run.problems[index];
  const Image target = make_target(camera, run.set, problem);
  const std::clock_t start = std::clock();
  const PoseResult result = solve_problem(run.method, device, scene, run.set, problem, target, run.smoke);
  const double cpu_seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  double nearest = angle_degrees(result.pose.rotation, problem.truth.rotation);
  const double end = nearest;
  for (const PoseHypothesis& other : result.equals) {
    nearest = std::min(nearest, angle_degrees(other.pose.rotation, problem.truth.rotation));
  }
  return {{"problem", index},
          {"start_degrees", angle_degrees(problem.initial.rotation, problem.truth.rotation)},
          {"end_degrees", end},
          {"end_translation",
           glm::length(result.pose.translation - problem.truth.translation) / k_pose_camera_distance},
          {"nearest_equal_degrees", nearest},
          {"equals", result.equals.size()},
          {"loss", result.loss},
          {"explained", result.explained},
          {"differing_pixels", differing_pixels(camera.render(result.pose), camera.render(problem.truth))},
          {"iterations", result.iterations},
          {"seconds", result.seconds},
          {"cpu_seconds", cpu_seconds}};
}

Json head(const Device& device, const PoseRun& run) {
  const DeviceInfo& info = device.info();
  return {
      {"schema", k_schema},
      {"commit", cli::commit()},
      {"device", {{"platform", info.platform}, {"name", info.name}, {"compute_units", info.compute_units}}},
      {"method", label(run.method)},
      {"set", to_json(run.set)},
      {"size", run.size},
      {"smoke", run.smoke}};
}

/// The rows of an earlier run of the same.
Json earlier_rows(const std::filesystem::path& file, const Json& wanted) {
  std::ifstream stream(file);
  if (!stream) return Json::array();
  try {
    const Json json = Json::parse(stream);
    for (const char* key : {"schema", "method", "set", "size", "smoke"}) {
      if (json.at(key) != wanted.at(key)) {
        throw InvalidArgument(file.string() + " (pose experiment)", std::string("another ") + key,
                              "a run of the same, or no file");
      }
    }
    return json.at("rows");
  } catch (const nlohmann::json::exception& error) {
    throw IoError(file, std::string("no results of a pose experiment: ") + error.what());
  }
}

/// Writes the problems for others to replay. A longer file of the same set stays.
void keep_problems(const std::filesystem::path& file, const PoseRun& run) {
  PoseProblemSet set;
  if (std::filesystem::exists(file) && read_pose_problems(file, set).size() > run.problems.size()) return;
  write_pose_problems(file, run.set, run.problems);
}

void print(const std::string& name, const Json& s) {
  const auto percent = [&](const char* key) { return 100 * s[key].get<double>(); };
  std::printf(
      "%-36s %3zu problems  below 10: %5.1f%% (or same image: %5.1f%%)  5: %5.1f%%  2: %5.1f%%  average "
      "%7.3f  "
      "median %7.3f  %6.2f s (%6.2f CPU s)\n",
      name.c_str(), s["problems"].get<std::size_t>(), percent("below_10_degrees"),
      percent("below_10_degrees_or_same_image"), percent("below_5_degrees"), percent("below_2_degrees"),
      s["average_degrees"].get<double>(), s["median_degrees"].get<double>(),
      s["median_seconds"].get<double>(), s["median_cpu_seconds"].get<double>());
  std::fflush(stdout);
}

}  // namespace

std::string file_stem(const PoseRun& run) {
  const PoseProblemSet& set = run.set;
  char text[64];
  std::snprintf(text, sizeof text, "-%g%s%s%s-seed%llu-", set.initial_degrees,
                set.translation_error > 0 ? "-6d" : "", set.clutter ? "-clutter" : "",
                set.occluded > 0 ? "-occluded" : "", static_cast<unsigned long long>(set.seed));
  return std::filesystem::path(set.object).stem().string() + text + label(run.method);
}

Json run_poses(const Device& device, const PoseRun& run, const std::filesystem::path& folder) {
  const std::string stem = file_stem(run);
  const std::filesystem::path file = folder / (stem + ".json");
  const std::string set_stem = stem.substr(0, stem.size() - label(run.method).size());
  keep_problems(folder / (set_stem + "problems.json"), run);
  Scene scene = pose_scene(run.set.object);
  scene.width = scene.height = run.size;
  RigidCamera camera(device, scene);
  Json results = head(device, run);
  Json rows = earlier_rows(file, results);
  const auto count = static_cast<unsigned>(run.problems.size());
  cli::Progress progress(count, run.quiet, "problem");
  for (std::size_t i = rows.size(); i < run.problems.size(); ++i) {
    rows.push_back(solve_row(device, scene, camera, run, i));
    results["summary"] = summary(rows);
    results["rows"] = rows;
    cli::write_json(file, results);
    char text[64];
    std::snprintf(text, sizeof text, "%s  %.2f degrees, %.2f s", label(run.method).c_str(),
                  rows.back()["end_degrees"].get<double>(), rows.back()["seconds"].get<double>());
    progress.update(static_cast<unsigned>(i + 1), text);
  }
  results["summary"] = summary(rows);
  results["rows"] = rows;
  print(stem, results["summary"]);
  return results;
}

std::vector<double> final_angles(const Json& results) {
  std::vector<double> angles = column(results.at("rows"), "end_degrees");
  std::ranges::sort(angles);
  return angles;
}

double solved_part(const std::vector<double>& angles, double threshold) {
  if (angles.empty()) return 0;
  const auto below = std::ranges::lower_bound(angles, threshold) - angles.begin();
  return static_cast<double>(below) / static_cast<double>(angles.size());
}

std::vector<double> shown_thresholds() {
  constexpr int k_last = 45;
  std::vector<double> thresholds;
  for (int degrees = 1; degrees <= k_last; ++degrees) thresholds.push_back(degrees);
  return thresholds;
}

}  // namespace dpr::bench
