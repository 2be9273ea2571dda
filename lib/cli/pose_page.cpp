// Numbers and pictures of a pose as HTML.
#include "cli/pose_page.hpp"

#include <cmath>
#include <string>

#include "base/output_file.hpp"
#include "cli/page.hpp"

namespace dpr::cli {
namespace {

std::string vector_text(const glm::dvec3& v) { return format("%.6g, %.6g, %.6g", v.x, v.y, v.z); }

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
  write_whole_file(file, [&](std::ostream& out) {
    write_page_head(out, "Pose");
    write_numbers(out, result, truth);
    write_picture(out, "target.png", "target");
    write_picture(out, "start.png", "start");
    write_picture(out, "end.png", "end");
    write_picture(out, "difference.png", "difference of end and target");
    write_equals(out, result);
    out << "<h2>On the way</h2>\n";
    write_wide_picture(out, "iterations.png", "iterations");
    if (has_plot) write_wide_picture(out, "plot.png", "loss, angle and smoothing");
    write_page_end(out);
  });
}

}  // namespace dpr::cli
