// Plots by way of gnuplot.
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
  std::string title;
  std::string y_label;
  bool log_scale = false;  ///< then values must be positive
  std::vector<Curve> curves;
};

/// Panels below each other, over a common x.
struct Plot {
  std::string x_label;
  std::vector<double> x;
  std::vector<Panel> panels;
};

/// Where the smallest and the largest x are in what plot() draws: 0 at its left edge, 1 at its right edge.
inline constexpr double k_plot_left = 0.23, k_plot_right = 0.965;

/// A string of gnuplot's: in single quotes, which are doubled inside.
std::string gnuplot_quote(const std::string& text);

/// Runs gnuplot's commands, which draw into a PNG file of that many pixels: terminal and output are set
/// before them. Returns false, having done nothing, where no gnuplot is installed. Throws IoError if gnuplot
/// fails. `scale` enlarges text and lines.
bool draw(const std::filesystem::path& file, int width, int height, const std::string& commands,
          double scale = 1);

/// Draws into a PNG file; else as draw().
bool plot(const std::filesystem::path& file, const Plot& plot);

}  // namespace dpr::cli
