// The pictures of dpr pose: read in any size, then scaled to the scene's.
#pragma once

#include <glm/glm.hpp>
#include <optional>
#include <string>

#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/notes.hpp"
#include "dpr/scene.hpp"

namespace dpr::cli {

/// Files of the options; empty: not given.
struct PosePictureFiles {
  std::string target, mask, silhouette, depth;
  std::optional<float> depth_scale;  ///< what a 1 of the depth file is; whole numbers need one
};

/// Images as PoseSolver takes them; empty: none.
struct ObservedPictures {
  Image target;
  Image mask;            ///< weights in the first channel
  Image silhouette;      ///< coverage in the first channel: the file's alpha where that is below 1 somewhere
  Image depth;           ///< distance along the axis, the scene's units; alpha 0 where there is none
  float focal_35mm = 0;  ///< Exif's of the target's file, or else 0

  /// Size of the picture that the scene should have: the target's, or else the silhouette's, or else the depth's.
  glm::ivec2 size() const;
};

/// --silhouette's file, and --depth's: throw IoError, and InvalidArgument for depths of whole numbers without a scale.
Image read_silhouette(const std::string& file);
Image read_depth(const std::string& file, std::optional<float> scale);

/// Throws IoError, and InvalidArgument where the files show nothing to compare, where silhouettes are to be compared
/// and the target shows none, and where a depth file of whole numbers has no scale.
ObservedPictures read_pictures(const PosePictureFiles& files, const LossWeights& weights, Encoding encoding);

/// Scales the pictures to the scene's size. Colours and coverages become means over the area of a pixel. Masks and
/// depths become medians, of the pixels that have a depth: nothing between an object and what lies behind it arises.
/// A pixel has a depth where at least half of its area has one. Throws InvalidArgument for a picture of another shape.
void scale_pictures(ObservedPictures& pictures, const PosePictureFiles& files, const Scene& scene,
                    Notes& notes);

}  // namespace dpr::cli
