// One method on one set of problems: rows that survive an interruption, and what they come to.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/json.hpp"
#include "dpr/device.hpp"
#include "experiments/pose/problems.hpp"

namespace dpr::bench {

struct PoseRun {
  PoseProblemSet set;
  std::vector<PoseProblem> problems;
  std::string method = "default";
  int size = 128;  ///< pixels a side
  bool smoke = false, quiet = false;
};

/// Solves what `file` does not hold yet, one row a problem, and writes the file after every row, with a
/// summary. A file of another set, method or size is an error. Throws IoError, InvalidArgument.
cli::Json run_poses(const Device& device, const PoseRun& run, const std::filesystem::path& file);

/// The final angles of a run's rows, degrees, ascending.
std::vector<double> final_angles(const cli::Json& results);

}  // namespace dpr::bench
