// Images of depths and normals beside the views: read from files, and what looks wrong about them.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>

#include "dpr/notes.hpp"
#include "dpr/shape.hpp"

namespace dpr {

/// Depths, in the first channel, or normals.
enum class Measured { depth, normal };

/// The files that were read, and a sentence about each kind of oddity in them, whatever the number of views.
class MeasuredImages {
 public:
  MeasuredImages() = default;
  /// depth_scale: lengths of the scene for a depth of 1 in the files.
  explicit MeasuredImages(float depth_scale) : depth_scale_(depth_scale) {}

  /// Pixels that are 0 do not count: alpha 0. Throws IoError, and InvalidArgument for another size than the
  /// picture's and for depths below 0.
  Image read(const std::filesystem::path& file, const Image& picture, Measured kind);
  /// Notes depths of a view outside its camera's range. Throws InvalidArgument where all lie outside.
  void check_range(const ShapeView& view, const std::string& name);
  void append_to(Notes& notes) const;

 private:
  struct Finding {
    std::string first;  // what was found first
    std::size_t count = 0;

    void add(const std::string& what);
  };
  std::optional<float> depth_scale_;
  Finding whole_numbers_, out_of_range_;
};

/// Throws InvalidArgument unless all views have an image of the kind, or none has, and each suits its view
/// and has a pixel that counts.
void check_measured(const ShapeViews& views, Measured kind);

}  // namespace dpr
