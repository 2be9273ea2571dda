// The paper's pose figures: which runs they show, and how they are drawn.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "experiments/pose/table.hpp"

namespace dpr::bench {

/// Runs against what they differ in; or, where `x` is empty, one run against the threshold.
struct FigureCurve {
  std::string title;
  std::vector<double> x;
  std::vector<PoseRun> runs;  ///< one for each x
};

struct FigurePanel {
  std::string title;
  std::vector<FigureCurve> curves;
  std::string x_label = "threshold, degrees";
  double threshold = 10;  ///< degrees, where x is not the threshold
};

struct Figure {
  const char *name, *description;
  /// `common` brings size, problems' seed, smoke and quiet; its set and method are the figure's to choose.
  std::vector<FigurePanel> (*panels)(const PoseRun& common, std::size_t count);
};

std::span<const Figure> figures();

/// Performs what the figure's runs lack in `folder`, and leaves NAME.json and NAME.png there. Throws as
/// run_poses() does, and IoError where gnuplot is not installed.
void make_figure(const Device& device, const Figure& figure, const PoseRun& common, std::size_t count,
                 const std::filesystem::path& folder);

}  // namespace dpr::bench
