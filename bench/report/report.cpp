#include "report/report.hpp"

#include <algorithm>
#include <functional>
#include <map>
#include <set>
#include <sstream>

#include "base/output_file.hpp"
#include "cli/page.hpp"
#include "cli/plot.hpp"
#include "cli/text.hpp"
#include "dpr/error.hpp"
#include "stages.hpp"

namespace dpr::bench {
namespace {

using cli::gnuplot_quote;

/// A plot's size in pixels and its script; none where there are no rows for it.
struct Plot {
  int width = 0, height = 0;
  std::string script;
};

std::vector<const Json*> rows_where(const Json& results, const std::function<bool(const Json&)>& wanted) {
  std::vector<const Json*> rows;
  for (const Json& row : results["results"]) {
    if (is_measured(row) && wanted(row)) rows.push_back(&row);
  }
  return rows;
}

bool is_sweep(const Json& row) { return row["workload"].get<std::string>().starts_with("sweep-"); }

/// A file's name in legends: its device, by platform and driver too, because a machine's processor may have
/// several; and its commit if there are several files.
std::string label_of(const Json& results, std::size_t files) {
  const Json& info = results["device"];
  const std::string device = info["name"].get<std::string>() + " (" + info.value("platform", "no platform") +
                             ", driver " + info.value("driver", "unknown") + ")";
  constexpr std::size_t k_short_commit = 7;
  return files > 1 ? device + ", " + results["commit"].get<std::string>().substr(0, k_short_commit) : device;
}

double stage_ms(const Json& row, const std::string& stage) {
  if (!row["stages"].contains(stage)) return 0;
  const Json& times = row["stages"][stage];
  return times["forward_ms"].get<double>() + times["backward_ms"].get<double>();
}

/// Horizontal bars, one a row, each 100% long: milliseconds differ by five orders of magnitude and stand
/// beside.
Plot stage_plot(const Json& results) {
  const auto rows =
      rows_where(results, [](const Json& row) { return row.contains("stages") && !is_sweep(row); });
  if (rows.empty()) return {};
  std::ostringstream script;
  script << "$data << EOD\n";
  for (const Json* row : rows) {
    double sum = 0;
    for (const std::string_view stage : k_stages) sum += stage_ms(*row, std::string(stage));
    std::ostringstream label;
    label.precision(3);
    label << row_name(*row) << ", " << total_ms(*row) << " ms";
    script << '"' << label.str() << '"';
    double end = 0;
    for (const std::string_view stage : k_stages) {
      script << ' ' << end;
      end += sum > 0 ? 100 * stage_ms(*row, std::string(stage)) / sum : 0;
      script << ' ' << end;
    }
    script << '\n';
  }
  constexpr int k_row_height = 20, k_margins = 190, k_width = 1300;  // the legend has five lines
  script << "EOD\nset yrange [" << rows.size() << ":-1]\nset xrange [0:100]\n"
         << "set xlabel 'device time by stage, forward and backward, %'\n"
         << "set style fill solid 0.9 noborder\nset key outside top center horizontal\nset lmargin 58\n"
         << "set palette defined (0 '#4477aa', 1 '#66ccee', 2 '#228833', 3 '#ccbb44', 4 '#ee6677', 5 "
            "'#aa3377')\n"
         << "unset colorbox\nplot ";
  const std::size_t count = std::size(k_stages);
  for (std::size_t i = 0; i < count; ++i) {
    script << (i > 0 ? ", " : "") << "$data using " << 2 * i + 2 << ":0:" << 2 * i + 2 << ':' << 2 * i + 3
           << ":($0-0.4):($0+0.4):yticlabels(1) with boxxyerror lc palette frac "
           << static_cast<double>(i) / static_cast<double>(count - 1) << " title "
           << gnuplot_quote(std::string(k_stages[i]));
  }
  script << '\n';
  return {k_width, k_margins + k_row_height * static_cast<int>(rows.size()), script.str()};
}

/// Variable of a sweep, and the label of its axis.
struct Axis {
  const char *workload, *label;
  double (*value)(const Json& row);
};

const Axis k_axes[] = {
    {"sweep-triangles", "triangles", [](const Json& row) { return row["triangles"].get<double>(); }},
    {"sweep-pixels", "pixels",
     [](const Json& row) { return row["width"].get<double>() * row["height"].get<double>(); }},
    {"sweep-samples", "samples", [](const Json& row) { return row["samples"].get<double>(); }},
    {"sweep-views", "views", [](const Json& row) { return row["views"].get<double>(); }},
    {"sweep-tessellation", "tessellation", [](const Json& row) { return row["triangles"].get<double>(); }},
    {"sweep-sigma", "sigma", [](const Json& row) { return row["sigma"].get<double>(); }}};

/// A figure of a row, and where its middle half begins and ends.
struct Spread {
  double value, low, high;
};

struct Figure {
  const char* name;
  Spread (*of)(const Json& row);
};

/// One curve a file and figure, over an axis; empty where no file has the sweep.
std::string curves(std::span<const Json> files, const Axis& axis, std::span<const Figure> figures) {
  std::ostringstream data, plots;
  std::size_t index = 0;
  for (const Json& file : files) {
    const auto rows = rows_where(file, [&](const Json& row) { return row["workload"] == axis.workload; });
    if (rows.empty()) continue;
    for (const auto& [name, of] : figures) {
      data << "$" << axis.label << index << " << EOD\n";
      for (const Json* row : rows) {
        const auto [value, low, high] = of(*row);
        data << axis.value(*row) << ' ' << value << ' ' << low << ' ' << high << '\n';
      }
      data << "EOD\n";
      const std::string title =
          files.size() > 1 ? std::string(name) + ", " + label_of(file, files.size()) : name;
      plots << (index > 0 ? ", " : "plot ") << "$" << axis.label << index
            << " with yerrorlines lw 2 pt 7 title " << gnuplot_quote(title);
      ++index;
    }
  }
  if (index == 0) return "";
  return data.str() + "set title " + gnuplot_quote(std::string("against ") + axis.label) + "\nset xlabel " +
         gnuplot_quote(axis.label) + "\n" + plots.str() + "\n";
}

/// Above the plot: below it the labels of the axis are. Long titles stand below each other.
std::string key_place(std::span<const Json> files) {
  return std::string("tmargin center Left reverse samplen 2 ") +
         (files.size() > 1 ? "vertical font ',9'" : "horizontal width 2");
}

double median(const Json& timing) { return timing["median"].get<double>(); }

Spread spread(const Json& timing) {
  return {median(timing), timing["q1"].get<double>(), timing["q3"].get<double>()};
}

Plot scaling_plot(std::span<const Json> files) {
  static constexpr Figure k_passes[] = {
      {"forward", [](const Json& row) { return spread(row["forward_ms"]); }},
      {"backward", [](const Json& row) { return spread(row["backward_ms"]); }}};
  std::string panels;
  int count = 0;
  for (const Axis& axis : k_axes) {
    const std::string panel = curves(files, axis, k_passes);
    panels += panel;
    count += panel.empty() ? 0 : 1;
  }
  if (count == 0) return {};
  const int lines = (count + 1) / 2;
  return {1200, 430 * lines,
          "set multiplot layout " + std::to_string(lines) + "," + (count > 1 ? "2" : "1") +
              "\nset grid\nset logscale xy\nset format '%g'\nset key " + key_place(files) +
              "\nset ylabel 'milliseconds, median and quartiles'\n" + panels + "unset multiplot\n"};
}

Spread mebibytes(const Json& row, const char* key) {
  const double value = row[key].get<double>() / (1024.0 * 1024.0);
  return {value, value, value};
}

Plot memory_plot(std::span<const Json> files) {
  static constexpr Figure k_memories[] = {
      {"device", [](const Json& row) { return mebibytes(row, "peak_device_bytes"); }},
      {"resident", [](const Json& row) { return mebibytes(row, "peak_rss_bytes"); }}};
  const std::string panel = curves(files, k_axes[2], k_memories);
  if (panel.empty()) return {};
  return {700, 480,
          "set grid\nset key " + key_place(files) +
              "\nset logscale x\nset yrange [0:*]\nset ylabel 'peak memory, MiB'\n" + panel};
}

/// Roofline: a point for each row's stage, below the roof that its operations a byte allow.
Plot roofline_plot(const Json& results) {
  const Json& device = results["device"];
  if (!device.contains("peak_gflops")) return {};
  std::map<std::string, std::string> points;
  for (const Json* row : rows_where(results, [](const Json& r) { return r.contains("stages"); })) {
    for (const auto& [name, stage] : (*row)["stages"].items()) {
      if (!stage.contains("gflops")) continue;
      const double gflops = stage["gflops"].get<double>(), gbytes = stage["gbytes_per_s"].get<double>();
      if (gflops > 0 && gbytes > 0)
        points[name] += std::to_string(gflops / gbytes) + " " + std::to_string(gflops) + "\n";
    }
  }
  if (points.empty()) return {};
  std::ostringstream data, plots;
  plots << "plot min(" << device["peak_gflops"].get<double>() << ", x * "
        << device["peak_gbytes_per_s"].get<double>() << ") lw 2 lc 'black' title 'peaks, from memory'";
  for (const auto& [name, list] : points) {
    data << "$" << name << " << EOD\n" << list << "EOD\n";
    plots << ", $" << name << " with points pt 7 title " << gnuplot_quote(name);
  }
  return {1000, 600,
          "min(a, b) = a < b ? a : b\nset grid\nset logscale xy\nset format '%g'\nset samples 500\n"
          "set key outside right Left reverse\nset xrange [0.01:1000]\n"
          "set xlabel 'operations a byte'\nset ylabel 'GFLOP/s'\n" +
              data.str() + plots.str() + "\n"};
}

/// Time of every row that the first file has, one mark a file.
Plot device_plot(std::span<const Json> files) {
  if (files.size() < 2) return {};
  std::vector<std::string> names;
  for (const Json* row : rows_where(files[0], [](const Json& r) { return !is_sweep(r); })) {
    names.push_back(row_name(*row));
  }
  if (names.empty()) return {};
  std::ostringstream data, plots;
  for (std::size_t i = 0; i < files.size(); ++i) {
    data << "$file" << i << " << EOD\n";
    for (const Json* row : rows_where(files[i], [](const Json&) { return true; })) {
      const auto name = std::ranges::find(names, row_name(*row));
      if (name != names.end())
        data << total_ms(*row) << ' ' << name - names.begin() << " \"" << *name << "\" "
             << total_ms(*row, "q1") << ' ' << total_ms(*row, "q3") << '\n';
    }
    data << "EOD\n";
    plots << (i > 0 ? ", " : "plot ") << "$file" << i
          << " using 1:2:4:5:yticlabels(3) with xerrorbars pt 7 ps 1.2 title "
          << gnuplot_quote(label_of(files[i], files.size()));
  }
  constexpr int k_row_height = 20, k_margins = 130, k_width = 1200;
  return {k_width, k_margins + k_row_height * static_cast<int>(names.size()),
          data.str() +
              "set grid\nset logscale x\nset format x '%g'\nset lmargin 48\nset key outside top center\nset "
              "yrange [" +
              std::to_string(names.size()) +
              ":-1]\nset xlabel 'forward and backward, milliseconds: medians and quartiles'\n" + plots.str() +
              "\n"};
}

struct NamedPlot {
  const char *file, *heading;
  Plot plot;
};

cli::TableRow times_of(const Json& row) {
  if (!is_measured(row)) return {row_name(row), row["status"].get<std::string>(), ""};
  const auto milliseconds = [&](const char* pass) { return cli::format("%.4g", median(row[pass])); };
  return {row_name(row), milliseconds("forward_ms"), milliseconds("backward_ms")};
}

void write_page(const std::filesystem::path& file, std::span<const NamedPlot> plots,
                std::span<const Json> results, const std::string& command) {
  std::string devices;
  for (const Json& result : results) {
    if (!devices.empty()) devices += "; ";
    devices +=
        result["device"]["name"].get<std::string>() + ", commit " + result["commit"].get<std::string>();
  }
  cli::Page page({"Benchmark of dpr", command, devices});
  for (const auto& [name, heading, plot] : plots) {
    if (plot.script.empty()) continue;
    page.add_heading(heading);
    page.add_plot(name, heading, plot.width);
  }
  page.add_heading("Medians of the first file");
  std::vector<cli::TableRow> rows{{"row", "forward, ms", "backward, ms"}};
  for (const Json& row : results.front()["results"]) rows.push_back(times_of(row));
  page.add_table(rows);
  page.write(file);
}

}  // namespace

std::vector<std::string> write_report(const std::filesystem::path& folder, std::span<const Json> results,
                                      const std::string& command) {
  const NamedPlot plots[] = {
      {"stages.png", "Device time by stage, of the first file", stage_plot(results.front())},
      {"roofline.png", "Stages below the device's peaks, of the first file", roofline_plot(results.front())},
      {"scaling.png", "Time against what grows", scaling_plot(results)},
      {"memory.png", "Peak memory against samples", memory_plot(results)},
      {"devices.png", "Time by file", device_plot(results)}};
  if (std::ranges::all_of(plots, [](const NamedPlot& plot) { return plot.plot.script.empty(); })) {
    throw InvalidArgument("results (report)", "no measured rows", "rows of the workloads, or of --sweeps");
  }
  make_folder(folder);
  std::vector<std::string> written;
  for (const auto& [name, heading, plot] : plots) {
    if (plot.script.empty()) continue;
    const std::filesystem::path file = folder / name;
    if (!cli::draw(file, plot.width, plot.height, plot.script))
      throw IoError(file, "gnuplot is not installed");
    written.push_back(file.string());
  }
  write_page(folder / "index.html", plots, results, command);
  written.push_back((folder / "index.html").string());
  return written;
}

}  // namespace dpr::bench
