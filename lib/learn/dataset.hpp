// Images and voxels of many objects, in the files that the authors of NMR and SoftRas distribute for
// ShapeNet.
//
// Each class and split of a folder has two files (Kato et al. 2018, make_dataset.py and datasets.py
// of hiroharu-kato/mesh_reconstruction; Liu et al. 2019, examples/recon/datasets.py of ShichenLiu/SoftRas):
//   <synset>_<split>_images.npz   uint8 [object][24][4][64][64]  RGBA over black
//   <synset>_<split>_voxels.npz   bool or uint8 [object][32][32][32]
//   <synset>_<split>ids.txt       a line an object, <synset>/<object>; may be missing
// View k stands at elevation 30 and azimuth -15 k degrees, distance 2.732, field of view 30 degrees; their
// left-handed coordinates are ours with z turned round.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "dpr/camera.hpp"
#include "dpr/image.hpp"
#include "dpr/voxels.hpp"
#include "learn/families.hpp"
#include "learn/npz.hpp"

namespace dpr::learn {

inline constexpr int k_image_size = 64;
inline constexpr std::size_t k_views = 24;
inline constexpr unsigned k_voxel_resolution = 32;
inline constexpr std::size_t k_image_bytes = std::size_t{4} * k_image_size * k_image_size;
inline constexpr std::size_t k_voxel_count =
    std::size_t{k_voxel_resolution} * k_voxel_resolution * k_voxel_resolution;

enum class Split { train, val, test };
std::string to_string(Split split);
/// Throws InvalidArgument.
Split parse_split(const std::string& word);

/// The camera of a view, for square images of any size.
Camera dataset_camera(std::size_t view);

/// The box whose cells the voxels are: their program puts the corners of [-0.5, 0.5]^3 at the centres of the
/// first and the last cell.
Bounds voxel_bounds();

/// The files of a class and split.
std::filesystem::path images_file(const std::filesystem::path& folder, std::size_t object_class, Split split);
std::filesystem::path voxels_file(const std::filesystem::path& folder, std::size_t object_class, Split split);
std::filesystem::path ids_file(const std::filesystem::path& folder, std::size_t object_class, Split split);

/// The voxels of a file, [y][x][z], from a grid in voxel_bounds(); and back.
std::vector<std::uint8_t> to_file_order(const VoxelGrid& grid);
VoxelGrid from_file_order(std::span<const std::uint8_t> voxels);

/// The objects of one split and some classes, all in memory: 426 kB each.
class Dataset {
 public:
  /// Throws IoError for a file that is missing, damaged, of another shape or of other objects than its
  /// class' other files, InvalidArgument where no class is asked for.
  Dataset(const std::filesystem::path& folder, Split split, std::span<const std::size_t> classes);

  std::size_t size() const { return count_; }
  std::span<const std::size_t> classes() const { return classes_; }
  /// The objects of classes()[i] are first_object(i) to first_object(i + 1) - 1.
  std::size_t first_object(std::size_t i) const { return first_[i]; }

  /// RGBA planes [4][64][64].
  std::span<const std::uint8_t> image(std::size_t object, std::size_t view) const;
  VoxelGrid voxels(std::size_t object) const;

 private:
  std::size_t place(std::size_t object) const;

  std::vector<std::size_t> classes_, first_;
  std::vector<ByteArray> images_, voxels_;  // [class]
  std::size_t count_ = 0;
};

/// The planes of an image as an Image.
Image to_image(std::span<const std::uint8_t> planes);

}  // namespace dpr::learn
