// Pictures and plots of a track.
#include "cli/track_report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "base/output_file.hpp"
#include "cli/plot.hpp"
#include "cli/text.hpp"
#include "dpr/renderer.hpp"
#include "solve/polar.hpp"
#include "solve/resample.hpp"

namespace dpr::cli {
namespace {

constexpr std::size_t k_most_regular = 16, k_most_turns = 8, k_most_rows = 200;

bool is_lost(const TrackRow& row) { return row.found.status == TrackStatus::lost; }

/// Draws the outline of the scene's mesh into frames, which are enlarged where they are small.
class Outliner {
 public:
  Outliner(const Device& device, Scene scene)
      : factor_(std::clamp(k_side / std::max(scene.width, scene.height), 1, k_most_factor)),
        stretch_(polar_decomposition(glm::dmat3(scene.meshes.front().transform)).stretch),
        renderer_(device) {
    scene.camera =
        resample(scene.camera, scene.width, scene.height, factor_ * scene.width, factor_ * scene.height);
    scene.width *= factor_;
    scene.height *= factor_;
    scene.smoothing = rigid_smoothing();
    scene.lights.reset();
    camera_ = scene.camera;
    renderer_.set_scene(scene);
  }

  Image draw(const Image& frame, const TrackRow& row) {
    Image picture = enlarged(frame);
    if (is_lost(row)) return picture;
    const View view{camera_, {affine(row.found.pose.rotation * stretch_, row.found.pose.translation)}};
    renderer_.set_views({&view, 1});
    renderer_.forward();
    const Image object = renderer_.image();
    // Bright inside, dark around: one of them shows on any ground.
    const glm::vec4 bright(1, 0.8F, 0, 1), dark(0, 0, 0, 1);
    for (int y = 0; y < picture.height; ++y) {
      for (int x = 0; x < picture.width; ++x) {
        if (is_at_outline(object, x, y)) picture.at(x, y) = is_inside(object, x, y) ? bright : dark;
      }
    }
    return picture;
  }

 private:
  static constexpr int k_side = 480, k_most_factor = 4;

  Image enlarged(const Image& frame) const {
    Image picture(factor_ * frame.width, factor_ * frame.height);
    for (int y = 0; y < picture.height; ++y) {
      for (int x = 0; x < picture.width; ++x) picture.at(x, y) = frame.at(x / factor_, y / factor_);
    }
    return picture;
  }

  static bool is_inside(const Image& object, int x, int y) { return object.at(x, y).a > 0.5F; }

