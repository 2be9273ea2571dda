// dpr track: an object's poses in a sequence of images.
#include <cstdio>
#include <exception>
#include <memory>
#include <optional>

#include "base/clock.hpp"
#include "cli/commands.hpp"
#include "cli/file_options.hpp"
#include "cli/option_names.hpp"
#include "cli/pose_options.hpp"
#include "cli/pose_pictures.hpp"
#include "cli/progress.hpp"
#include "cli/provenance.hpp"
#include "cli/sequence.hpp"
#include "cli/target.hpp"
#include "cli/text.hpp"
#include "cli/track_files.hpp"
#include "cli/track_report.hpp"
#include "dpr/error.hpp"
#include "solve/polar.hpp"

namespace dpr::cli {
namespace {

const char* const k_tracking_group = "Tracking";
const char* const k_method_group = "Least squares";

struct TrackCommandOptions {
  std::string scene, initial_rotation, output, csv, report;
  std::vector<std::string> sequence, silhouettes, depths;
  std::optional<float> depth_scale;
  LeastSquaresOptions least_squares{.method = TrackOptions().method};
  TrackOptions tracker;
};

/// Frames, and what was observed in each beside its colours.
class Frames {
 public:
  Frames(const TrackCommandOptions& options, const CommonOptions& common, const Scene& scene)
      : images_(options.sequence, common.encoding(), scene) {
    if (options.depth_scale && options.depths.empty())
      throw InvalidArgument("--depth-scale (command line)", "no --depth", "the files whose unit it is");
    add("--silhouette", options.silhouettes, scene, read_silhouette, &TrackFrame::silhouette);
    add(
        "--depth", options.depths, scene,
        [scale = options.depth_scale](const std::string& file) { return read_depth(file, scale); },
        &TrackFrame::depth);
  }

  std::optional<std::size_t> size() const { return images_.size(); }

  /// The frame and the name of its image; none behind the last.
  std::optional<std::pair<std::string, TrackFrame>> next() {
    std::optional<SequenceFrame> image = images_.next();
    if (!image) return std::nullopt;
    TrackFrame frame{std::move(image->image)};
    for (Beside& beside : beside_) {
      std::optional<SequenceFrame> own = beside.sequence.next();
      if (!own) {
        throw InvalidArgument(std::string(beside.option) + " (command line)", "none for " + image->file,
                              "an image for each frame");
      }
      frame.*beside.member = std::move(own->image);
    }
    return std::pair(std::move(image->file), std::move(frame));
  }

 private:
  struct Beside {
    const char* option;
    Sequence sequence;
    Image TrackFrame::*member;
  };

  void add(const char* option, const std::vector<std::string>& names, const Scene& scene,
           const Sequence::Reader& reader, Image TrackFrame::*member) {
    if (names.empty()) return;
    beside_.push_back({option, Sequence(option, names, scene, reader), member});
    const std::size_t count = *beside_.back().sequence.size();
    if (!size()) return;
    if (count == *size()) return beside_.back().sequence.require_names_of(images_);
    throw InvalidArgument("images of " + std::string(option) + " (command line)", std::to_string(count),
                          std::to_string(*size()) + ", one for each frame");
  }

  Sequence images_;
  std::vector<Beside> beside_;
};

/// A run: the frames so far.
class Run {
 public:
  Run(const TrackCommandOptions& options, const CommonOptions& common, const Device& device,
      const Scene& scene)
      : options_(options), common_(common), device_(device), scene_(scene) {
    if (!options.csv.empty()) table_.emplace(options.csv);
    if (!options.report.empty()) report_.emplace(options.report);
  }

  /// Tracks all frames.
  void follow(PoseTracker& tracker, Frames& frames) {
    Progress progress(static_cast<unsigned>(frames.size().value_or(0)), common_.quiet, "frame");
    for (;;) {
      const Clock::time_point start = Clock::now();
      const auto next = frames.next();
      if (!next) return;
      const auto& [file, frame] = *next;
      const double reading = seconds_since(start);
      TrackRow row{rows_.size(), file, tracker.track(frame), 0};
      row.seconds = seconds_since(start) - reading;
      add(row, frame.image, reading);
      progress.update(
          static_cast<unsigned>(rows_.size()),
          format("%s  loss %.4e", std::string(name_of(row.found.status)).c_str(), row.found.loss));
    }
  }

