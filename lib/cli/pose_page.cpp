// Numbers and pictures of a pose as HTML.
#include "cli/pose_page.hpp"

#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>

#include "dpr/error.hpp"
#include "scene/temporary_file.hpp"

namespace dpr::cli {
namespace {

constexpr const char* k_head = R"(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>Pose</title>
<style>
body { font-family: sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #222; }
figure { display: inline-block; margin: 0 1em 1em 0; }
figure img { width: 14em; image-rendering: pixelated; border: 1px solid #bbb; }
figcaption { font-size: 90%; color: #555; }
img.wide { max-width: 100%; }
table { border-collapse: collapse; margin-bottom: 1.5em; }
td, th { padding: 0.2em 1em 0.2em 0; text-align: left; border-bottom: 1px solid #ddd; }
</style>
</head>
<body>
<h1>Pose</h1>
)";

template <typename... Values>
std::string format(const char* pattern, Values... values) {
  char text[160];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

std::string vector_text(const glm::dvec3& v) { return format("%.6g, %.6g, %.6g", v.x, v.y, v.z); }

void write_row(std::ostream& out, const char* name, const std::string& value) {
  out << "<tr><th>" << name << "</th><td>" << value << "</td></tr>\n";
}

void write_picture(std::ostream& out, const char* file, const char* caption) {
  out << "<figure><img src=\"" << file << "\" alt=\"" << caption << "\"><figcaption>" << caption
      << "</figcaption></figure>\n";
}

void write_numbers(std::ostream& out, const PoseResult& result, const std::optional<glm::dmat3>& truth) {
  out << "<table>\n";
  write_row(out, "rotation vector, radians", vector_text(vector_from_rotation(result.pose.rotation)));
  write_row(out, "translation", vector_text(result.pose.translation));
  if (result.focal_scale != 1)
    write_row(out, "focal length", format("%.6g of the scene's", result.focal_scale));
  if (truth) {
    write_row(out, "error at the start, degrees",
              format("%.3f", angle_degrees(result.start.rotation, *truth)));
    write_row(out, "error at the end, degrees", format("%.3f", angle_degrees(result.pose.rotation, *truth)));
  }
  write_row(out, "loss", format("%.4g", result.loss));
  write_row(out, "target explained", result.explained ? "yes" : "no");
  write_row(out, "iterations", std::to_string(result.iterations));
  write_row(out, "seconds", format("%.2f", result.seconds));
  out << "</table>\n";
}

void write_equals(std::ostream& out, const PoseResult& result) {
  if (result.equals.size() < 2) return;
  out << "<h2>Poses that explain the target equally well</h2>\n<table>\n"
      << "<tr><th>rotation vector, radians</th><th>translation</th><th>degrees from the "
         "result</th><th>loss</th></tr>\n";
  for (const PoseHypothesis& other : result.equals) {
    out << "<tr><td>" << vector_text(vector_from_rotation(other.pose.rotation)) << "</td><td>"
        << vector_text(other.pose.translation) << "</td><td>"
        << format("%.2f", angle_degrees(other.pose.rotation, result.pose.rotation)) << "</td><td>"
        << format("%.4g", other.loss) << "</td></tr>\n";
  }
  out << "</table>\n";
}

}  // namespace

void write_pose_page(const std::filesystem::path& file, const PoseResult& result, bool has_plot,
                     const std::optional<glm::dmat3>& truth) {
  TemporaryFile temporary(file);
  std::ofstream out(temporary.path());
  out << k_head;
  write_numbers(out, result, truth);
  write_picture(out, "target.png", "target");
  write_picture(out, "start.png", "start");
  write_picture(out, "end.png", "end");
  write_picture(out, "difference.png", "difference of end and target");
  write_equals(out, result);
  out << "<h2>On the way</h2>\n<p><img class=\"wide\" src=\"iterations.png\" alt=\"iterations\"></p>\n";
  if (has_plot) out << "<p><img class=\"wide\" src=\"plot.png\" alt=\"loss, angle and smoothing\"></p>\n";
  out << "</body>\n</html>\n";
  out.close();
  if (!out) throw IoError(file, "cannot be written");
  temporary.commit();
}

}  // namespace dpr::cli