  static bool is_at_outline(const Image& object, int x, int y) {
    constexpr std::array<std::array<int, 2>, 4> k_sides{{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};
    return std::ranges::any_of(k_sides, [&](const std::array<int, 2>& side) {
      const int nx = std::clamp(x + side[0], 0, object.width - 1);
      const int ny = std::clamp(y + side[1], 0, object.height - 1);
      return is_inside(object, nx, ny) != is_inside(object, x, y);
    });
  }

  int factor_;
  glm::dmat3 stretch_;
  Camera camera_;
  Renderer renderer_;
};

/// "frames 0 to 20, 31 to 59" whose status is one; "frame 0"; "none".
std::string frames_text(const std::vector<TrackRow>& rows, TrackStatus status) {
  std::string text;
  std::size_t count = 0;
  for (std::size_t i = 0; i < rows.size();) {
    std::size_t end = i;
    while (end < rows.size() && rows[end].found.status == status) ++end;
    if (end > i) {
      text += (text.empty() ? "" : ", ") + std::to_string(rows[i].frame);
      if (end > i + 1) text += " to " + std::to_string(rows[end - 1].frame);
    }
    count += end - i;
    i = std::max(end, i + 1);
  }
  if (count == 0) return "none";
  return (count == 1 ? "frame " : "frames ") + text;
}

/// Leaves out what has no values.
void drop_empty(std::vector<Panel>& panels) {
  const auto is_empty = [](const Curve& curve) {
    return std::ranges::none_of(curve.y, [](double y) { return std::isfinite(y); });
  };
  for (Panel& panel : panels) std::erase_if(panel.curves, is_empty);
  std::erase_if(panels, [](const Panel& panel) { return panel.curves.empty(); });
}

/// Rotation from the first pose found, and the translation, where the object is not lost; and the losses, of a lost
/// object where they are known.
Plot track_plot(const std::vector<TrackRow>& rows) {
  constexpr double k_smallest = 1e-12;  // zero has no place on a logarithmic axis
  constexpr double k_none = std::numeric_limits<double>::quiet_NaN();
  const auto first = std::ranges::find_if_not(rows, is_lost);
  std::vector<double> x;
  Curve loss{"loss", {}}, bound{"explained below", {}}, angle{"angle", {}};
  std::array<Curve, 3> places{{{"x", {}}, {"y", {}}, {"z", {}}}};
  for (const TrackRow& row : rows) {
    const TrackedPose& found = row.found;
    x.push_back(static_cast<double>(row.frame));
    loss.y.push_back(is_lost(row) && found.loss == 0 ? k_none : std::max(found.loss, k_smallest));
    bound.y.push_back(found.explained_below == 0 ? k_none : found.explained_below);
    angle.y.push_back(is_lost(row) ? k_none : angle_degrees(found.pose.rotation, first->found.pose.rotation));
    for (int i = 0; i < 3; ++i)
      places[static_cast<std::size_t>(i)].y.push_back(is_lost(row) ? k_none : found.pose.translation[i]);
  }
  std::vector<Panel> panels{{"Loss", "loss", true, {loss, bound}},
                            {"Rotation from the first", "degrees", false, {angle}},
                            {"Translation", "world", false, {places.begin(), places.end()}}};
  drop_empty(panels);
  return {"frame", x, panels};
}

std::vector<TableRow> table(const std::vector<TrackRow>& rows) {
  std::vector<TableRow> result{
      {"frame", "file", "status", "rotation vector, radians", "translation", "loss"}};
  const auto text = [](const glm::dvec3& v) { return format("%.4g, %.4g, %.4g", v.x, v.y, v.z); };
  const std::size_t step = (rows.size() + k_most_rows - 1) / k_most_rows;
  for (std::size_t i = 0; i < rows.size(); i += step) {
    const TrackRow& row = rows[i];
    const Pose& pose = row.found.pose;
    result.push_back({std::to_string(row.frame), row.file, std::string(name_of(row.found.status)),
                      is_lost(row) ? "" : text(vector_from_rotation(pose.rotation)),
                      is_lost(row) ? "" : text(pose.translation), format("%.2e", row.found.loss)});
  }
  return result;
}

}  // namespace

TrackReport::TrackReport(std::filesystem::path folder) : folder_(std::move(folder)) { make_folder(folder_); }

void TrackReport::add(const TrackRow& row, const Image& image) {
  const bool turns = last_ && is_lost(last_->row) != is_lost(row) && turns_ < k_most_turns;
  if (turns) ++turns_;
  last_ = Kept{row, image, turns};
  if (!turns && row.frame % stride_ != 0) return;
  kept_.push_back(*last_);
  const auto is_regular = [](const Kept& kept) { return !kept.turns; };
  if (std::ranges::count_if(kept_, is_regular) <= static_cast<std::ptrdiff_t>(k_most_regular)) return;
  stride_ *= 2;
  std::erase_if(kept_, [&](const Kept& kept) { return !kept.turns && kept.row.frame % stride_ != 0; });
}

std::vector<TrackReport::Kept> TrackReport::all_kept() const {
  std::vector<Kept> kept = kept_;
  if (last_ && (kept.empty() || kept.back().row.frame != last_->row.frame)) kept.push_back(*last_);
  return kept;
}

std::vector<Picture> TrackReport::write_frames(const Device& device, const Scene& scene,
                                               const std::vector<Kept>& kept) const {
  Outliner outliner(device, scene);
  std::vector<Image> pictures;
  std::vector<std::string> captions;
  for (const Kept& k : kept) {
    pictures.push_back(outliner.draw(k.image, k.row));
    captions.push_back("frame " + std::to_string(k.row.frame) + ", " +
                       std::string(name_of(k.row.found.status)));
  }
  return write_strip(folder_ / "frames.png", pictures, captions);
}

void TrackReport::write(const PageSource& source, const Device& device, const Scene& scene,
                        const std::vector<TrackRow>& rows, bool quiet) const {
  const std::vector<Kept> kept = all_kept();
  std::vector<std::vector<Picture>> pictures;
  for (const Picture& picture : write_frames(device, scene, kept)) pictures.push_back({picture});
  const Plot curves = track_plot(rows);
  const bool has_curves = !curves.panels.empty(),
             is_plotted = has_curves && plot(folder_ / "plot.png", curves);
  if (has_curves && !is_plotted && !quiet) std::printf("plot.png is left out: gnuplot is not installed\n");

  Page page(source);
  page.add_heading("Frames");
  page.add_paragraph(std::to_string(kept.size()) + " of " + counted(rows.size(), "frame") +
                     ", with the outline of the object in the pose found; none where it is lost.");
  page.add_player({}, pictures);
  page.add_heading("Result");
  page.add_facts({{"frames", std::to_string(rows.size())},
                  {"searched for and found", frames_text(rows, TrackStatus::found)},
                  {"followed", frames_text(rows, TrackStatus::tracked)},
                  {"lost", frames_text(rows, TrackStatus::lost)}});
  if (is_plotted) page.add_plot("plot.png", "loss, rotation and translation by frame", curves);
  page.add_heading("Poses");
  page.add_table(table(rows));
  page.write(folder_ / "index.html");
}

}  // namespace dpr::cli
