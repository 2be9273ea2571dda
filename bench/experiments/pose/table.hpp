// One method on one set of problems: rows that survive an interruption, and what they come to.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/json.hpp"
#include "dpr/device.hpp"
#include "experiments/pose/methods.hpp"
#include "experiments/pose/problems.hpp"

namespace dpr::bench {

struct PoseRun {
  PoseProblemSet set;
  std::vector<PoseProblem> problems;
  PoseMethod method;
  int size = 128;  ///< pixels a side
  bool smoke = false, quiet = false;
};

/// Stem of a run's files: object, set, seed and method.
std::string file_stem(const PoseRun& run);

/// Solves what the run's file in `folder` does not hold yet, one row a problem, and writes the file after
/// every row, with a summary; its problems go beside it. A file of another set, method or size is an error.
/// Prints the summary. Throws IoError, InvalidArgument.
cli::Json run_poses(const Device& device, const PoseRun& run, const std::filesystem::path& folder);

/// The final angles of a run's rows, degrees, ascending.
std::vector<double> final_angles(const cli::Json& results);

/// The part of ascending angles below a threshold.
double solved_part(const std::vector<double>& angles, double threshold);

/// 1 to 45 degrees, as in the paper's figures.
std::vector<double> shown_thresholds();

}  // namespace dpr::bench
