// Contours: which edges are some, against the faces' sides in double precision; and that they are listed in
// every tile from which a step crosses them, but for those that lie between two lines of samples.
#include <doctest/doctest.h>

#include <algorithm>
#include <map>
#include <set>

#include "dpr/image.hpp"
#include "pipeline/scenes.hpp"
#include "support/contour_frame.hpp"
#include "support/reduced.hpp"

namespace contour_test {

using namespace dpr;
using dpr::test::ContourFrame;
using dpr::test::ends_of;
using dpr::test::reduced;

namespace {

/// A mesh as a camera sees it, in NDC and view depth.
Mesh seen(Mesh mesh, float degrees = 23.0F) {
  const glm::mat4 placed = dpr::test::pipeline::placed(degrees);
  for (glm::vec3& p : mesh.positions) {
    const glm::vec3 v = glm::vec3(placed * glm::vec4(p, 1)) - glm::vec3(0, 0, 4);
    p = {2.1F * v.x / -v.z, 2.1F * v.y / -v.z, -v.z};
  }
  return mesh;
}

using Place = std::pair<float, float>;
/// The ends of an edge in the image, in order.
using Segment = std::pair<Place, Place>;

Segment segment(const glm::vec3& a, const glm::vec3& b) {
  const Place p{a.x, a.y}, q{b.x, b.y};
  return p < q ? Segment{p, q} : Segment{q, p};
}

double side(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
  const glm::dvec3 x(a), y(b), z(c);
  return (y.x - x.x) * (z.y - x.y) - (y.y - x.y) * (z.x - x.x);
}

/// By way of all faces: the edges whose faces lie on one side, and those whose faces have different colours.
struct Expected {
  std::set<Segment> occludes, creases;
};

Expected expected_contours(const Mesh& mesh) {
  std::map<Segment, std::vector<std::size_t>> faces_at;
  const auto corner = [&](std::size_t face, int i) { return mesh.positions[mesh.faces[face][i % 3]]; };
  for (std::size_t face = 0; face < mesh.faces.size(); ++face) {
    for (int i = 0; i < 3; ++i) faces_at[segment(corner(face, i), corner(face, i + 1))].push_back(face);
  }
  Expected expected;
  for (const auto& [ends, faces] : faces_at) {
    std::set<bool> sides;
    std::set<std::tuple<float, float, float>> colors;
    for (const std::size_t face : faces) {
      for (int i = 0; i < 3; ++i) {
        const glm::vec3 a = corner(face, i), b = corner(face, i + 1);
        if (segment(a, b) != ends) continue;
        const bool is_forward = Place{a.x, a.y} < Place{b.x, b.y};
        sides.insert((side(a, b, corner(face, i + 2)) > 0) == is_forward);
      }
      if (mesh.face_colors.empty()) continue;
      const glm::vec3 c = mesh.face_colors[face];
      colors.insert({c.x, c.y, c.z});
    }
    if (sides.size() == 1) {
      expected.occludes.insert(ends);
    } else if (colors.size() > 1) {
      expected.creases.insert(ends);
    }
  }
  return expected;
}

/// Contours that the stage lists, and their tiles.
struct Found {
  std::map<Segment, std::set<cl_uint>> occludes, creases;
  std::size_t pairs = 0;

