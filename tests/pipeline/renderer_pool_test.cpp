// Renderers that are lent to frames of arrays: which topologies are alike, and what is kept of them.
#include "batch/renderer_pool.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

#include "batch/batch.hpp"
#include "dpr/error.hpp"
#include "pipeline/scenes.hpp"

namespace renderer_pool_test {

using namespace dpr;
using namespace dpr::batch;

namespace {

/// The corners of faces as numbers of some type.
template <class Index>
struct Corners {
  explicit Corners(const Mesh& mesh) {
    for (const glm::uvec3& face : mesh.faces)
      for (int corner = 0; corner < 3; ++corner) indices.push_back(static_cast<Index>(face[corner]));
  }
  NamedArray array() {
    return {"faces",
            indices.data(),
            sizeof(Index) == sizeof(std::int64_t) ? Element::int64 : Element::int32,
            {indices.size() / 3, 3}};
  }
  std::vector<Index> indices;
};

template <class Index>
void check_held() {
  const Mesh mesh = make_icosphere(5);
  Corners<Index> corners(mesh);
  CHECK(holds(corners.array(), mesh.faces));
  for (const std::size_t at : {std::size_t{0}, std::size_t{4096 * 3}, corners.indices.size() - 1}) {
    const Index before = corners.indices[at];
    for (const Index other : {before + 1, before - 1, -before - 1}) {
      corners.indices[at] = static_cast<Index>(other);
      CHECK_FALSE(holds(corners.array(), mesh.faces));
    }
    corners.indices[at] = before;
  }
  CHECK_FALSE(holds(corners.array(), std::span(mesh.faces).first(mesh.faces.size() - 1)));
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("renderer pool: faces are compared with an array of either type where it is") {
    check_held<std::int32_t>();
    check_held<std::int64_t>();
  }

  TEST_CASE("renderer pool: a renderer is lent again to arrays of its topology, and to no other") {
    const Mesh mesh = make_icosphere(1);
    std::vector<glm::vec3> positions = mesh.positions;
    std::vector<float> view{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -4, 0, 0, 0, 1}, intrinsics{16, 16, 8, 8};
    const Device device = open_device();
    const auto pool = std::make_shared<RendererPool>(device);
    const auto bytes_after = [&](const NamedArray& faces, int width) {
      const RenderSettings settings(width, 16);
      const std::vector<NamedArray> arrays{
          {"vertices", positions.data(), Element::float32, {positions.size(), 3}},
          {"views", view.data(), Element::float32, {1, 4, 4}},
          {"intrinsics", intrinsics.data(), Element::float32, {1, 4}},
          faces};
      static_cast<void>(Batch(pool, arrays, {settings}).is_empty());
      return device.allocated_bytes();
    };
    Corners<std::int32_t> narrow(mesh);
    Corners<std::int64_t> wide(mesh);
    static_cast<void>(bytes_after(narrow.array(), 16));
    const std::size_t alone = bytes_after(narrow.array(), 16);
    CHECK(bytes_after(wide.array(), 16) == alone);
    const std::size_t wider = bytes_after(wide.array(), 24);
    CHECK(wider > alone);
    std::swap(wide.indices[0], wide.indices[1]);
    CHECK(bytes_after(wide.array(), 16) > wider);
    CHECK(bytes_after(narrow.array(), 24) > wider);
    pool->clear();
    CHECK(device.allocated_bytes() == 0);
    narrow.indices[4] = -1;
    CHECK_THROWS_AS(bytes_after(narrow.array(), 16), InvalidArgument);
  }
}

}  // namespace renderer_pool_test
