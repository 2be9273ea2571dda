// The data set of this project's own families of shapes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "dpr/renderer.hpp"
#include "learn/dataset.hpp"

namespace dpr::learn {

struct GenerateOptions {
  std::vector<std::size_t> classes;                 ///< at least one
  std::array<std::size_t, 3> objects{160, 16, 24};  ///< of a class, by Split
  std::uint64_t seed = 1;
};

/// Images and voxels of one object, in the order of the files.
struct Example {
  std::vector<std::uint8_t> images;  ///< [24][4][64][64]
  std::vector<std::uint8_t> voxels;  ///< [32][32][32]
};

/// An object of a class: rendered rigidly from the 24 views at twice the size, halved by averaging; lit by
/// one light that stands still while the camera goes round; and its voxels, exact: cells whose centres its
/// solids enclose.
class ExampleMaker {
 public:
  explicit ExampleMaker(const Device& device);
  Example make(const Mesh& mesh);

 private:
  Renderer renderer_;
};

/// Writes images, voxels and lists of every class and split into an existing folder. The same options give
/// the same files on one device. `progress` is told of objects done, of all, and what is being made; it may
/// throw to stop.
void generate(const Device& device, const GenerateOptions& options, const std::filesystem::path& folder,
              const std::function<void(std::size_t, std::size_t, const std::string&)>& progress);

/// A row of views of the first objects of each class of a data set, one class below the other.
Image contact_sheet(const Dataset& dataset);

}  // namespace dpr::learn