  /// Writes what was found; `error` is what ended the run early.
  void write(const std::string& error) {
    if (table_) table_->commit();
    write_json(options_.output, track_to_json(scene_, rows_, error));
    if (!report_) return;
    const std::string title = "The track of " + std::filesystem::path(options_.scene).filename().string();
    report_->write(page_source(title, common_, {&device_, 1}), device_, scene_, rows_, common_.quiet);
  }

  bool is_empty() const { return rows_.empty(); }
  void print() const;

 private:
  void add(const TrackRow& row, const Image& image, double reading) {
    rows_.push_back(row);
    if (rows_.size() > 1) tracking_ += row.seconds, reading_ += reading;
    if (table_) table_->add(row);
    if (report_) report_->add(row, image);
  }

  const TrackCommandOptions& options_;
  const CommonOptions& common_;
  const Device& device_;
  const Scene& scene_;
  std::optional<TrackTable> table_;
  std::optional<TrackReport> report_;
  std::vector<TrackRow> rows_;
  double tracking_ = 0, reading_ = 0;  // seconds, of all frames but the first
};

void Run::print() const {
  std::size_t lost = 0, found = 0;
  for (const TrackRow& row : rows_) {
    lost += row.found.status == TrackStatus::lost ? 1 : 0;
    found += row.found.status == TrackStatus::found ? 1 : 0;
  }
  std::printf("%s: %s: %zu searched for and found, %zu followed, %zu lost\n", options_.output.c_str(),
              counted(rows_.size(), "frame").c_str(), found, rows_.size() - found - lost, lost);
  if (lost > 0) {
    const bool is_robust = options_.tracker.method.robust || options_.tracker.method.unknown_background;
    const double twice = 2 * static_cast<double>(options_.tracker.explained);
    std::string advice =
        is_robust ? ""
                  : " --robust bears what the scene lacks, --unknown-background what is behind the object.";
    if (twice < 1)
      advice += format(" --explained %g, twice as much, lets more of the object be hidden.", twice);
    std::printf("No pose explains a lost frame.%s\n", advice.c_str());
  }
  if (rows_.size() < 2) return;
  const auto others = static_cast<double>(rows_.size() - 1);
  std::printf("The first frame took %.2f s; then %.1f frames a second, %.1f with reading them.\n",
              rows_.front().seconds, others / tracking_, others / (tracking_ + reading_));
}

void run(const CLI::App& command, TrackCommandOptions& options, const CommonOptions& common) {
  options.tracker.method = read_least_squares(command, options.least_squares);
  const std::string& mask = options.least_squares.mask;
  if (!mask.empty()) options.tracker.method.mask = read_image(mask, nullptr, Encoding::linear);
  Scene scene = read_scene(options.scene, common);
  if (!options.initial_rotation.empty() && scene.meshes.size() == 1) {
    glm::mat4& transform = scene.meshes.front().transform;
    const glm::dmat3 rotation =
        rotation_from_vector(parse_vector(options.initial_rotation, "--initial-rotation (command line)"));
    transform =
        affine(rotation * polar_decomposition(glm::dmat3(transform)).stretch, glm::dvec3(transform[3]));
  }
  Frames frames(options, common, scene);
  std::vector<std::filesystem::path> outputs{options.output};
  if (!options.csv.empty()) outputs.emplace_back(options.csv);
  require_outputs(outputs, options.report);
  const Device device = open_device(common);
  PoseTracker tracker = with_option_names(command, k_least_squares_names,
                                          [&] { return PoseTracker(device, scene, options.tracker); });
  Run track(options, common, device, scene);
  try {
    track.follow(tracker, frames);
  } catch (const Error& error) {
    // The poses found until then are not lost.
    if (!track.is_empty()) track.write(error.what());
    throw;
  }
  track.write("");
  if (!common.quiet) track.print();
}

void add_tracking_options(CLI::App& command, TrackOptions& tracker) {
  const auto add = [&](const char* name, auto& value, const char* description, const char* type) {
    command.add_option(name, value, description)->group(k_tracking_group)->type_name(type);
  };
  add("--damping", tracker.damping,
      "Part of the motion between two frames that is expected again, in [0, 1]; 0.9 by default", "FLOAT");
  add("--explained", tracker.explained,
      "A frame counts as explained below that part of what is left without the object, or below its square "
      "root with --robust; more lets more of the object be hidden; 0.1 by default",
      "FLOAT");
  add("--search-interval", tracker.search_interval,
      "A lost object is looked for about its last place in every frame, and everywhere in the first and "
      "every "
      "N-th frame without it; 0: never; 10 by default",
      "N");
  command
      .add_flag("--covariance", tracker.covariance,
                "Write the poses' covariances too, as dpr pose does; takes about half as long again")
      ->group(k_tracking_group);
}

}  // namespace

void add_track_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand(
      "track", "Follows the pose of a scene's only mesh through a sequence of images");
  const auto options = std::make_shared<TrackCommandOptions>();
  command->add_option("--scene", options->scene, "Scene file")->required()->type_name("S.json");
  command
      ->add_option(
          "--sequence", options->sequence,
          "Frames of the scene's size: files; a folder, whose images are taken in natural order, but for "
          "those that --aov leaves beside them; a pattern such as 'frames/%04d.png' or 'frames/####.png', "
          "all numbers from the lowest to the highest; or a "
          "video, if OpenImageIO was built with FFmpeg")
      ->required()
      ->type_name("FILE");
  CLI::Option* initial =
      command
          ->add_option(
              "--initial-rotation", options->initial_rotation,
              "Rotation vector of the object-to-world rotation in the first frame, about, in radians "
              "(default: the rotation of the scene's transform)")
          ->type_name("RX,RY,RZ");
  command
      ->add_flag("--search", options->tracker.search, "Nothing is known of the rotation in the first frame")
      ->excludes(initial);
  command->add_flag("--translation", options->tracker.solve_translation, "Look for the translation too");
  command
      ->add_option(
          "-o,--output", options->output,
          "Poses to write: a list in the order of the frames, each as in dpr pose's file with a status: "
          "found (searched for), tracked (followed), or lost, which has no pose")
      ->required()
      ->type_name("TRACK.json");
  command
      ->add_option(
          "--csv", options->csv,
          "The same as a table: frame, file, status, rx, ry, rz (rotation vector, radians), tx, ty, tz "
          "(world "
          "units), loss, the loss below which it would be explained, seconds; rotation and translation of a "
          "lost object are empty. A named pipe gets each row at once. If a frame cannot be read, both files "
          "have the poses up to it")
      ->type_name("TRACK.csv");
  command
      ->add_option("--report", options->report,
                   "Folder for a page with plots, and pictures of some frames with the object's outline")
      ->type_name("DIR");
  add_tracking_options(*command, options->tracker);
  command
      ->add_option(
          "--silhouette", options->silhouettes,
          "Images of where the object is, one for each frame, named as those of --sequence: 1, and 0 "
          "where it is not, in the alpha, if that is below 1 anywhere, or else in the first channel")
      ->group(k_tracking_group)
      ->type_name("FILE");
  command
      ->add_option("--depth", options->depths,
                   "Images of depths, one for each frame, named as those of --sequence: the distance along "
                   "the camera's axis in the first channel; 0 or NaN where it is not known")
      ->group(k_tracking_group)
      ->type_name("FILE");
  add_least_squares_options(*command, k_method_group, options->least_squares);
  add_observation_weights(*command, k_method_group, options->least_squares.method, options->depth_scale);
  add_image_options(*command, common);
  command->footer(
      "Example: dpr track --scene scene.json --sequence 'frames/%04d.png' --translation -o track.json "
      "--report track");
  command->callback([command, options, &common] { run(*command, *options, common); });
}

}  // namespace dpr::cli
