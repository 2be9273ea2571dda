// Setup and binning: which triangles are kept, and that no tile which a triangle's blurred area covers is
// missing, by brute force over the pixels.
#include <doctest/doctest.h>

#include <algorithm>
#include <limits>
#include <set>

#include "support/ndc_triangles.hpp"
#include "support/reduced.hpp"
#include "support/variable.hpp"

namespace bin_test {

namespace {

using dpr::test::NdcFrame;
using dpr::test::NdcStages;
using dpr::test::NdcTriangle;
using dpr::test::reduced;

/// (view, tile, face)
using Pair = std::tuple<std::size_t, cl_uint, std::size_t>;

std::set<Pair> listed_pairs(const NdcStages& s) {
  const std::vector<cl_uint> faces = s.bin.pair_face.download(), tiles = s.bin.pair_tile.download();
  const cl_uint tiles_of_view = s.params.tiles_x * s.params.tiles_y;
  std::set<Pair> pairs;
  for (std::size_t i = 0; i < s.bin.pairs; ++i) {
    CHECK(tiles[i] / tiles_of_view == faces[i] / s.params.faces);
    pairs.insert({faces[i] / s.params.faces, tiles[i] % tiles_of_view, faces[i] % s.params.faces});
  }
  CHECK(pairs.size() == s.bin.pairs);  // none twice
  return pairs;
}

/// The pairs with a pixel that the reference gives a fragment.
std::set<Pair> covered_pairs(const NdcFrame& frame, const std::vector<NdcTriangle>& triangles,
                             cl_uint tiles_x) {
  const dpr::reference::RasterizeParameters p = dpr::test::reference_parameters(frame);
  const std::size_t faces = triangles.size() / frame.views;
  std::set<Pair> pairs;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const dpr::reference::NdcTriangle t = dpr::test::to_reference(triangles[i]);
    if (dpr::reference::is_discarded(t, p)) continue;
    for (int row = 0; row < frame.height; ++row) {
      for (int column = 0; column < frame.width; ++column) {
        const auto point = dpr::reference::pixel_center(column, row, {frame.width, frame.height});
        if (!dpr::reference::rasterize_forward(t, i, point, p)) continue;
        const auto tile =
            static_cast<cl_uint>(row / DPR_TILE) * tiles_x + static_cast<cl_uint>(column / DPR_TILE);
        pairs.insert({i / faces, tile, i % faces});
      }
    }
  }
  return pairs;
}

bool includes(const std::set<Pair>& listed, const std::set<Pair>& needed) {
  return std::ranges::includes(listed, needed);
}

std::vector<NdcFrame> frames() {
  std::vector<NdcFrame> all{
      {16, 16, 0.01F}, {22, 12, 0.0F}, {9, 31, 0.3F, true}, {40, 40, 1e-4F, false, false}};
  all.push_back({17, 8, 0.02F, false, true, 1, 100, 2});
  if (dpr::test::is_reduced()) all.resize(2);
  return all;
}

constexpr NdcTriangle k_good{{{-0.5F, -0.5F, 5.0F}, {0.5F, -0.5F, 5.0F}, {0.0F, 0.5F, 5.0F}}};

/// The orientation that setup gives a triangle; 0 where it drops it, and leaves it unwritten.
float orientation(const NdcTriangle& t, const NdcFrame& frame = {}) {
  NdcStages s(frame, {t});
  dpr::shared::Triangle poison{};
  poison.orientation = dpr::test::k_poison;
  s.setup.triangles.upload(dpr::test::device_impl(), std::span(&poison, 1));
  s.set_up();
  const float found = s.setup.triangles.download()[0].orientation;
  const bool is_dropped = s.setup.kept.download()[0] == 0;
  CHECK(is_dropped == std::isnan(found));
  return is_dropped ? 0 : found;
}

NdcTriangle with_depths(float a, float b, float c) {
  NdcTriangle t = k_good;
  t[0].z = a;
  t[1].z = b;
  t[2].z = c;
  return t;
}

NdcTriangle shifted(float x, float y) {
  NdcTriangle t = k_good;
  for (glm::vec3& v : t) v += glm::vec3(x, y, 0);
  return t;
}

/// All that binning leaves.
std::vector<std::vector<cl_uint>> lists_of(const NdcFrame& frame, const std::vector<NdcTriangle>& triangles,
                                           const dpr::Device& device) {
  NdcStages s(frame, triangles, impl_of(device));
  s.list_pairs();
  return {s.bin.pair_starts.download(), s.bin.pair_face.download(), s.bin.pair_tile.download(),
          s.bin.face_pairs.download()};
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("setup: orientation and corners") {
    CHECK(orientation(k_good) == 1.0F);
    NdcTriangle turned = k_good;
    std::swap(turned[1], turned[2]);
    CHECK(orientation(turned) == -1.0F);
    NdcStages s({}, {k_good});
    s.set_up();
    const dpr::shared::Triangle t = s.setup.triangles.download()[0];
    CHECK(t.x0 == k_good[0].x);
    CHECK(t.y0 == k_good[0].y);
    CHECK(t.x1 == k_good[1].x);
    CHECK(t.y2 == k_good[2].y);
    CHECK(t.z2 == k_good[2].z);
    CHECK(t.first_sample == (4U | 4U << 16U));
    CHECK(t.last_sample == (11U | 11U << 16U));
    CHECK(s.bin.pair_starts.download()[0] == 4);
  }

  TEST_CASE("setup: what reaches nearer than znear, or beyond zfar, is dropped") {
    CHECK(orientation(with_depths(1, 5, 5)) == 1.0F);
    CHECK(orientation(with_depths(0.999F, 5, 5)) == 0.0F);
    CHECK(orientation(with_depths(5, 5, -2)) == 0.0F);
    CHECK(orientation(with_depths(5, 100, 100)) == 1.0F);
    CHECK(orientation(with_depths(5, 100.1F, 5)) == 0.0F);
    CHECK(orientation(with_depths(5, 5, std::numeric_limits<float>::infinity())) == 0.0F);
  }

  TEST_CASE("setup: what has no area, is not finite, or misses the image is dropped") {
    const float nan = std::numeric_limits<float>::quiet_NaN(),
                infinity = std::numeric_limits<float>::infinity();
    NdcTriangle flat = k_good;
    flat[2] = 0.5F * (flat[0] + flat[1]);
    CHECK(orientation(flat) == 0.0F);
    NdcTriangle point{k_good[0], k_good[0], k_good[0]};
    CHECK(orientation(point) == 0.0F);
    for (const float bad : {nan, infinity, -infinity}) {
      for (std::size_t vertex = 0; vertex < 3; ++vertex) {
        for (int axis = 0; axis < 3; ++axis) {
          NdcTriangle t = k_good;
          t[vertex][axis] = bad;
          CAPTURE(bad);
          CAPTURE(vertex);
          CAPTURE(axis);
          CHECK(orientation(t) == 0.0F);
        }
      }
    }
    for (const float far : {-3.0F, 3.0F, 1e20F}) {
      CHECK(orientation(shifted(far, 0)) == 0.0F);
      CHECK(orientation(shifted(0, far)) == 0.0F);
    }
    // Within the blur distance of the image it stays.
    NdcFrame blurred;
    blurred.blur_radius = 1.0F;
    CHECK(orientation(shifted(2.0F, 0), blurred) == 1.0F);
  }

  TEST_CASE("bin: no tile that a triangle covers is missing") {
    for (const NdcFrame& frame : frames()) {
      for (const float size : {0.05F, 0.4F, 3.0F}) {
        CAPTURE(frame.width);
        CAPTURE(frame.height);
        CAPTURE(size);
        const auto count = static_cast<std::size_t>(reduced(60, 6)) * frame.views;
        const std::vector<NdcTriangle> triangles = dpr::test::random_triangles(count, size, 11);
        NdcStages s(frame, triangles);
        s.list_pairs();
        const std::set<Pair> listed = listed_pairs(s),
                             needed = covered_pairs(frame, triangles, s.params.tiles_x);
        if (size > 0.1F) CHECK(!needed.empty());
        CHECK(includes(listed, needed));
        // The bound is no bound if every tile is listed for every triangle.
        if (size < 0.1F && frame.blur_radius < 0.1F) {
          CHECK(listed.size() < needed.size() + count * s.params.tiles_x * s.params.tiles_y / 4);
        }
      }
    }
  }

  TEST_CASE("bin: groups that share large triangles list what single work-items do") {
    const dpr::test::Variable one_lane("DPR_LANES", "1");
    const dpr::Device groups = dpr::open_device();
    const NdcFrame frame{150, 90, 0.01F};  // 19x12 tiles
    std::vector<NdcTriangle> triangles;
    for (const float size : {3.0F, 0.05F, 1.0F}) {
      const auto some = dpr::test::random_triangles(static_cast<std::size_t>(reduced(50, 4)), size, 5);
      triangles.insert(triangles.end(), some.begin(), some.end());
    }
    const auto lists = lists_of(frame, triangles, groups);
    CHECK(std::ranges::count_if(lists[0], [](cl_uint tiles) { return tiles >= 64; }) > 1);
    const dpr::test::Variable lanes("DPR_LANES", "8");
    CHECK(lists == lists_of(frame, triangles, dpr::open_device()));
  }

  TEST_CASE("bin: a tile that is missing is found out") {
    const NdcFrame frame{16, 16, 0.01F};
    NdcStages s(frame, {k_good});
    s.list_pairs();
    std::set<Pair> listed = listed_pairs(s);
    const std::set<Pair> needed = covered_pairs(frame, {k_good}, s.params.tiles_x);
    CHECK(includes(listed, needed));
    listed.erase(*needed.begin());
    CHECK_FALSE(includes(listed, needed));
  }

  TEST_CASE(
      "bin: pairs are in tile order, tiles hold theirs by face, faces list theirs by tile, completely") {
    const NdcFrame frame{33, 20, 0.02F, false, true, 1, 100, 2};
    const auto count = static_cast<std::size_t>(reduced(200, 10));
    NdcStages s(frame, dpr::test::random_triangles(2 * count, 0.5F, 4));
    s.list_pairs();
    const std::vector<cl_uint> faces = s.bin.pair_face.download(), tiles = s.bin.pair_tile.download(),
                               face_pairs = s.bin.face_pairs.download(),
                               face_starts = s.bin.pair_starts.download(),
                               tile_starts = s.bin.tile_starts.download();
    CHECK(std::ranges::is_sorted(tiles));
    REQUIRE(face_starts.size() == 2 * count + 1);
    CHECK(face_starts.back() == s.bin.pairs);
    std::size_t wrong = 0;
    for (std::size_t face = 0; face < 2 * count; ++face) {
      for (cl_uint at = face_starts[face]; at < face_starts[face + 1]; ++at) {
        wrong += faces[face_pairs[at]] != face;
        if (at > face_starts[face]) wrong += face_pairs[at] <= face_pairs[at - 1];
      }
    }
    REQUIRE(tile_starts.size() == std::size_t{2} * s.params.tiles_x * s.params.tiles_y + 1);
    CHECK(tile_starts.back() == s.bin.pairs);
    for (std::size_t tile = 0; tile + 1 < tile_starts.size(); ++tile) {
      for (cl_uint pair = tile_starts[tile]; pair < tile_starts[tile + 1]; ++pair) {
        wrong += tiles[pair] != tile;
        if (pair > tile_starts[tile]) wrong += faces[pair] <= faces[pair - 1];
      }
    }
    CHECK(wrong == 0);
  }

  TEST_CASE("bin: no triangle at all, and none that is kept") {
    NdcStages s({}, {shifted(50, 0), with_depths(-1, -1, -1)});
    s.list_pairs();
    CHECK(s.bin.pairs == 0);
    const std::vector<cl_uint> starts = s.bin.tile_starts.download();
    CHECK(starts == std::vector<cl_uint>(s.params.tiles_x * s.params.tiles_y + 1, 0));
  }
}

}  // namespace bin_test
