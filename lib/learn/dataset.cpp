#include "learn/dataset.hpp"

#include <algorithm>
#include <sstream>
#include <system_error>

#include "base/input_file.hpp"
#include "dpr/error.hpp"

namespace dpr::learn {
namespace {

constexpr const char* k_split_names[] = {"train", "val", "test"};

std::filesystem::path class_file(const std::filesystem::path& folder, std::size_t object_class, Split split,
                                 const std::string& ending) {
  return folder / (std::string(object_classes()[object_class].synset) + "_" + to_string(split) + ending);
}

std::string shape_text(std::span<const std::size_t> shape) {
  std::string text;
  for (const std::size_t size : shape) text += (text.empty() ? "" : "x") + std::to_string(size);
  return text;
}

/// Reads an array whose first dimension may be any.
ByteArray read_array(const std::filesystem::path& file, std::initializer_list<std::size_t> rest) {
  ByteArray array = read_npz(file);
  if (array.shape.size() != rest.size() + 1 ||
      !std::equal(rest.begin(), rest.end(), array.shape.begin() + 1)) {
    throw IoError(file, "has the shape " + shape_text(array.shape) + ", not Nx" + shape_text(rest));
  }
  return array;
}

void require_class(const std::filesystem::path& folder, std::size_t object_class, Split split) {
  const std::filesystem::path file = images_file(folder, object_class, split);
  std::error_code error;
  if (std::filesystem::exists(file, error)) return;
  throw IoError(file, "is missing: the folder has no " + std::string(object_classes()[object_class].name) +
                          " in its split " + to_string(split) + "; --classes names the classes to read");
}

/// Throws IoError if there is a list of the objects, and of another number of them.
void check_list(const std::filesystem::path& file, std::size_t objects) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return;
  std::istringstream list(read_file(file));
  std::size_t lines = 0;
  for (std::string line; std::getline(list, line);) lines += line.empty() ? 0 : 1;
  if (lines == objects) return;
  throw IoError(file,
                "lists " + std::to_string(lines) + " objects, the images are of " + std::to_string(objects));
}

}  // namespace

std::string to_string(Split split) { return k_split_names[static_cast<std::size_t>(split)]; }

Split parse_split(const std::string& word) {
  const auto found = std::ranges::find(k_split_names, word);
  if (found != std::end(k_split_names)) return static_cast<Split>(found - k_split_names);
  throw InvalidArgument("split", "\"" + word + "\"", "train, val or test");
}

Camera dataset_camera(std::size_t view) {
  constexpr float k_distance = 2.732F, k_elevation = 30.0F, k_step = 360.0F / k_views;
  Camera camera = orbit_camera(k_distance, k_elevation, -k_step * static_cast<float>(view));
  camera.fov_y_degrees = 30.0F;
  return camera;
}

Bounds voxel_bounds() {
  constexpr float k_half = 0.5F * k_voxel_resolution / (k_voxel_resolution - 1);
  return {glm::vec3(-k_half), glm::vec3(k_half)};
}

std::filesystem::path images_file(const std::filesystem::path& folder, std::size_t object_class,
                                  Split split) {
  return class_file(folder, object_class, split, "_images.npz");
}

std::filesystem::path voxels_file(const std::filesystem::path& folder, std::size_t object_class,
                                  Split split) {
  return class_file(folder, object_class, split, "_voxels.npz");
}

std::filesystem::path ids_file(const std::filesystem::path& folder, std::size_t object_class, Split split) {
  return class_file(folder, object_class, split, "ids.txt");
}

std::vector<std::uint8_t> to_file_order(const VoxelGrid& grid) {
  std::vector<std::uint8_t> voxels;
  for (unsigned y = 0; y < grid.resolution; ++y) {
    for (unsigned x = 0; x < grid.resolution; ++x) {
      for (unsigned z = 0; z < grid.resolution; ++z) voxels.push_back(grid.occupied(x, y, z) ? 1 : 0);
    }
  }
  return voxels;
}

VoxelGrid from_file_order(std::span<const std::uint8_t> voxels) {
  VoxelGrid grid{k_voxel_resolution, voxel_bounds(), std::vector<std::uint8_t>(k_voxel_count)};
  auto value = voxels.begin();
  for (unsigned y = 0; y < grid.resolution; ++y) {
    for (unsigned x = 0; x < grid.resolution; ++x) {
      for (unsigned z = 0; z < grid.resolution; ++z) grid.cells[grid.index(x, y, z)] = *value++ != 0 ? 1 : 0;
    }
  }
  return grid;
}

Dataset::Dataset(const std::filesystem::path& folder, Split split, std::span<const std::size_t> classes)
    : classes_(classes.begin(), classes.end()) {
  if (classes_.empty()) throw InvalidArgument("classes (dataset)", "none", "at least one");
  for (const std::size_t c : classes_) {
    constexpr std::size_t n = k_voxel_resolution, side = k_image_size;
    const std::filesystem::path file = voxels_file(folder, c, split);
    require_class(folder, c, split);
    images_.push_back(read_array(images_file(folder, c, split), {k_views, 4, side, side}));
    voxels_.push_back(read_array(file, {n, n, n}));
    const std::size_t objects = images_.back().shape[0];
    if (objects == 0 || voxels_.back().shape[0] != objects) {
      throw IoError(file, "has " + std::to_string(voxels_.back().shape[0]) + " objects, its images " +
                              std::to_string(objects));
    }
    check_list(ids_file(folder, c, split), objects);
    first_.push_back(count_);
    count_ += objects;
  }
  first_.push_back(count_);
}

std::size_t Dataset::place(std::size_t object) const {
  return static_cast<std::size_t>(std::ranges::upper_bound(first_, object) - first_.begin()) - 1;
}

std::span<const std::uint8_t> Dataset::image(std::size_t object, std::size_t view) const {
  const std::size_t i = place(object), index = (object - first_[i]) * k_views + view;
  return std::span(images_[i].values).subspan(index * k_image_bytes, k_image_bytes);
}

VoxelGrid Dataset::voxels(std::size_t object) const {
  const std::size_t i = place(object);
  return from_file_order(
      std::span(voxels_[i].values).subspan((object - first_[i]) * k_voxel_count, k_voxel_count));
}

Image to_image(std::span<const std::uint8_t> planes) {
  constexpr std::size_t k_plane = k_image_bytes / 4;
  Image image(k_image_size, k_image_size);
  for (std::size_t i = 0; i < k_plane; ++i) {
    for (std::size_t channel = 0; channel < 4; ++channel) {
      image.pixels[i][static_cast<int>(channel)] = static_cast<float>(planes[channel * k_plane + i]) / 255.0F;
    }
  }
  return image;
}

}  // namespace dpr::learn
