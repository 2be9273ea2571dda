// Rasterization against the brute-force reference: the set of fragments, their distance, depth and
// barycentrics, the gradients of the corners; and against the tables of tests/data/conformance/rasterizer.
#include <doctest/doctest.h>

#include <algorithm>
#include <bit>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "reference/finite_difference.hpp"
#include "support/data.hpp"
#include "support/ndc_triangles.hpp"
#include "support/reduced.hpp"
#include "support/worst.hpp"

namespace rasterize_test {

namespace {

namespace fs = std::filesystem;
namespace ref = dpr::reference;
using dpr::test::FoundFragment;
using dpr::test::FoundFragments;
using dpr::test::FragmentKey;
using dpr::test::NdcFrame;
using dpr::test::NdcStages;
using dpr::test::NdcTriangle;
using dpr::test::number;
using dpr::test::reduced;
using dpr::test::Worst;

/// A fragment this close to the edge of the criterion may be present or absent.
constexpr double k_criterion = 1e-6;

/// Tolerances, about twice the errors measured. Distance: in the metric's unit, relative above 1,
/// measured 5.2e-7; depth: relative, measured 5.3e-7; barycentrics: absolute, measured 9.6e-7. The last two
/// of triangles lower than 0.1 NDC are taken times their height over 0.1, because the rounding of a corner is
/// divided by the height.
constexpr double k_distance = 1e-6, k_depth = 1.1e-6, k_bary = 2e-6;

struct Frames {
  NdcFrame frame;
  float size;
  unsigned seed;
};

/// Both metrics, both interpolations, images that are not square and no multiple of a tile, several views.
std::vector<Frames> frames() {
  std::vector<Frames> all{{{16, 16, 0.0F}, 0.5F, 1},
                          {{22, 12, 0.02F}, 0.5F, 2},
                          {{12, 22, 0.02F, false, false}, 0.5F, 3},
                          {{17, 31, 0.2F, true}, 0.3F, 4},
                          {{31, 9, 0.05F, true, false}, 2.0F, 5},
                          {{40, 40, 1e-4F}, 0.06F, 6},
                          {{13, 13, 0.5F}, 1.0F, 7},
                          {{19, 10, 0.01F, false, true, 1, 100, 3}, 0.4F, 8},
                          {{1, 1, 0.1F}, 1.0F, 9},
                          {{7, 3, 0.1F, true}, 1.0F, 10}};
  if (dpr::test::is_reduced()) all = {{{9, 5, 0.02F}, 0.5F, 2}, {{5, 9, 0.2F, true, false}, 0.5F, 4}};
  return all;
}

std::vector<NdcTriangle> triangles_of(const Frames& f) {
  return dpr::test::random_triangles(static_cast<std::size_t>(reduced(40, 4)) * f.frame.views, f.size,
                                     f.seed);
}

/// The doubled area over the longest side: what a rounding of a corner is divided by in a barycentric.
double height_of(const ref::NdcTriangle& t) {
  double longest = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const ref::Vec2d side = ref::screen(t[(k + 1) % 3]) - ref::screen(t[k]);
    longest = std::max(longest, std::sqrt(ref::dot(side, side)));
  }
  return std::abs(ref::double_area(t)) / longest;
}

struct Comparison {
  std::size_t missing = 0, surplus = 0, expected = 0;
  Worst distance, depth, bary;
  bool passes() const {
    return missing == 0 && surplus == 0 && distance.error <= k_distance && depth.error <= k_depth &&
           bary.error <= k_bary;
  }
};

void compare_fragment(const FoundFragment& found, const ref::Fragment& wanted, const ref::NdcTriangle& t,
                      const FragmentKey& key, Comparison& c) {
  const auto where = [&](Worst& worst, double error, double have, double want) {
    worst.add(error, "row", key.row, "column", key.column, "face", key.face, "found", have, "wanted", want);
  };
  const double scale = std::min(1.0, height_of(t) / 0.1);
  where(c.distance, std::abs(found.distance - wanted.distance) / std::max(1.0, std::abs(wanted.distance)),
        found.distance, wanted.distance);
  where(c.depth, scale * std::abs(found.depth / wanted.depth - 1), found.depth, wanted.depth);
  where(c.bary, scale * std::abs(found.bary1 - wanted.barycentric.y), found.bary1, wanted.barycentric.y);
  where(c.bary, scale * std::abs(found.bary2 - wanted.barycentric.z), found.bary2, wanted.barycentric.z);
}

/// Every pixel against every triangle.
Comparison compare(const NdcFrame& frame, const std::vector<NdcTriangle>& triangles, FoundFragments found) {
  const ref::RasterizeParameters p = dpr::test::reference_parameters(frame);
  const std::size_t faces = triangles.size() / frame.views;
  Comparison c;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const ref::NdcTriangle t = dpr::test::to_reference(triangles[i]);
    if (ref::is_discarded(t, p)) continue;
    for (int row = 0; row < frame.height; ++row) {
      for (int column = 0; column < frame.width; ++column) {
        const ref::Vec2d point = ref::pixel_center(column, row, {frame.width, frame.height});
        const auto wanted = ref::rasterize_forward(t, i % faces, point, p);
        const FragmentKey key{i / faces, row, column, i % faces};
        const auto at = found.all.find(key);
        if (wanted) ++c.expected;
        const bool borderline = dpr::test::criterion_margin(t, point, p) < k_criterion;
        if (wanted && at != found.all.end()) {
          compare_fragment(at->second, *wanted, t, key, c);
        } else if (wanted && !borderline) {
          ++c.missing;
        } else if (!wanted && at != found.all.end() && !borderline) {
          ++c.surplus;
        }
        if (at != found.all.end()) found.all.erase(at);
      }
    }
  }
  c.surplus += found.all.size();  // of triangles that should have been dropped
  return c;
}

