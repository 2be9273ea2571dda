// Line plots by way of gnuplot.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace dpr::cli {

struct Curve {
  std::string title;
  std::vector<double> y;
};

/// Curves that share an axis.
struct Panel {
  std::string y_label;
  bool log_scale = false;  ///< then values must be positive
  std::vector<Curve> curves;
};

/// Draws the panels below each other over a common x into a PNG file. Returns false, having done nothing,
/// where no gnuplot is installed. Throws IoError if gnuplot fails.
bool plot(const std::filesystem::path& file, const std::string& x_label, const std::vector<double>& x,
          const std::vector<Panel>& panels);

}  // namespace dpr::cli