  static std::set<Segment> keys(const std::map<Segment, std::set<cl_uint>>& map) {
    std::set<Segment> set;
    for (const auto& [key, value] : map) set.insert(key);
    return set;
  }
};

Found found_contours(const ContourFrame& frame, const Mesh& mesh) {
  Found found;
  found.pairs = frame.contour.pairs;
  const std::vector<cl_uint2> edges = frame.edges.edges.download();
  const std::vector<cl_uint> contours = frame.contour.pair_contour.download(),
                             tiles = frame.contour.pair_tile.download();
  for (std::size_t i = 0; i < frame.contour.pairs; ++i) {
    const glm::uvec2 ends = ends_of(edges[contours[i] / DPR_CONTOUR_FLAGS], mesh.faces);
    auto& list = (contours[i] & DPR_CONTOUR_CREASE) != 0 ? found.creases : found.occludes;
    const bool is_new = list[segment(mesh.positions[ends.x], mesh.positions[ends.y])].insert(tiles[i]).second;
    CHECK(is_new);  // one of two edges at the same place stands for both
  }
  return found;
}

Found find(ContourFrame& frame, const Mesh& mesh) {
  frame.contour.forward(frame.inputs());
  return found_contours(frame, mesh);
}

/// True if an edge comes to within so many samples of a line of samples, or crosses one.
bool meets_line(const Segment& ends, const shared::FrameParams& p, double slack) {
  const auto meets = [&](float a, float b, cl_uint size) {
    const double scale = 1 / double{p.pixel_size}, middle = 0.5 * size - 0.5;
    return std::floor(std::min(a, b) * scale + middle - slack) !=
           std::floor(std::max(a, b) * scale + middle + slack);
  };
  return meets(ends.first.first, ends.second.first, p.width) ||
         meets(-ends.first.second, -ends.second.second, p.height);
}

/// Those that cross a line are listed; of the others at most such as rounding could put on one.
void check_listed(const std::set<Segment>& found, const std::set<Segment>& expected,
                  const shared::FrameParams& p) {
  constexpr double k_slack = 0.02;
  for (const Segment& ends : expected) {
    if (meets_line(ends, p, 0)) CHECK(found.contains(ends));
  }
  for (const Segment& ends : found) {
    CHECK(expected.contains(ends));
    CHECK(meets_line(ends, p, k_slack));
  }
}

void check_contours(const Mesh& mesh) {
  const int size = reduced(40, 16);
  ContourFrame frame(mesh, size, size + 5);
  const Found found = find(frame, mesh);
  const Expected expected = expected_contours(mesh);
  CHECK(!expected.occludes.empty());
  check_listed(Found::keys(found.occludes), expected.occludes, frame.p);
  check_listed(Found::keys(found.creases), expected.creases, frame.p);
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("contour: where facing changes, and where colours jump") {
    check_contours(seen(make_icosphere(reduced(3, 1))));
    check_contours(seen(make_torus(0.8F, 0.3F, 12, 7)));
    check_contours(seen(make_cube()));  // on vertices of the sides' own
    Mesh colorful = seen(make_icosphere(1));
    colorful.vertex_colors.clear();
    for (std::size_t f = 0; f < colorful.faces.size(); ++f) {
      colorful.face_colors.emplace_back(static_cast<float>(f % 3), 0.5F, 1.0F);
    }
    check_contours(colorful);
  }

  TEST_CASE("contour: edges take a number for each of their faces, and each face one more") {
    const Mesh mesh = make_icosphere(reduced(3, 1));
    const ContourFrame frame(seen(mesh), 16, 16);
    constexpr std::size_t k_most_padding = 2 * 32 * sizeof(cl_uint2);
    CHECK(frame.edges.count == mesh.faces.size() * 3 / 2);
    CHECK(frame.edges.bytes() <= mesh.faces.size() * 4 * sizeof(cl_uint) + k_most_padding);
    const std::vector<cl_uint2> edges = frame.edges.edges.download();
    const std::vector<cl_uint> of_faces = frame.edges.face_edges.download();
    std::size_t edge = 0;
    for (cl_uint side = 0; side < 3 * mesh.faces.size(); ++side) {
      const cl_uint of_face = of_faces[side / 3];
      if ((of_face >> side % 3 & 1) == 0) continue;
      if (side % 3 == 0 || (of_face & ((1U << side % 3) - 1)) == 0) CHECK(of_face / DPR_FACE_SIDES == edge);
      CHECK(edges[edge++].s[0] == side);
    }
    CHECK(edge == frame.edges.count);
  }

  TEST_CASE("contour: boundaries, and faces that wind the other way") {
    Mesh mesh = seen(make_icosphere(2));
    mesh.faces.resize(mesh.faces.size() / 2);
    check_contours(mesh);
    for (std::size_t f = 0; f < mesh.faces.size(); f += 3) std::swap(mesh.faces[f].x, mesh.faces[f].y);
    check_contours(mesh);
  }

  TEST_CASE("contour: what coincided and has parted is two boundaries") {
    const Mesh cube = seen(make_cube());
    ContourFrame frame(cube, 32, 32);
    Mesh parted = cube;
    for (std::size_t v = 0; v < parted.positions.size(); ++v)
      parted.positions[v].x += 1e-3F * static_cast<float>(v);
    frame.place(parted.positions);
    const Found found = find(frame, parted);
    check_listed(Found::keys(found.occludes), expected_contours(parted).occludes, frame.p);
    CHECK(found.occludes.size() == 24);
  }

  TEST_CASE("contour: flat shading makes an edge of every angle") {
    const Mesh sphere = seen(make_icosphere(1));
    ContourFrame frame(sphere, 32, 32);
    frame.shading = Shading::phong;
    CHECK(find(frame, sphere).creases.empty());
    frame.shading = Shading::flat;
    const Found found = find(frame, sphere);
    std::set<Segment> edges, listed = Found::keys(found.occludes);
    for (const glm::uvec3& f : sphere.faces) {
      for (int i = 0; i < 3; ++i)
        edges.insert(segment(sphere.positions[f[i]], sphere.positions[f[(i + 1) % 3]]));
    }
    listed.merge(Found::keys(found.creases));
    check_listed(listed, edges, frame.p);
    CHECK(listed.size() == edges.size() - 2);  // which lie between two lines
  }

  TEST_CASE("contour: faces before the near plane are not there") {
    Mesh mesh = seen(make_icosphere(2));
    const float limit = 3.6F;
    std::vector<glm::uvec3> kept;
    for (const glm::uvec3& f : mesh.faces) {
      const float nearest = std::min({mesh.positions[f.x].z, mesh.positions[f.y].z, mesh.positions[f.z].z});
      if (nearest >= limit) kept.push_back(f);
    }
    REQUIRE(kept.size() < mesh.faces.size());
    ContourFrame frame(mesh, 32, 32);
    shared::ViewParams camera = frame.views.cameras.download()[0];
    camera.znear = limit;
    frame.views.cameras.upload(dpr::test::device_impl(), std::span(&camera, 1));
    const Found found = find(frame, mesh);
    mesh.faces = kept;
    check_listed(Found::keys(found.occludes), expected_contours(mesh).occludes, frame.p);
  }

  TEST_CASE("contour: listed in every tile with a step that crosses") {
    const Mesh mesh = seen(make_icosphere(reduced(2, 1)));
    const int size = reduced(60, 20);
    ContourFrame frame(mesh, size, size - 7);
    const Found found = find(frame, mesh);
    const double scale = 1 / static_cast<double>(frame.p.pixel_size);
    std::size_t needed = 0;
    for (const auto& [ends, tiles] : found.occludes) {
      // Many points along the edge; a step that it crosses begins left of a point or above it.
      for (int i = 0; i <= 1000; ++i) {
        const double t = i / 1000.0;
        const double x =
            (1 - t) * static_cast<double>(ends.first.first) + t * static_cast<double>(ends.second.first);
        const double y =
            (1 - t) * static_cast<double>(ends.first.second) + t * static_cast<double>(ends.second.second);
        const int column = static_cast<int>(std::floor(x * scale + 0.5 * frame.p.width - 0.5)),
                  row = static_cast<int>(std::floor(0.5 * frame.p.height - 0.5 - y * scale));
        if (column < 0 || row < 0 || column >= static_cast<int>(frame.p.width) ||
            row >= static_cast<int>(frame.p.height))
          continue;
        const auto tile =
            static_cast<cl_uint>(row / DPR_TILE) * frame.p.tiles_x + static_cast<cl_uint>(column / DPR_TILE);
        CHECK(tiles.contains(tile));
        ++needed;
      }
    }
    CHECK(needed > 1000);
    CHECK(found.pairs < found.occludes.size() * 4);  // edges are about a tile long
  }

  TEST_CASE("contour: with too little room there are none, and the count says how much is needed") {
    const Mesh mesh = seen(make_icosphere(2));
    ContourFrame frame(mesh, 32, 32);
    frame.contour.forward(frame.inputs());
    const std::size_t pairs = frame.contour.pairs;
    frame.contour.forward_within(frame.inputs(), pairs - 1, pairs);
    CHECK(frame.contour.pair_starts.download().back() == pairs);
    CHECK(frame.contour.tile_starts.download().back() == 0);
    frame.contour.forward_within(frame.inputs(), pairs + 3, 1);
    CHECK(frame.contour.pair_starts.download().back() == pairs);
    frame.contour.settle(pairs);
    CHECK(frame.contour.tile_starts.download().back() == pairs);
  }
}

}  // namespace contour_test
