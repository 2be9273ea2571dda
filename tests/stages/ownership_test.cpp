// Which triangle owns a sample: every sample of a surface exactly one, also where an edge or a vertex lies on
// it.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "support/integer_rasterizer.hpp"
#include "support/ndc_triangles.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace ownership_test {

using dpr::test::FoundFragments;
using dpr::test::GridPoint;
using dpr::test::GridTriangle;
using dpr::test::NdcFrame;
using dpr::test::NdcStages;
using dpr::test::NdcTriangle;
using dpr::test::RandomFloat;
using dpr::test::reduced;

namespace {

__extension__ typedef __int128 Whole;

/// The device of the tests with another vector width, while this lives.
class WithLanes {
 public:
  explicit WithLanes(unsigned lanes) : before_(dpr::test::device_impl().info.lanes) {
    dpr::test::device_impl().info.lanes = lanes;
  }
  WithLanes(const WithLanes&) = delete;
  WithLanes& operator=(const WithLanes&) = delete;
  ~WithLanes() { dpr::test::device_impl().info.lanes = before_; }

 private:
  unsigned before_;
};

void at_every_width(const std::function<void()>& check) {
  for (const unsigned lanes : {1U, 8U, 16U}) {
    if (dpr::test::is_reduced() && lanes != dpr::test::device_impl().info.lanes) continue;
    CAPTURE(lanes);
    const WithLanes with(lanes);
    check();
  }
}

/// How many triangles own each sample: by the lists where nothing is blurred, else by the distances' signs.
std::vector<int> owners(NdcStages& s) {
  s.forward();
  std::vector<int> count(std::size_t{s.params.width} * s.params.height, 0);
  std::size_t outside = 0;
  for (const auto& [key, fragment] : dpr::test::read_fragments(s).all) {
    if (std::signbit(fragment.distance)) {
      ++outside;
      continue;
    }
    ++count[static_cast<std::size_t>(key.row) * s.params.width + static_cast<std::size_t>(key.column)];
  }
  CHECK((outside > 0) == (s.params.blur_distance > 0));
  return count;
}

/// Samples that not exactly one triangle owns.
std::size_t faults(const NdcFrame& frame, const std::vector<NdcTriangle>& triangles) {
  NdcStages s(frame, triangles);
  const std::vector<int> count = owners(s);
  return static_cast<std::size_t>(std::ranges::count_if(count, [](int n) { return n != 1; }));
}

void check_owned_once(const NdcFrame& frame, const std::vector<NdcTriangle>& triangles) {
  CHECK(faults(frame, triangles) == 0);
  NdcFrame blurred = frame;
  blurred.blur_radius = std::pow(1.0F / static_cast<float>(std::min(frame.width, frame.height)), 2.0F);
  CHECK(faults(blurred, triangles) == 0);
}

NdcTriangle triangle(const glm::vec2& a, const glm::vec2& b, const glm::vec2& c) {
  return {{{a.x, a.y, 5.0F}, {b.x, b.y, 6.0F}, {c.x, c.y, 7.0F}}};
}

/// Both halves of every cell of a grid of points, each cut along either diagonal.
std::vector<NdcTriangle> tessellate(const std::vector<std::vector<glm::vec2>>& rows, RandomFloat& random) {
  std::vector<NdcTriangle> all;
  for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
    for (std::size_t j = 0; j + 1 < rows[i].size(); ++j) {
      const glm::vec2 &a = rows[i][j], &b = rows[i][j + 1], &c = rows[i + 1][j + 1], &d = rows[i + 1][j];
      const bool first = random(0, 1) < 0.5F;
      all.push_back(first ? triangle(a, b, c) : triangle(a, b, d));
      all.push_back(first ? triangle(c, a, d) : triangle(d, b, c));
      for (std::size_t k = all.size() - 2; k < all.size(); ++k) {
        if (random(0, 1) < 0.5F) std::swap(all[k][0], all[k][1]);
      }
    }
  }
  return all;
}

/// A grid that covers the image: points at whole multiples of `step` pixels, moved by `move`.
std::vector<std::vector<glm::vec2>> grid(const NdcFrame& frame, int step,
                                         const std::function<glm::vec2(glm::vec2)>& move) {
  const float pixel = 2.0F / static_cast<float>(std::min(frame.width, frame.height));
  std::vector<std::vector<glm::vec2>> rows;
  for (int row = -step; row <= frame.height + 2 * step; row += step) {
    rows.emplace_back();
    for (int column = -step; column <= frame.width + 2 * step; column += step) {
      const glm::vec2 centre(static_cast<float>(2 * column + 1 - frame.width),
                             static_cast<float>(frame.height - 2 * row - 1));
      rows.back().push_back(move(centre * 0.5F * pixel));
    }
  }
  return rows;
}

