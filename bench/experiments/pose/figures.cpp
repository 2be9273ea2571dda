// Table 2 and Figures 5, 6, 9, 10 and 11 of Le Lidec et al. 2021, and the same for this library's methods.
#include "experiments/pose/figures.hpp"

#include <cmath>
#include <sstream>

#include "cli/plot.hpp"
#include "dpr/error.hpp"

namespace dpr::bench {
namespace {

using cli::Json;

constexpr double k_angles[] = {20, 50, 80};
constexpr const char* k_published[] = {"softras", "paper_cauchy", "paper_gaussian"};

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

PoseRun make_run(const PoseRun& common, std::size_t count, const std::string& object, double degrees,
                 const PoseMethod& method) {
  PoseRun run = common;
  run.set.object = object;
  run.set.initial_degrees = degrees;
  run.method = method;
  run.problems = make_pose_problems(run.set, count);
  return run;
}

PoseRun with_seed(PoseRun run, std::uint64_t seed) {
  run.set.seed = seed;
  run.problems = make_pose_problems(run.set, run.problems.size());
  return run;
}

/// The same methods against the threshold, a panel for each initial angle.
template <typename Methods>
std::vector<FigurePanel> threshold_panels(const PoseRun& common, std::size_t count, const std::string& object,
                                          std::span<const double> angles, const Methods& methods) {
  std::vector<FigurePanel> panels;
  for (const double angle : angles) {
    const std::string start = angle > 0 ? number(angle) + " degrees" : "uniform start";
    FigurePanel& panel = panels.emplace_back(FigurePanel{object + ", " + start, {}});
    for (const char* name : methods) {
      panel.curves.push_back({name, {}, {make_run(common, count, object, angle, {.name = name})}});
    }
  }
  return panels;
}

std::vector<FigurePanel> table2(const PoseRun& common, std::size_t count) {
  constexpr const char* k_methods[] = {"softras", "paper_cauchy", "paper_gaussian",
                                       "exact",   "joint",        "default"};
  auto panels = threshold_panels(common, count, "published_cube", k_angles, k_methods);
  for (FigurePanel& panel : panels) {
    const PoseRun gaussian = panel.curves[2].runs.front();
    for (const std::uint64_t seed : {2U, 3U}) {
      panel.curves.push_back(
          {"paper_gaussian, seed " + std::to_string(seed), {}, {with_seed(gaussian, seed)}});
    }
  }
  return panels;
}

std::vector<FigurePanel> figure5(const PoseRun& common, std::size_t count) {
  const auto run = [&](double degrees, const PoseMethod& method) {
    return make_run(common, count, "published_cube", degrees, method);
  };
  FigurePanel variance{"20 degrees, M samples to begin with", {}, "samples M", 5};
  for (const bool adapts : {true, false}) {
    for (const auto reduction : {VarianceReduction::rigid, VarianceReduction::none}) {
      FigureCurve curve{std::string(adapts ? "adaptive smoothing, M doubles" : "fixed smoothing and M") +
                            ", variance reduction " + (reduction == VarianceReduction::rigid ? "on" : "off"),
                        {},
                        {}};
      for (unsigned m = 1; m <= (common.smoke ? 2U : 64U); m *= 2) {
        curve.x.push_back(m);
        curve.runs.push_back(run(
            20,
            {.name = "paper_gaussian", .samples = m, .variance_reduction = reduction, .adaptive = adapts}));
      }
      variance.curves.push_back(curve);
    }
  }
  FigurePanel adaptive{"80 degrees, M = 8 to begin with", {}};
  for (const bool adapts : {true, false}) {
    adaptive.curves.push_back({adapts ? "adaptive smoothing" : "fixed smoothing",
                               {},
                               {run(80, {.name = "paper_gaussian", .adaptive = adapts})}});
  }
  return {variance, adaptive};
}

std::vector<FigurePanel> figure6(const PoseRun& common, std::size_t count) {
  constexpr double k_one[] = {50};
  std::vector<FigurePanel> panels = threshold_panels(common, count, "published_cube", k_one, k_published);
  FigurePanel grid{"50 degrees, paper_gaussian", {}, "log10 of the initial sigma"};
  for (const float gamma : {1e-1F, 1e-2F, 1e-3F}) {
    FigureCurve curve{"gamma " + number(static_cast<double>(gamma)), {}, {}};
    for (const float sigma : {1e-4F, 1e-3F, 1e-2F}) {
      curve.x.push_back(std::log10(static_cast<double>(sigma)));
      curve.runs.push_back(make_run(common, count, "published_cube", 50,
                                    {.name = "paper_gaussian", .sigma = sigma, .gamma = gamma}));
    }
    grid.curves.push_back(curve);
  }
  panels.push_back(grid);
  return panels;
}

std::vector<FigurePanel> figure9(const PoseRun& common, std::size_t count) {
  constexpr double k_uniform[] = {0};
  constexpr const char* k_methods[] = {"softras", "paper_cauchy", "paper_gaussian", "default"};
  return threshold_panels(common, count, "published_cube", k_uniform, k_methods);
}

std::vector<FigurePanel> figure10(const PoseRun& common, std::size_t count) {
  return threshold_panels(common, count, "published_cube", k_angles, k_published);
}

std::vector<FigurePanel> figure11(const PoseRun& common, std::size_t count) {
  constexpr double k_one[] = {50};
  constexpr const char* k_methods[] = {"softras", "paper_cauchy", "paper_gaussian", "joint", "default"};
  std::vector<FigurePanel> panels = threshold_panels(common, count, "mailbox", k_one, k_methods);
  panels.push_back(threshold_panels(common, count, "bag", k_one, k_methods).front());
  return panels;
}

std::vector<FigurePanel> members(const PoseRun& common, std::size_t count) {
  constexpr const char* k_methods[] = {"paper_gaussian", "paper_gaussian_minus_one", "exact",
                                       "joint",          "joint_logistic",           "joint_cauchy",
                                       "perturbed_pose"};
  return threshold_panels(common, count, "published_cube", k_angles, k_methods);
}

/// A curve's numbers: x, and the part that is solved.
Json measure(const Device& device, const FigurePanel& panel, const FigureCurve& curve,
             const std::filesystem::path& folder) {
  Json x = curve.x, solved = Json::array(), files = Json::array(), problems = Json::array();
  for (const PoseRun& run : curve.runs) {
    const Json results = run_poses(device, run, folder);
    const std::vector<double> angles = final_angles(results);
    files.push_back(file_stem(run) + ".json");
    problems.push_back(angles.size());
    if (!curve.x.empty()) {
      solved.push_back(solved_part(angles, panel.threshold));
      continue;
    }
    for (const double threshold : shown_thresholds()) {
      x.push_back(threshold);
      solved.push_back(solved_part(angles, threshold));
    }
  }
  return {{"title", curve.title}, {"files", files}, {"problems", problems}, {"x", x}, {"solved", solved}};
}

/// The panels beside each other.
std::string script(const Json& panels) {
  std::ostringstream data, plots;
  std::size_t block = 0;
  for (const Json& panel : panels) {
    plots << "set title " << cli::gnuplot_quote(panel["title"]) << "\nset xlabel "
          << cli::gnuplot_quote(panel["x_label"]) << "\nset ylabel "
          << cli::gnuplot_quote("part below " + panel["below"].get<std::string>()) << "\n"
          << (panel["x_label"] == "samples M" ? "set logscale x 2\n" : "unset logscale x\n");
    const char* separator = "plot ";
    for (const Json& curve : panel["curves"]) {
      data << "$b" << block << " << EOD\n";
      for (std::size_t i = 0; i < curve["x"].size(); ++i) {
        data << curve["x"][i].get<double>() << ' ' << curve["solved"][i].get<double>() << '\n';
      }
      data << "EOD\n";
      plots << separator << "$b" << block << " with "
            << (curve["x"].size() > 10 ? "lines" : "linespoints pt 7") << " lw 2 title "
            << cli::gnuplot_quote(curve["title"]);
      separator = ", ";
      ++block;
    }
    plots << "\n";
  }
  return data.str() + "set multiplot layout 1," + std::to_string(panels.size()) +
         "\nset grid\nset yrange [0:1.02]\nset key below maxcols 1\n" + plots.str() + "unset multiplot\n";
}

}  // namespace

std::span<const Figure> figures() {
  static constexpr Figure k_figures[] = {
      {"table2", "The published protocol from 20, 50 and 80 degrees, and this library's methods", table2},
      {"figure5", "Variance reduction and adaptive smoothing, on and off", figure5},
      {"figure6", "Solved part against threshold; initial sigma and gamma", figure6},
      {"figure9", "Uniform initial rotations", figure9},
      {"figure10", "Thresholds from 1 to 45 degrees", figure10},
      {"figure11", "Mailbox and bag", figure11},
      {"members", "The published protocol with other members of the family", members}};
  return k_figures;
}

void make_figure(const Device& device, const Figure& figure, const PoseRun& common, std::size_t count,
                 const std::filesystem::path& folder) {
  constexpr int k_panel_width = 520, k_height = 520;
  Json panels = Json::array();
  for (const FigurePanel& panel : figure.panels(common, count)) {
    Json curves = Json::array();
    bool is_threshold = false;
    for (const FigureCurve& curve : panel.curves) {
      curves.push_back(measure(device, panel, curve, folder));
      is_threshold = curve.x.empty();
    }
    panels.push_back({{"title", panel.title},
                      {"x_label", panel.x_label},
                      {"below", is_threshold ? "the threshold" : number(panel.threshold) + " degrees"},
                      {"curves", curves}});
  }
  cli::write_json(folder / (std::string(figure.name) + ".json"),
                  {{"figure", figure.name}, {"panels", panels}});
  const std::filesystem::path picture = folder / (std::string(figure.name) + ".png");
  if (!cli::draw(picture, k_panel_width * static_cast<int>(panels.size()), k_height, script(panels))) {
    throw IoError(picture, "gnuplot is not installed");
  }
}

}  // namespace dpr::bench
