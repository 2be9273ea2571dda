// Writes a script for gnuplot and runs it. A script, not a pipe: writing to a program that has died is a
// signal.
#include "cli/plot.hpp"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <limits>
#include <sstream>

#include "base/temporary_file.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

void write_data(std::ostream& script, std::size_t index, const std::vector<double>& x,
                const std::vector<double>& y) {
  script << "$data" << index << " << EOD\n";
  for (std::size_t i = 0; i < x.size() && i < y.size(); ++i) script << x[i] << ' ' << y[i] << '\n';
  script << "EOD\n";
}

void write_panel(std::ostream& script, const Panel& panel, const std::vector<double>& x, std::size_t& index) {
  std::string command = "plot ";
  for (const Curve& curve : panel.curves) {
    write_data(script, index, x, curve.y);
    if (&curve != &panel.curves.front()) command += ", ";
    command +=
        "$data" + std::to_string(index) + " with lines linewidth 2 title " + gnuplot_quote(curve.title);
    ++index;
  }
  script << (panel.log_scale ? "set" : "unset") << " logscale y\n"
         << (panel.curves.size() > 1 ? "set key tmargin center horizontal Left reverse samplen 2 width 2\n"
                                     : "unset key\n")
         << "set title " << gnuplot_quote(panel.title) << "\n"
         << "set ylabel " << gnuplot_quote(panel.y_label) << "\n"
         << command << "\n";
}

/// Runs gnuplot on a script; the exit status, or -1 where it is not installed.
int run_gnuplot(const std::string& script) {
  constexpr int k_not_found = 127;  // what a child that could not execute leaves
  std::string program = "gnuplot", argument = script;
  char* const arguments[] = {program.data(), argument.data(), nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", 1,
                                   0);  // its warnings; an error shows in the status
  pid_t child = 0;
  const int error = posix_spawnp(&child, program.c_str(), &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return -1;
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status)) return 1;
  return WEXITSTATUS(status) == k_not_found ? -1 : WEXITSTATUS(status);
}

}  // namespace

std::string gnuplot_quote(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "''" : std::string(1, c);
  return quoted + "'";
}

bool draw(const std::filesystem::path& file, int width, int height, const std::string& script, double scale) {
  const TemporaryFile script_file(std::filesystem::path(file).replace_extension(".gp"));
  TemporaryFile picture(file);
  std::ofstream stream(script_file.path());
  stream << "set terminal pngcairo noenhanced size " << width << ',' << height << " fontscale " << scale
         << " linewidth " << scale << "\n"
         << "set output " << gnuplot_quote(picture.path().string()) << "\n"
         << script;
  stream.close();
  if (!stream) throw IoError(file, "the script for gnuplot cannot be written");

  const int status = run_gnuplot(script_file.path().string());
  if (status < 0) return false;
  if (status > 0) throw IoError(file, "gnuplot failed with status " + std::to_string(status));
  picture.commit();
  return true;
}

bool plot(const std::filesystem::path& file, const std::string& x_label, const std::vector<double>& x,
          const std::vector<Panel>& panels) {
  constexpr int k_width = 960, k_panel_height = 500;  // twice as many pixels as a page shows
  constexpr double k_scale = 2;
  std::ostringstream script;
  script.precision(std::numeric_limits<double>::max_digits10);
  script << "set multiplot layout " << panels.size() << ",1\n"
         << "set grid\nset lmargin 11\nset rmargin 3\nset format y '%g'\nset xlabel "
         << gnuplot_quote(x_label) << "\n";
  std::size_t index = 0;
  for (const Panel& panel : panels) write_panel(script, panel, x, index);
  script << "unset multiplot\n";
  return draw(file, k_width, k_panel_height * static_cast<int>(panels.size()), script.str(), k_scale);
}

}  // namespace dpr::cli