float next_float(float x, int steps) {
  for (; steps > 0; --steps) x = std::nextafter(x, 10.0F);
  for (; steps < 0; ++steps) x = std::nextafter(x, -10.0F);
  return x;
}

struct OnGrid {
  std::size_t owned, pairs;
};

/// So many random triangles with vertices on a grid of `step` parts of a pixel, `reach` pixels from their
/// middle at the most, against whole numbers.
OnGrid check_on_grid(int size, int count, int step, glm::vec2 reach, RandomFloat& random) {
  const float side = static_cast<float>(size), parts = static_cast<float>(dpr::test::k_subpixels);
  std::vector<GridTriangle> on_grid;
  std::vector<NdcTriangle> triangles;
  for (int i = 0; i < count; ++i) {
    GridTriangle g;
    NdcTriangle t{};
    const float its_reach = random(reach.x, reach.y);
    const glm::vec2 middle(random(-0.55F, 0.55F) * side, random(-0.55F, 0.55F) * side);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto snapped = [&](float at) {
        return step * std::lround((at + its_reach * random(-1, 1)) * parts / static_cast<float>(step));
      };
      g[k] = {snapped(middle.x), snapped(middle.y)};
      const float scale = 2.0F / (parts * side);
      t[k] = {static_cast<float>(g[k].x) * scale, static_cast<float>(g[k].y) * scale, 5.0F};
    }
    on_grid.push_back(g);
    triangles.push_back(t);
  }
  NdcStages s({size, size}, triangles);
  s.forward();
  const FoundFragments found = dpr::test::read_fragments(s);
  std::size_t differing = 0, owned = 0;
  for (std::size_t f = 0; f < triangles.size(); ++f) {
    for (int row = 0; row < size; ++row) {
      for (int column = 0; column < size; ++column) {
        const bool is_owned = dpr::test::owns(on_grid[f], dpr::test::sample_of(column, row, size, size));
        differing += is_owned != found.all.contains({0, row, column, f});
        owned += is_owned;
      }
    }
  }
  CHECK(differing == 0);
  return {owned, s.bin.pairs};
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("ownership: the sign of an edge function is that of exact arithmetic") {
    const int count = reduced(200'000, 500);
    RandomFloat random(3);
    std::vector<cl_float2> points;
    std::vector<int> expected;
    for (int i = 0; i < count; ++i) {
      // p lies on a -> b but for the last bits, of coordinates of 24 of them.
      const auto bits = [&](float low, float high) {
        return std::ldexp(std::round(std::ldexp(random(low, high), 20)), -20);
      };
      const float scale = std::ldexp(1.0F, static_cast<int>(random(-30, 20)));
      const glm::vec2 a(bits(-4, 4), bits(-4, 4)), b(bits(-4, 4), bits(-4, 4));
      const float along = i % 3 == 0 ? 0.5F : random(-0.5F, 1.5F);
      const glm::vec2 p(next_float(a.x + along * (b.x - a.x), static_cast<int>(random(-2, 3))),
                        next_float(a.y + along * (b.y - a.y), static_cast<int>(random(-2, 3))));
      // Multiples of 2^-24 (a, b) and of 2^-40 or so (p): products of differences fit into 128 bits.
      const auto whole = [](float x) { return static_cast<Whole>(std::ldexp(static_cast<double>(x), 50)); };
      const Whole side = (whole(b.x) - whole(a.x)) * (whole(p.y) - whole(a.y)) -
                         (whole(b.y) - whole(a.y)) * (whole(p.x) - whole(a.x));
      expected.push_back(side > 0 ? 1 : side < 0 ? -1 : 0);
      for (const glm::vec2& v : {a, b, p}) points.push_back({{scale * v.x, scale * v.y}});
    }
    CHECK(std::ranges::count(expected, 0) > count / 100);
    dpr::test::Probe probe({"ownership.h"},
                           "kernel void probe(global const float2* points, global int* side) {\n"
                           "  const size_t i = get_global_id(0);\n"
                           "  side[i] = side_of_line(points[3 * i], points[3 * i + 1], points[3 * i + 2]);\n"
                           "}\n");
    dpr::Buffer<cl_float2> in;
    in.upload(dpr::test::device_impl(), points);
    dpr::Buffer<cl_int> out;
    dpr::test::poison(out, expected.size(), 7);
    probe(expected.size(), in, out);
    const std::vector<cl_int> found = out.download();
    CHECK(std::equal(found.begin(), found.end(), expected.begin()));
  }

  TEST_CASE(
      "ownership: a grid whose vertices are the samples, and a quad whose diagonal passes through them") {
    at_every_width([] {
      for (const int size : {16, 64, 256}) {
        if (size > reduced(256, 16)) continue;
        const NdcFrame frame{size, size};
        RandomFloat random(1);
        for (const int step : {1, 3, 8}) {
          CAPTURE(step);
          check_owned_once(frame, tessellate(grid(frame, step, [](glm::vec2 v) { return v; }), random));
        }
        const glm::vec2 a(-2, -2), b(2, -2), c(2, 2), d(-2, 2);
        check_owned_once(frame, {triangle(a, b, c), triangle(a, c, d)});
        check_owned_once(frame, {triangle(b, d, a), triangle(b, c, d)});
      }
    });
  }

  TEST_CASE("ownership: vertices a few last bits from the samples, images of any shape") {
    at_every_width([] {
      for (const glm::ivec2 size :
           {glm::ivec2(13, 18), glm::ivec2(64, 48), glm::ivec2(37, 53), glm::ivec2(100, 75)}) {
        if (size.x > reduced(100, 13)) continue;
        const NdcFrame frame{size.x, size.y};
        RandomFloat random(static_cast<unsigned>(size.x));
        const auto nudged = [&](glm::vec2 v) {
          const auto steps = [&] { return static_cast<int>(random(-3, 4)); };
          return glm::vec2(next_float(v.x, steps()), next_float(v.y, steps()));
        };
        for (const int step : {1, 2, 7}) {
          check_owned_once(frame, tessellate(grid(frame, step, nudged), random));
        }
      }
    });
  }

  TEST_CASE("ownership: triangles that reach far beyond the image leave no gap between them") {
    at_every_width([] {
      const int size = reduced(96, 24);
      const NdcFrame frame{size, size};
      RandomFloat random(9);
      for (int i = 0; i < reduced(30, 4); ++i) {
        const float extent = std::pow(10.0F, random(0.5F, 6.0F));
        // A fan around a point in the image, with rays that end far away.
        const glm::vec2 centre(random(-1, 1), random(-1, 1));
        std::vector<glm::vec2> rim;
        for (int k = 0; k < 7; ++k) {
          const float angle = 6.2831853F * (static_cast<float>(k) + random(0, 0.5F)) / 7;
          rim.push_back(extent * 2.5F * glm::vec2(std::cos(angle), std::sin(angle)));
        }
        std::vector<NdcTriangle> fan;
        for (std::size_t k = 0; k < rim.size(); ++k)
          fan.push_back(triangle(centre, rim[k], rim[(k + 1) % 7]));
        CAPTURE(extent);
        CHECK(faults(frame, fan) == 0);
      }
    });
  }

  TEST_CASE("ownership: tiny triangles fill an area without a hole") {
    // Each doubled area is 1e-14 NDC^2 or so.
    const NdcFrame frame{17, 17};  // a sample lies at the centre of the image
    RandomFloat random(2);
    std::vector<std::vector<glm::vec2>> rows;
    for (int i = -8; i <= 8; ++i) {
      rows.emplace_back();
      for (int j = -8; j <= 8; ++j) {
        const auto at = [&](int k) { return 1e-7F * (static_cast<float>(k) + random(-0.3F, 0.3F)); };
        rows.back().emplace_back(at(j), at(i));
      }
    }
    NdcStages s(frame, tessellate(rows, random));
    const std::vector<int> count = owners(s);
    for (std::size_t i = 0; i < count.size(); ++i) CHECK(count[i] == (i == count.size() / 2 ? 1 : 0));
  }

  TEST_CASE("ownership: triangles on a grid own what whole numbers say") {
    at_every_width([] {
      const int size = reduced(64, 16);
      RandomFloat random(5);
      for (int round = 0; round < reduced(12, 2); ++round) {
        const int step = round % 2 == 0 ? 8 : 1;  // half pixels, so that samples are hit; or sixteenths
        CHECK(check_on_grid(size, size, step, {1, 0.6F * static_cast<float>(size)}, random).owned > 100);
      }
    });
  }

  TEST_CASE("ownership: triangles of a few samples own what whole numbers say, across tiles too") {
    at_every_width([] {
      const int size = reduced(64, 16);
      RandomFloat random(6);
      for (const int step : {8, 4, 1}) {
        CHECK(check_on_grid(size, 10 * size, step, {0.5F, 3}, random).owned > 100);
      }
    });
  }

  TEST_CASE("ownership: triangles smaller than a pixel are paired with the tile of what they own, or none") {
    at_every_width([] {
      const int size = reduced(64, 16);
      RandomFloat random(7);
      for (const int step : {4, 2, 1}) {
        const OnGrid found = check_on_grid(size, 40 * size, step, {0.4F, 0.45F}, random);
        CHECK(found.owned > 20);
        CHECK(found.pairs == found.owned);
      }
    });
  }
}

}  // namespace ownership_test
