// The frames of --sequence: files in their order, or a video; and images beside them.
#pragma once

#include <cstddef>
#include <deque>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dpr/image.hpp"
#include "dpr/scene.hpp"
#include "image/codec.hpp"

namespace dpr::cli {

/// True if the text comes first where numbers in names count as such: "a9" before "a10".
bool is_naturally_less(const std::string& a, const std::string& b);

struct SequenceFrame {
  std::string file;  ///< of a video "FILE:NUMBER", counted from 0
  Image image;
};

/// Reads frames one by one. Each name is a file; a folder, all of whose images count, in natural order; a pattern such
/// as "frames/%04d.png", "frames/%d.png" or "frames/####.png", which stands for all numbers from the lowest to the
/// highest that there is; or a video.
class Sequence {
 public:
  using Reader = std::function<Image(const std::string& file)>;

  /// Images must have the scene's size. Throws InvalidArgument where a folder or a pattern has no file, IoError where a
  /// folder cannot be read.
  Sequence(const std::vector<std::string>& names, Encoding encoding, const Scene& scene);
  /// The same of another option, read otherwise. Throws InvalidArgument for videos.
  Sequence(const char* option, const std::vector<std::string>& names, const Scene& scene, Reader reader);

  /// Throws InvalidArgument where the files of both are those of folders, as many, and the name of one does not end with
  /// the number of the frame in its place, or without numbers does not begin with its name. Call it before next().
  void require_names_of(const Sequence& frames) const;

  /// None behind the last. Throws IoError, and InvalidArgument for a frame of another size.
  std::optional<SequenceFrame> next();
  /// Number of all frames; not known with a video among them.
  std::optional<std::size_t> size() const { return size_; }

 private:
  std::optional<SequenceFrame> next_of_video();
  SequenceFrame checked(std::string file, Image image) const;

  const char* option_;
  std::deque<std::filesystem::path> files_;
  bool are_folders_;  // that the files are in
  Reader reader_;
  Encoding encoding_ = Encoding::linear;  // of videos
  glm::ivec2 size_of_frames_;
  std::optional<std::size_t> size_;
  std::optional<Video> video_;  // that is being read, the first of the files
  std::size_t video_frame_ = 0;
};

}  // namespace dpr::cli
