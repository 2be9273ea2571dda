// Writes a script for gnuplot and runs it. Both its script and its picture are files, not pipes: a pipe to a
// program that has died is a signal, and two pipes to one program are a deadlock.
#include "cli/plot.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>

#include "base/checks.hpp"
#include "base/child_process.hpp"
#include "base/output_file.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

void write_data(std::ostream& script, std::size_t index, const std::vector<double>& x,
                const std::vector<double>& y) {
  script << "$data" << index << " << EOD\n";
  for (std::size_t i = 0; i < x.size() && i < y.size(); ++i) script << x[i] << ' ' << y[i] << '\n';
  script << "EOD\n";
}

/// A round distance of few marks on a linear axis of these curves; none of curves of one value.
std::optional<double> tic_distance(const std::vector<Curve>& curves) {
  constexpr double k_most_tics = 6;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Curve& curve : curves) {
    for (const double y : curve.y) {
      if (!std::isfinite(y)) continue;
      low = std::min(low, y);
      high = std::max(high, y);
    }
  }
  if (!(low < high)) return {};
  const double least = (high - low) / k_most_tics, power = std::pow(10, std::floor(std::log10(least)));
  for (const double digit : {1.0, 2.0, 5.0})
    if (digit * power >= least) return digit * power;
  return 10 * power;
}

void write_panel(std::ostream& script, const Panel& panel, const std::vector<double>& x, std::size_t& index) {
  std::string command = "plot ";
  for (const Curve& curve : panel.curves) {
    write_data(script, index, x, curve.y);
    if (&curve != &panel.curves.front()) command += ", ";
    // Points, since a line shows no single value between two gaps.
    command += "$data" + std::to_string(index) +
               " with linespoints linewidth 2 pointtype 7 pointsize 0.6 title " + gnuplot_quote(curve.title);
    ++index;
  }
  const auto distance = panel.log_scale ? std::nullopt : tic_distance(panel.curves);
  script << (panel.log_scale ? "set" : "unset") << " logscale y\nset ytics "
         << (distance ? checks::text(*distance) : "autofreq") << "\n"
         << (panel.curves.size() > 1 ? "set key tmargin center horizontal Left reverse samplen 2 width 2\n"
                                     : "unset key\n")
         << "set title " << gnuplot_quote(panel.title) << "\n"
         << "set ylabel " << gnuplot_quote(panel.y_label) << "\n"
         << command << "\n";
}

/// A file without a name, which goes when it is closed.
class UnnamedFile {
 public:
  UnnamedFile() : stream_(std::tmpfile()) {
    if (!stream_) throw std::system_error(errno, std::generic_category(), "a temporary file for gnuplot");
  }
  int descriptor() const { return fileno(stream_.get()); }

  /// Writes the content and goes back to its beginning. False if that fails.
  bool fill(const std::string& text) {
    return std::fwrite(text.data(), 1, text.size(), stream_.get()) == text.size() &&
           std::fflush(stream_.get()) == 0 && std::fseek(stream_.get(), 0, SEEK_SET) == 0;
  }

  /// The whole content, whoever wrote it.
  std::string read() {
    std::string text;
    std::rewind(stream_.get());
    char part[BUFSIZ];
    while (const std::size_t count = std::fread(part, 1, sizeof part, stream_.get()))
      text.append(part, count);
    return text;
  }

 private:
  struct Close {
    void operator()(std::FILE* stream) const { std::fclose(stream); }
  };
  std::unique_ptr<std::FILE, Close> stream_;
};

/// Runs gnuplot from a script to what it draws; the exit status, or -1 where it is not installed.
int run_gnuplot(const UnnamedFile& script, const UnnamedFile& picture) {
  constexpr int k_not_found = 127;  // what a child that could not execute leaves
  std::string program = "gnuplot";
  char* const arguments[] = {program.data(), nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, script.descriptor(), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, picture.descriptor(), STDOUT_FILENO);
  // Its warnings; an error shows in the status.
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int error = posix_spawnp(&child, program.c_str(), &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return -1;
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!WIFEXITED(status)) return 1;
  return WEXITSTATUS(status) == k_not_found ? -1 : WEXITSTATUS(status);
}

/// Gnuplot does not look whether what it draws could be written.
bool is_whole_png(std::string_view bytes) {
  constexpr std::string_view k_begin = "\x89PNG\r\n\x1a\n", k_end = "IEND\xae\x42\x60\x82";
  return bytes.starts_with(k_begin) && bytes.ends_with(k_end);
}

}  // namespace

std::string gnuplot_quote(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "''" : std::string(1, c);
  return quoted + "'";
}

bool draw(const std::filesystem::path& file, int width, int height, const std::string& commands,
          double scale) {
  require_writable(file);
  UnnamedFile script, picture;
  std::ostringstream head;
  head << "set terminal pngcairo noenhanced size " << width << ',' << height << " fontscale " << scale
       << " linewidth " << scale << "\n";
  if (!script.fill(head.str() + commands)) throw IoError(file, "the script for gnuplot cannot be written");
  const int status = run_gnuplot(script, picture);
  if (status < 0) return false;
  if (status > 0) throw IoError(file, "gnuplot failed with status " + std::to_string(status));
  const std::string bytes = picture.read();
  if (!is_whole_png(bytes))
    throw IoError(file, "gnuplot drew no whole picture; is there room for its output?");
  write_whole_file(file, bytes);
  return true;
}

bool plot(const std::filesystem::path& file, const Plot& plot) {
  constexpr int k_width = 960, k_panel_height = 500;  // twice as many pixels as a page shows
  constexpr double k_scale = 2;
  std::ostringstream script;
  script.precision(std::numeric_limits<double>::max_digits10);
  script << "set multiplot layout " << plot.panels.size() << ",1\n"
         << "set grid\nset autoscale xfix\nset lmargin at screen " << k_plot_left
         << "\nset rmargin at screen " << k_plot_right << "\nset format y '%g'\nset xlabel "
         << gnuplot_quote(plot.x_label) << "\n";
  std::size_t index = 0;
  for (const Panel& panel : plot.panels) write_panel(script, panel, plot.x, index);
  script << "unset multiplot\n";
  return draw(file, k_width, k_panel_height * static_cast<int>(plot.panels.size()), script.str(), k_scale);
}

}  // namespace dpr::cli
