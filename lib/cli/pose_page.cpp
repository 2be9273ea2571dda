// Numbers and pictures of a pose as HTML.
#include "cli/pose_page.hpp"

#include <cmath>
#include <string>

#include "cli/text.hpp"

namespace dpr::cli {
namespace {

std::string vector_text(const glm::dvec3& v) { return format("%.6g, %.6g, %.6g", v.x, v.y, v.z); }

/// A solver that tries rotations all around does not go on from the start.
std::string search_text(const PoseResult& result) {
  if (result.history.empty() || result.history.front().hypotheses == 1) return "";
  return " Many poses are refined together: an iteration shows the best of them.";
}

std::string light_text(const PoseResult& result) {
  if (result.light == PoseLight::fixed) return "";
  return " The target's light is not the scene's: these pictures are in the light that was found along with "
         "the pose.";
}

/// Empty where the solver has none.
std::string uncertainty_text(const PoseResult& result) {
  const auto& c = result.covariance;
  if (c.empty()) return "";
  const auto size = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(c.size()))));
  const double variance = c[0] + c[size + 1] + c[2 * size + 2];
  return format("%.2g degrees, one standard deviation%s", glm::degrees(std::sqrt(variance)),
                result.explained ? "" : ", if the pose is right");
}

void add_numbers(Page& page, const PoseResult& result, const std::optional<glm::dmat3>& truth) {
  std::vector<TableRow> rows;
  if (truth) {
    rows.push_back(
        {"error at the start", format("%.3f degrees", angle_degrees(result.start.rotation, *truth))});
    rows.push_back({"error at the end", format("%.3f degrees", angle_degrees(result.pose.rotation, *truth))});
  }
  rows.push_back({"rotation vector", vector_text(vector_from_rotation(result.pose.rotation)) + " radians"});
  rows.push_back({"translation", vector_text(result.pose.translation)});
  if (result.focal_scale != 1)
    rows.push_back({"focal length", format("%.6g of the scene's", result.focal_scale)});
  if (result.radial != glm::dvec2(0))
    rows.push_back(
        {"distortion", format("k1 %+.4g, k2 %+.4g to the scene's", result.radial.x, result.radial.y)});
  if (const std::string text = uncertainty_text(result); !text.empty())
    rows.push_back({"uncertainty of the rotation", text});
  if (result.light != PoseLight::fixed) rows.push_back({"light found", name_of(result.light)});
  rows.push_back({"loss", format("%.4g", result.loss)});
  rows.push_back({"target explained", result.explained ? "yes" : "no: " + doubt_text(result)});
  rows.push_back({"iterations", std::to_string(result.iterations)});
  rows.push_back({"time", format("%.2f seconds", result.seconds)});
  page.add_facts(rows);
}

void add_equals(Page& page, const PoseResult& result, const std::vector<Picture>& pictures) {
  if (result.equals.size() < 2) return;
  std::vector<TableRow> rows{{"rotation vector, radians", "translation", "degrees from the result", "loss"}};
  for (const PoseHypothesis& other : result.equals) {
    rows.push_back({vector_text(vector_from_rotation(other.pose.rotation)),
                    vector_text(other.pose.translation),
                    format("%.2f", angle_degrees(other.pose.rotation, result.pose.rotation)),
                    format("%.4g", other.loss)});
  }
  page.add_heading("Poses that explain the target equally well");
  if (pictures.size() < result.equals.size())
    page.add_paragraph(format("%zu of the %zu poses.", pictures.size(), result.equals.size()));
  page.add_pictures(pictures);
  page.add_table(rows);
}

/// A body's way and what was found of it. `suffix`: of the headings.
void add_body(Page& page, const PoseResult& result, const Picture& target, const BodyPictures& pictures,
              const std::string& suffix, const std::optional<glm::dmat3>& truth) {
  page.add_heading("From the start to the end" + suffix);
  page.add_paragraph("Start and end are rendered without smoothing, the iterations as the solver saw them." +
                     search_text(result) + light_text(result));
  std::vector<std::vector<Picture>> rows;
  for (const Picture& frame : pictures.frames) rows.push_back({frame});
  page.add_player({target}, rows);
  page.add_heading("Result" + suffix);
  add_numbers(page, result, truth);
  add_equals(page, result, pictures.equals);
  if (pictures.plot.empty()) return;
  page.add_heading("Iterations" + suffix);
  page.add_plot(pictures.plot, "loss, rotation and smoothing by iteration", pictures.curves);
}

}  // namespace

void write_pose_page(const std::filesystem::path& file, const PageSource& source,
                     std::span<const FoundBody> found, const PosePictures& pictures,
                     const std::optional<glm::dmat3>& truth) {
  Page page(source);
  page.add_pictures({pictures.target, pictures.start, pictures.end, pictures.difference});
  page.add_wipe(pictures.target, pictures.end);
  page.add_model(pictures.model);
  for (std::size_t i = 0; i < found.size(); ++i) {
    const std::string suffix = suffix_of(found[i], found.size());
    add_body(page, found[i].result, pictures.target, pictures.bodies[i], suffix, truth);
  }
  page.write(file);
}

}  // namespace dpr::cli