/// Gradients for every fragment.
struct Gradients {
  std::vector<float> distance, depth, bary1, bary2;
};

Gradients random_gradients(const NdcStages& s, const FoundFragments& found, unsigned seed) {
  dpr::test::RandomFloat random(seed);
  Gradients g;
  for (std::vector<float>* values : {&g.distance, &g.depth, &g.bary1, &g.bary2}) {
    values->assign(s.rasterize.fragments, dpr::test::k_poison);
    for (const auto& [key, fragment] : found.all) (*values)[fragment.index] = random(-1, 1);
  }
  return g;
}

std::vector<float> corner_gradients(NdcStages& s, const Gradients& g) {
  dpr::test::poison(s.rasterize.grad_corners, 9 * s.bin.pairs);
  dpr::test::set_planes(s.rasterize.grads, s.params.grad_fragments,
                        {{DPR_PLANE_DISTANCE, g.distance},
                         {DPR_PLANE_DEPTH, g.depth},
                         {DPR_PLANE_BARY, g.bary1},
                         {DPR_PLANE_BARY + 1, g.bary2}});
  s.rasterize.backward(s.params, s.setup.triangles, s.bin);
  return s.rasterize.grad_corners.download();
}

/// The largest error over all pairs, each over the largest gradient that one of its fragments gives.
Worst compare_gradients(const NdcFrame& frame, const std::vector<NdcTriangle>& triangles, NdcStages& s,
                        double distortion) {
  const FoundFragments found = dpr::test::read_fragments(s);
  const Gradients g = random_gradients(s, found, 3);
  const std::vector<float> grad_corners = corner_gradients(s, g);
  const ref::RasterizeParameters p = dpr::test::reference_parameters(frame);
  const std::size_t faces = triangles.size() / frame.views;
  std::vector<double> wanted(grad_corners.size(), 0.0), size(s.bin.pairs, 1e-6);
  std::vector<bool> comparable(s.bin.pairs, true);
  for (const auto& [key, fragment] : found.all) {
    const ref::NdcTriangle t = dpr::test::to_reference(triangles[key.view * faces + key.face]);
    const ref::Vec2d point = ref::pixel_center(key.column, key.row, {frame.width, frame.height});
    const std::size_t i = fragment.index;
    const ref::FragmentGradient grad{
        number(g.distance[i]), number(g.depth[i]), {0.0, number(g.bary1[i]), number(g.bary2[i])}};
    const ref::NdcTriangle corners = ref::rasterize_backward(t, point, p, grad);
    for (std::size_t k = 0; k < 9; ++k) {
      const double value = corners[k / 3][k % 3];
      wanted[9 * fragment.pair + k] += value;
      size[fragment.pair] = std::max(size[fragment.pair], std::abs(value));
    }
    // On the border of the criterion the two may disagree about the side.
    if (dpr::test::criterion_margin(t, point, p) < k_criterion) comparable[fragment.pair] = false;
  }
  Worst worst;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (!comparable[i / 9]) continue;
    worst.add(std::abs(number(grad_corners[i]) * distortion - wanted[i]) / size[i / 9], "pair", i / 9,
              "value", i % 9, "found", grad_corners[i], "wanted", wanted[i]);
  }
  return worst;
}

