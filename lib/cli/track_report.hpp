// Report of a track: pictures of some frames with the object's outline, plots, numbers.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <vector>

#include "cli/page.hpp"
#include "cli/track_files.hpp"
#include "dpr/device.hpp"
#include "dpr/image.hpp"

namespace dpr::cli {

/// Keeps some of the frames as they come, as many however long the sequence is: at equal distances, the last, and such
/// as follow where the object was lost or found again.
class TrackReport {
 public:
  explicit TrackReport(std::filesystem::path folder);

  void add(const TrackRow& row, const Image& image);

  /// Writes frames.png, plot.png and index.html. Throws IoError.
  void write(const PageSource& source, const Device& device, const Scene& scene,
             const std::vector<TrackRow>& rows, bool quiet) const;

 private:
  struct Kept {
    TrackRow row;
    Image image;
    bool turns;  // the object was lost or found again
  };
  std::vector<Kept> all_kept() const;
  std::vector<Picture> write_frames(const Device& device, const Scene& scene,
                                    const std::vector<Kept>& kept) const;

  std::filesystem::path folder_;
  std::vector<Kept> kept_;
  std::optional<Kept> last_;
  std::size_t stride_ = 1, turns_ = 0;
};

}  // namespace dpr::cli
