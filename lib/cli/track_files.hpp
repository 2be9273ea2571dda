// The poses of a sequence as files.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/output_file.hpp"
#include "cli/json.hpp"
#include "dpr/pose_tracker.hpp"
#include "dpr/scene.hpp"

namespace dpr::cli {

/// A frame of a sequence, and what was found.
struct TrackRow {
  std::size_t frame = 0;  ///< counted from 0
  std::string file;
  TrackedPose found;
  double seconds = 0;  ///< of tracking
};

/// "found", "tracked", "lost".
std::string_view name_of(TrackStatus status);

/// A table with a row for each frame: frame, file, status, rx, ry, rz (rotation vector of the object-to-world rotation,
/// radians), tx, ty, tz (translation, world), loss, explained_below, seconds. Rotation and translation of a lost object
/// are empty. Rows are written as they come, to a temporary file that commit() renames; a pipe gets them at once.
class TrackTable {
 public:
  /// Throws IoError where the file cannot be written.
  explicit TrackTable(const std::filesystem::path& file);
  void add(const TrackRow& row);
  /// Throws IoError where anything went wrong.
  void commit() { output_.commit(); }

 private:
  OutputFile output_;
};

/// track.json: what a whole track tells, and "poses", in the order of the frames. `error` is what ended it; empty at
/// its end.
Json track_to_json(const Scene& scene, const std::vector<TrackRow>& rows, const std::string& error);

}  // namespace dpr::cli
