#include "learn/generate.hpp"

#include <algorithm>
#include <cmath>
#include <ostream>

#include "base/output_file.hpp"
#include "dpr/error.hpp"

namespace dpr::learn {
namespace {

constexpr int k_supersampling = 2;

/// A seed of its own for every object: SplitMix64 (Steele, Lea & Flood 2014) of what names it.
std::uint64_t object_seed(std::uint64_t seed, std::size_t object_class, Split split, std::size_t number) {
  std::uint64_t state = seed;
  for (const std::uint64_t part :
       {std::uint64_t{object_class}, static_cast<std::uint64_t>(split), std::uint64_t{number}}) {
    std::uint64_t z = (state ^ part) + 0x9e3779b97f4a7c15ULL;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    state = z ^ (z >> 31U);
  }
  return state;
}

Lights studio_lights() {
  Lights lights;
  lights.ambient = glm::vec3(0.55F);
  lights.point = {{.position = {1.5F, 4.0F, 3.0F}, .diffuse = glm::vec3(0.45F), .specular = glm::vec3(0)}};
  lights.shading = Shading::flat;
  return lights;
}

std::uint8_t to_byte(float value) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0F, 1.0F) * 255.0F));
}

/// Appends the planes of an image, each pixel the mean of those it covers.
void append_planes(const Image& image, std::vector<std::uint8_t>& planes) {
  constexpr float k_share = 1.0F / (k_supersampling * k_supersampling);
  for (int channel = 0; channel < 4; ++channel) {
    for (int row = 0; row < k_image_size; ++row) {
      for (int column = 0; column < k_image_size; ++column) {
        float sum = 0;
        for (int i = 0; i < k_supersampling * k_supersampling; ++i) {
          sum += image.at(column * k_supersampling + i % k_supersampling,
                          row * k_supersampling + i / k_supersampling)[channel];
        }
        planes.push_back(to_byte(sum * k_share));
      }
    }
  }
}

void write_ids(const std::filesystem::path& file, std::size_t object_class, std::uint64_t seed, Split split,
               std::size_t objects) {
  write_whole_file(file, [&](std::ostream& out) {
    for (std::size_t i = 0; i < objects; ++i) {
      out << object_classes()[object_class].synset << '/' << std::hex
          << object_seed(seed, object_class, split, i) << '\n';
    }
  });
}

}  // namespace

ExampleMaker::ExampleMaker(const Device& device) : renderer_(device) {}

Example ExampleMaker::make(const Mesh& mesh) {
  Scene scene;
  scene.width = scene.height = k_image_size * k_supersampling;
  scene.camera = dataset_camera(0);
  scene.lights = studio_lights();
  scene.smoothing = rigid_smoothing();
  scene.meshes.push_back({mesh});
  renderer_.set_scene(scene);
  std::vector<View> views;
  for (std::size_t v = 0; v < k_views; ++v) views.push_back({dataset_camera(v), {glm::mat4(1.0F)}});
  renderer_.set_views(views);
  renderer_.forward();
  Example example;
  example.images.reserve(k_views * k_image_bytes);
  for (std::size_t v = 0; v < k_views; ++v) append_planes(renderer_.image(v), example.images);
  example.voxels = to_file_order(voxelize(mesh, k_voxel_resolution, voxel_bounds()));
  return example;
}

void generate(const Device& device, const GenerateOptions& options, const std::filesystem::path& folder,
              const std::function<void(std::size_t, std::size_t, const std::string&)>& progress) {
  if (options.classes.empty()) throw InvalidArgument("classes (generate)", "none", "at least one");
  ExampleMaker maker(device);
  std::size_t done = 0, all = 0;
  for (const std::size_t objects : options.objects) all += objects * options.classes.size();
  for (const std::size_t c : options.classes) {
    for (const Split split : {Split::train, Split::val, Split::test}) {
      const std::size_t objects = options.objects[static_cast<std::size_t>(split)];
      std::vector<std::uint8_t> images, voxels;
      for (std::size_t i = 0; i < objects; ++i) {
        const Example example = maker.make(make_object(c, object_seed(options.seed, c, split, i)));
        images.insert(images.end(), example.images.begin(), example.images.end());
        voxels.insert(voxels.end(), example.voxels.begin(), example.voxels.end());
        progress(++done, all, std::string(object_classes()[c].name) + ", " + to_string(split));
      }
      constexpr std::size_t n = k_voxel_resolution, side = k_image_size;
      const std::size_t image_shape[] = {objects, k_views, 4, side, side}, voxel_shape[] = {objects, n, n, n};
      // An earlier set's go first: cut off here, files are missing, and none belong to other images.
      std::filesystem::remove(voxels_file(folder, c, split));
      std::filesystem::remove(ids_file(folder, c, split));
      write_npz(images_file(folder, c, split), image_shape, images);
      write_npz(voxels_file(folder, c, split), voxel_shape, voxels, /*is_bool=*/true);
      write_ids(ids_file(folder, c, split), c, options.seed, split, objects);
    }
  }
}

Image contact_sheet(const Dataset& dataset) {
  constexpr std::size_t k_objects = 6, k_step = 7;  // views that are no multiple of each other
  constexpr int k_gap = 2, k_pitch = k_image_size + k_gap;
  const int rows = static_cast<int>(dataset.classes().size());
  Image sheet(2 * static_cast<int>(k_objects) * k_pitch, rows * k_pitch, glm::vec4(1));
  for (std::size_t row = 0; row < dataset.classes().size(); ++row) {
    const std::size_t first = dataset.first_object(row), count = dataset.first_object(row + 1) - first;
    for (std::size_t column = 0; column < 2 * std::min(k_objects, count); ++column) {
      const Image image = to_image(dataset.image(first + column / 2, (1 + k_step * column) % k_views));
      for (int y = 0; y < k_image_size; ++y) {
        for (int x = 0; x < k_image_size; ++x) {
          const glm::vec4& pixel = image.at(x, y);
          sheet.at(static_cast<int>(column) * k_pitch + x, static_cast<int>(row) * k_pitch + y) =
              glm::vec4(glm::vec3(pixel) + (1 - pixel.a) * glm::vec3(0.9F), 1);
        }
      }
    }
  }
  return sheet;
}

}  // namespace dpr::learn