/// How many fragments a frame has left out or kept in error: left out is what the nearest corner of its
/// triangle puts behind the furthest one of another that covers the sample, by more than the reach.
std::size_t count_wrongly_hidden(const FoundFragments& all, const FoundFragments& seen,
                                 const std::vector<NdcTriangle>& triangles, std::size_t faces, double reach) {
  constexpr double k_rounding = 1e-5;
  const auto corners = [&](const FragmentKey& key) {
    const NdcTriangle& t = triangles[key.view * faces + key.face];
    return std::minmax({number(t[0].z), number(t[1].z), number(t[2].z)});
  };
  std::map<std::tuple<std::size_t, int, int>, double> ends;
  for (const auto& [key, fragment] : all.all) {
    double& end = ends.try_emplace({key.view, key.row, key.column}, INFINITY).first->second;
    end = std::min(end, corners(key).second + reach);
  }
  std::size_t wrong = 0;
  for (const auto& [key, fragment] : all.all) {
    const double beyond = corners(key).first - ends.at({key.view, key.row, key.column});
    if (std::abs(beyond) > k_rounding) wrong += seen.all.contains(key) == (beyond > 0);
  }
  for (const auto& [key, fragment] : seen.all) wrong += !all.all.contains(key);
  return wrong;
}

/// Measured 1.2e-5.
constexpr double k_gradient = 2.4e-5;

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("rasterize: the fragments are the reference's") {
    for (const Frames& f : frames()) {
      CAPTURE(f.seed);
      const std::vector<NdcTriangle> triangles = triangles_of(f);
      NdcStages s(f.frame, triangles);
      s.forward();
      const FoundFragments found = dpr::test::read_fragments(s);
      CHECK(found.misplaced == 0);
      CHECK(found.unordered == 0);
      CHECK(found.all.size() == s.rasterize.fragments);
      const Comparison c = compare(f.frame, triangles, found);
      CHECK(c.expected > 0);
      CHECK(c.missing == 0);
      CHECK(c.surplus == 0);
      DPR_CHECK_WORST(c.distance, k_distance);
      DPR_CHECK_WORST(c.depth, k_depth);
      DPR_CHECK_WORST(c.bary, k_bary);
    }
  }

  TEST_CASE("rasterize: runs follow each other without gaps, and every fragment is listed once") {
    const NdcFrame frame{22, 12, 0.02F};
    NdcStages s(frame, dpr::test::random_triangles(static_cast<std::size_t>(reduced(40, 4)), 0.5F, 2));
    s.forward();
    const std::vector<cl_uint> starts = s.rasterize.fragment_starts.download(),
                               list = s.rasterize.list.download();
    const std::vector<cl_uint2> masks = s.rasterize.masks.download();
    std::vector<int> listed(s.rasterize.fragments, 0);
    for (const cl_uint fragment : list) ++listed.at(fragment);
    CHECK(std::ranges::count(listed, 1) == static_cast<std::ptrdiff_t>(listed.size()));
    std::size_t wrong = 0;
    for (std::size_t pair = 0; pair < s.bin.pairs; ++pair) {
      const auto count =
          static_cast<cl_uint>(std::popcount(masks[pair].s[0]) + std::popcount(masks[pair].s[1]));
      wrong += starts[pair + 1] - starts[pair] != count;
    }
    CHECK(wrong == 0);
  }

  TEST_CASE("rasterize: coincident triangles are listed each, in face order") {
    const NdcTriangle t{{{-0.5F, -0.5F, 5.0F}, {0.5F, -0.5F, 5.0F}, {0.0F, 0.5F, 5.0F}}};
    NdcStages s({10, 10}, {t, t, t});
    s.forward();
    const FoundFragments found = dpr::test::read_fragments(s);
    CHECK(found.unordered == 0);
    CHECK(found.all.size() % 3 == 0);
    CHECK(compare({10, 10}, {t, t, t}, found).passes());
  }

  TEST_CASE("rasterize: what lies far enough behind another triangle is left out, and nothing else") {
    const NdcFrame frame{22, 12, 0.0F, false, true, 1, 100, static_cast<std::size_t>(reduced(3, 1))};
    std::vector<NdcTriangle> triangles =
        dpr::test::random_triangles(frame.views * static_cast<std::size_t>(reduced(40, 24)), 0.5F, 2);
    for (NdcTriangle& t : triangles) t[1].z = 0.05F * t[1].z + 0.95F * t[0].z;
    for (NdcTriangle& t : triangles) t[2].z = 0.05F * t[2].z + 0.95F * t[0].z;
    for (const float reach : {0.0F, 0.01F, 0.03F}) {
      NdcStages whole(frame, triangles), s(frame, triangles);
      whole.forward();
      s.hide(reach);
      s.forward();
      const FoundFragments all = dpr::test::read_fragments(whole), seen = dpr::test::read_fragments(s);
      CHECK(seen.misplaced == 0);
      CHECK(seen.all.size() == s.rasterize.fragments);
      CHECK(seen.all.size() < all.all.size());
      const auto count = [&](double of) {
        return count_wrongly_hidden(all, seen, triangles, s.params.faces, of * 99);
      };
      CHECK(count(number(reach)) == 0);
      CHECK(count(number(reach) + 0.1) > 0);
      const std::vector<cl_uint2> masks = s.rasterize.masks.download();
      const std::vector<cl_uint> listed = s.bin.face_pairs.download(), places = s.bin.places.download();
      for (std::size_t pair = 0; pair < s.bin.pairs; ++pair) {
        const bool is_seen = masks[pair].s[0] != 0 || masks[pair].s[1] != 0;
        if (is_seen) CHECK(listed[places[pair]] == pair);
        if (listed[places[pair]] == DPR_NO_PAIR) CHECK_FALSE(is_seen);
      }
      CHECK(std::ranges::count(listed, DPR_NO_PAIR) > 0);
    }
  }

  TEST_CASE("rasterize: nothing to rasterize leaves empty lists") {
    const NdcTriangle far{{{50.0F, 50.0F, 5.0F}, {51.0F, 50.0F, 5.0F}, {50.0F, 51.0F, 5.0F}}};
    NdcStages s({9, 5}, {far});
    s.list_pairs();
    s.rasterize.forward(s.params, s.setup.triangles, s.bin);
    CHECK(s.rasterize.fragments == 0);
    CHECK(s.rasterize.pixel_starts.download() == std::vector<cl_uint>(46, 0));
  }

  TEST_CASE("rasterize: a fragment that is missing, surplus, moved or of another depth is found out") {
    const NdcFrame frame{12, 9, 0.02F};
    const std::vector<NdcTriangle> triangles = dpr::test::random_triangles(4, 0.8F, 5);
    NdcStages s(frame, triangles);
    s.forward();
    const FoundFragments good = dpr::test::read_fragments(s);
    REQUIRE(!good.all.empty());
    CHECK(compare(frame, triangles, good).passes());
    FoundFragments bad = good;
    bad.all.erase(bad.all.begin());
    CHECK(compare(frame, triangles, bad).missing == 1);
    bad = good;
    bad.all.emplace(FragmentKey{0, 100, 100, 0}, FoundFragment{});
    CHECK(compare(frame, triangles, bad).surplus == 1);
    for (double FoundFragment::*field :
         {&FoundFragment::distance, &FoundFragment::depth, &FoundFragment::bary1, &FoundFragment::bary2}) {
      bad = good;
      for (auto& [key, fragment] : bad.all) fragment.*field += 0.01;
      CHECK_FALSE(compare(frame, triangles, bad).passes());
      bad.all.begin()->second.*field = number(dpr::test::k_poison);
      CHECK_FALSE(compare(frame, triangles, bad).passes());
    }
  }

  TEST_CASE("rasterize: the tables of the conformance folder") {
    for (const fs::path& path :
         dpr::test::files_in(dpr::test::data_folder() / "conformance/rasterizer", ".json")) {
      CAPTURE(path.filename().string());
      const nlohmann::json table = nlohmann::json::parse(std::ifstream(path));
      NdcFrame frame{table["width"], table["height"], table["blur_radius"].get<float>()};
      frame.perspective_correct = table["perspective_correct"];
      const bool clipped = table["clip_barycentric"];
      std::vector<NdcTriangle> triangles;
      for (const auto& face : table["faces"]) {
        NdcTriangle t{};
        for (std::size_t k = 0; k < 3; ++k) {
          const auto& v = table["vertices"][face[k].get<std::size_t>()];
          t[k] = glm::vec3(v[0].get<float>(), v[1].get<float>(), v[2].get<float>());
        }
        triangles.push_back(t);
      }
      NdcStages s(frame, triangles);
      s.forward();
      FoundFragments found = dpr::test::read_fragments(s);
      const ref::RasterizeParameters p = dpr::test::reference_parameters(frame);
      const auto is_borderline = [&](const FragmentKey& key) {
        const ref::Vec2d point = ref::pixel_center(key.column, key.row, {frame.width, frame.height});
        return dpr::test::criterion_margin(dpr::test::to_reference(triangles[key.face]), point, p) <
               k_criterion;
      };
      Worst distance, depth, bary;
      std::size_t missing = 0, surplus = 0;
      for (const auto& row : table["fragments"]) {
        const FragmentKey key{0, row[0], row[1], row[2].get<std::size_t>()};
        const auto at = found.all.find(key);
        if (at == found.all.end()) {
          missing += is_borderline(key) ? 0 : 1;
          continue;
        }
        const FoundFragment fragment = at->second;
        found.all.erase(at);
        const double want = row[4];
        distance.add(std::abs(fragment.distance - want) / std::max(1.0, std::abs(want)), "row", key.row,
                     "column", key.column, "face", key.face, "found", fragment.distance, "wanted", want);
        if (row[3].is_null() || !clipped) continue;
        depth.add(std::abs(fragment.depth / row[3].get<double>() - 1), "row", key.row, "column", key.column);
        bary.add(std::abs(fragment.bary1 - row[6].get<double>()), "row", key.row, "column", key.column);
        bary.add(std::abs(fragment.bary2 - row[7].get<double>()), "row", key.row, "column", key.column);
      }
      for (const auto& [key, fragment] : found.all) surplus += is_borderline(key) ? 0 : 1;
      CHECK(missing == 0);
      CHECK(surplus == 0);
      DPR_CHECK_WORST(distance, 1e-6);  // the tolerances of the folder's README
      DPR_CHECK_WORST(depth, 1e-4);
      DPR_CHECK_WORST(bary, 1e-4);
    }
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("rasterize: gradients of the corners are the reference's") {
    for (const Frames& f : frames()) {
      CAPTURE(f.seed);
      const std::vector<NdcTriangle> triangles = triangles_of(f);
      NdcStages s(f.frame, triangles);
      s.forward();
      DPR_CHECK_WORST(compare_gradients(f.frame, triangles, s, 1), k_gradient);
      CHECK(compare_gradients(f.frame, triangles, s, 1.02).error > k_gradient);
    }
  }

  TEST_CASE("rasterize: the gradient of one triangle against finite differences of the reference") {
    for (const bool euclidean : {false, true}) {
      for (const bool perspective : {false, true}) {
        CAPTURE(euclidean);
        CAPTURE(perspective);
        const NdcFrame frame{8, 8, 0.05F, euclidean, perspective};
        const NdcTriangle t{{{-0.61F, -0.43F, 3.0F}, {0.52F, -0.37F, 5.0F}, {0.07F, 0.66F, 4.0F}}};
        NdcStages s(frame, {t});
        s.forward();
        REQUIRE(s.bin.pairs == 1);
        const FoundFragments found = dpr::test::read_fragments(s);
        const Gradients g = random_gradients(s, found, 8);
        const std::vector<float> corners = corner_gradients(s, g);
        const ref::RasterizeParameters p = dpr::test::reference_parameters(frame);
        ref::RasterizeParameters unlimited = p;  // the fragments stay while the triangle moves
        unlimited.blur_radius = 100;
        const auto loss = [&](const std::vector<double>& at) {
          const ref::NdcTriangle moved{{{at[0], at[1], at[2]}, {at[3], at[4], at[5]}, {at[6], at[7], at[8]}}};
          double sum = 0;
          for (const auto& [key, fragment] : found.all) {
            const ref::Vec2d point = ref::pixel_center(key.column, key.row, {frame.width, frame.height});
            const auto value = ref::rasterize_forward(moved, 0, point, unlimited);
            const std::size_t i = fragment.index;
            sum += number(g.distance[i]) * value->distance + number(g.depth[i]) * value->depth +
                   number(g.bary1[i]) * value->barycentric.y + number(g.bary2[i]) * value->barycentric.z;
          }
          return sum;
        };
        std::vector<double> at, gradient;
        for (std::size_t k = 0; k < 9; ++k) {
          at.push_back(number(t[k / 3][static_cast<int>(k % 3)]));
          gradient.push_back(number(corners[k]));
        }
        const ref::GradientCheck check = ref::check_gradient(loss, at, gradient, 1e-6, 1e-5);
        CAPTURE(check.error);
        CAPTURE(check.worst);
        CHECK(check.passed);
        gradient[0] *= 1.01;
        CHECK_FALSE(ref::check_gradient(loss, at, gradient, 1e-6, 1e-5).passed);
      }
    }
  }
}

}  // namespace rasterize_test
