// The families of shapes, their data set, and its files.
#include "learn/dataset.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "learn/generate.hpp"
#include "mesh/bounding_box.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/temp_dir.hpp"

namespace dpr::test::dataset_test {
namespace {

using namespace learn;

/// Six times the volume that the faces enclose, solids that overlap counted twice.
double signed_volume(const Mesh& mesh) {
  double volume = 0;
  for (const glm::uvec3& f : mesh.faces) {
    volume += glm::dot(glm::dvec3(mesh.positions[f.x]),
                       glm::cross(glm::dvec3(mesh.positions[f.y]), glm::dvec3(mesh.positions[f.z])));
  }
  return volume;
}

/// Every directed edge of a closed, consistently oriented surface meets its opposite.
bool is_closed(const Mesh& mesh) {
  std::vector<std::pair<unsigned, unsigned>> edges, opposites;
  for (const glm::uvec3& f : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      edges.emplace_back(f[k], f[(k + 1) % 3]);
      opposites.emplace_back(f[(k + 1) % 3], f[k]);
    }
  }
  std::ranges::sort(edges);
  std::ranges::sort(opposites);
  return edges == opposites && std::ranges::adjacent_find(edges) == edges.end();
}

GenerateOptions small_options() { return {{find_class("chair"), find_class("lamp")}, {2, 1, 1}, 5}; }

void make_small(const std::filesystem::path& folder) {
  generate(open_device(), small_options(), folder, [](std::size_t, std::size_t, const std::string&) {});
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("families: closed, oriented outwards, coloured, within the box, and of their seed") {
    for (std::size_t c = 0; c < object_classes().size(); ++c) {
      for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6, 7, 8}) {
        const Mesh mesh = make_object(c, seed);
        CAPTURE(std::string(object_classes()[c].name));
        validate(mesh);
        CHECK(is_closed(mesh));
        CHECK(signed_volume(mesh) > 0);
        const auto [low, high] = bounding_box(mesh.positions);
        CHECK(std::max({high.x, high.y, high.z}) <= 0.5001F);
        CHECK(glm::length(low + high) < 1e-5F);
        CHECK(glm::length(high - low) <= 1.2001F);
        for (const glm::vec3& color : mesh.face_colors) {
          CHECK(glm::all(glm::greaterThanEqual(color, glm::vec3(0))));
          CHECK(glm::all(glm::lessThanEqual(color, glm::vec3(1))));
        }
        CHECK(make_object(c, seed).positions == mesh.positions);
        CHECK(make_object(c, seed + 100).positions != mesh.positions);
        CHECK(voxelize(mesh, k_voxel_resolution, voxel_bounds()).count() > 100);
      }
    }
    CHECK(find_class("02691156") == find_class("airplane"));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, find_class("horse"), "airplane, bench, dresser");
  }

  TEST_CASE("data set: cameras and voxels are where the published program has them") {
    // Its eye, in its left-handed coordinates, is (d cos e sin a, d sin e, -d cos e cos a) with a = -15 k
    // degrees.
    for (const std::size_t view : {0, 1, 9, 23}) {
      const double e = glm::radians(30.0), a = glm::radians(-15.0 * static_cast<double>(view)), d = 2.732;
      const glm::dvec3 eye(d * cos(e) * sin(a), d * sin(e), d * cos(e) * cos(a));
      const glm::dmat4 to_world = glm::inverse(glm::dmat4(dataset_camera(view).view));
      CHECK(glm::distance(glm::dvec3(to_world[3]), eye) < 1e-5);
    }
    // Its voxel [a][b][c] is x = b, y = a, and c counts against its z, so along ours; the corners of the unit
    // cube are the centres of the outermost.
    Mesh corner = make_cube();
    for (glm::vec3& p : corner.positions) p = glm::vec3(0.5F, -0.5F, 0.25F) + 0.012F * p;
    const std::vector<std::uint8_t> voxels =
        to_file_order(voxelize(corner, k_voxel_resolution, voxel_bounds()));
    const std::size_t y = 0, x = 31, z = 23;  // 0.25 * 31 + 15.5 = 23.25
    CHECK(std::ranges::count(voxels, 1) == 1);
    CHECK(voxels[(y * 32 + x) * 32 + z] == 1);
    const VoxelGrid back = from_file_order(voxels);
    CHECK(back.occupied(31, 0, 23));
    CHECK(back.count() == 1);
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("data set: generated files read back as what was made, and the same twice") {
    if (is_reduced()) return;
    const TempDir folder, again;
    make_small(folder.path());
    make_small(again.path());
    const std::vector<std::size_t> classes = small_options().classes;
    const Dataset train(folder.path(), Split::train, classes), test(folder.path(), Split::test, classes);
    CHECK(train.size() == 4);
    CHECK(test.size() == 2);
    for (const std::filesystem::directory_entry& entry : std::filesystem::directory_iterator(folder.path())) {
      const std::string name = entry.path().filename().string();
      CHECK_MESSAGE(folder.read(name) == again.read(name), name);
    }
    const Image image = to_image(train.image(3, 7));
    double coverage = 0, color = 0;
    for (const glm::vec4& pixel : image.pixels) {
      coverage += pixel.a;
      color += pixel.r + pixel.g + pixel.b;
      CHECK(std::max({pixel.r, pixel.g, pixel.b}) <= pixel.a + 0.01F);  // over black
    }
    CHECK(coverage > 50);
    CHECK(color > 0.2 * coverage);
    CHECK(train.voxels(0).count() > 300);
    CHECK(contact_sheet(train).height == 2 * 66);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("data set: a missing class, a damaged file, other shapes") {
    if (is_reduced()) return;
    const TempDir folder;
    make_small(folder.path());
    const std::size_t chair = find_class("chair"), car = find_class("car");
    const auto message = [&](std::size_t c) {
      return message_of<IoError>([&] { Dataset(folder.path(), Split::train, std::span(&c, 1)); });
    };
    CHECK(contains(message(car), "02958343_train_images.npz"));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, Dataset(folder.path(), Split::train, {}), "classes");
    const std::filesystem::path list = ids_file(folder.path(), chair, Split::train);
    std::ofstream(list, std::ios::app) << "03001627/one-more\n";
    CHECK(contains(message(chair), "lists 3 objects, the images are of 2"));
    std::filesystem::remove(list);  // it may be missing
    CHECK_NOTHROW(Dataset(folder.path(), Split::train, std::span(&chair, 1)));
    const std::filesystem::path voxels = voxels_file(folder.path(), chair, Split::train);
    const std::size_t one[] = {1, 32, 32, 32}, flat[] = {2, 32, 32};
    write_npz(voxels, one, std::vector<std::uint8_t>(32768));
    CHECK(contains(message(chair), "1 objects, its images 2"));
    write_npz(voxels, flat, std::vector<std::uint8_t>(2048));
    CHECK(contains(message(chair), "2x32x32, not Nx32x32x32"));
    std::filesystem::resize_file(voxels, 40);
    CHECK(contains(message(chair), "03001627_train_voxels.npz"));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, parse_split("all"), "train, val or test");
  }
}

}  // namespace dpr::test::dataset_test
