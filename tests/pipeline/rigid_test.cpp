// The rigid member of the family against a z-buffer, and what approaches it.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "check/fragments.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/integer_rasterizer.hpp"
#include "support/reduced.hpp"

namespace rigid_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::GridPoint;
using dpr::test::GridTriangle;
using dpr::test::reduced;

namespace {

struct ZPixel {
  glm::dvec4 color{0.0};
  bool is_certain = true;  ///< no edge within a rounding, no second triangle at the same depth
};

/// Corners in view space and their colours.
struct Corner {
  glm::dvec3 view{0.0};
  glm::dvec3 color{0.0};
};

/// By rays: the pixel's ray against every triangle's plane in view space. Nothing is projected.
ZPixel trace(const std::vector<std::array<Corner, 3>>& triangles, const glm::dvec3& ray,
             const glm::dvec3& background) {
  constexpr double k_edge = 1e-5, k_depth = 1e-5;
  ZPixel pixel;
  pixel.color = glm::dvec4(background, 0.0);
  double nearest = INFINITY;
  for (const std::array<Corner, 3>& t : triangles) {
    const glm::dvec3 &a = t[0].view, &b = t[1].view, &c = t[2].view;
    // Volumes of the ray with the edges; all of one sign inside.
    const glm::dvec3 side(glm::dot(ray, glm::cross(b, c)), glm::dot(ray, glm::cross(c, a)),
                          glm::dot(ray, glm::cross(a, b)));
    const glm::dvec3 edge(glm::length(glm::cross(b, c)), glm::length(glm::cross(c, a)),
                          glm::length(glm::cross(a, b)));
    const double sum = side.x + side.y + side.z;
    const glm::dvec3 weights = side / sum;
    if (weights.x < -1e-3 || weights.y < -1e-3 || weights.z < -1e-3) continue;
    for (int k = 0; k < 3; ++k) {
      if (std::fabs(side[k]) < k_edge * edge[k]) pixel.is_certain = false;
    }
    if (weights.x <= 0 || weights.y <= 0 || weights.z <= 0) continue;
    const double depth = -(weights.x * a.z + weights.y * b.z + weights.z * c.z);
    if (std::fabs(depth - nearest) < k_depth) pixel.is_certain = false;
    if (depth >= nearest) continue;
    nearest = depth;
    pixel.color = glm::dvec4(weights.x * t[0].color + weights.y * t[1].color + weights.z * t[2].color, 1.0);
  }
  return pixel;
}

std::vector<ZPixel> zbuffer(const Scene& scene) {
  std::vector<std::array<Corner, 3>> triangles;
  for (const Instance& instance : scene.meshes) {
    const Mesh& mesh = instance.mesh;
    const glm::dmat4 to_view = glm::dmat4(scene.camera.view) * glm::dmat4(instance.transform);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      std::array<Corner, 3> t;
      for (std::size_t i = 0; i < 3; ++i) {
        const unsigned vertex = mesh.faces[f][static_cast<int>(i)];
        t[i].view = glm::dvec3(to_view * glm::dvec4(mesh.positions[vertex], 1.0));
        t[i].color = mesh.vertex_colors.empty() ? mesh.face_colors[f] : mesh.vertex_colors[vertex];
      }
      triangles.push_back(t);
    }
  }
  std::vector<ZPixel> pixels;
  const double half = std::tan(glm::radians(static_cast<double>(scene.camera.fov_y_degrees)) / 2);
  for (int row = 0; row < scene.height; ++row) {
    for (int column = 0; column < scene.width; ++column) {
      const double x = (column + 0.5 - 0.5 * scene.width) * 2.0 / scene.height * half;
      const double y = (0.5 * scene.height - row - 0.5) * 2.0 / scene.height * half;
      pixels.push_back(trace(triangles, {x, y, -1.0}, scene.background));
    }
  }
  return pixels;
}

struct Comparison {
  double worst = 0;
  std::size_t uncertain = 0, covered = 0;
};

Comparison compare(const Image& found, const std::vector<ZPixel>& expected) {
  Comparison result;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (!expected[i].is_certain) {
      ++result.uncertain;
      continue;
    }
    if (expected[i].color.a > 0) ++result.covered;
    for (int c = 0; c < 4; ++c) {
      const double error = std::fabs(static_cast<double>(found.pixels[i][c]) - expected[i].color[c]);
      if (!(error <= result.worst)) result.worst = error;
    }
  }
  return result;
}

/// A scene whose projection is exact, with its triangles on the image's grid. Depths are eighths between 2
/// and 8. The camera is orthographic for devices that may not divide exactly.
struct GridScene {
  Scene scene;
  std::vector<GridTriangle> triangles;
};

GridScene grid_scene(const Device& device, const std::vector<GridPoint>& points,
                     const std::vector<glm::uvec3>& faces, int size, Random& random) {
  const bool divides = rounds_divisions(impl_of(device));
  GridScene result;
  Scene& scene = result.scene;
  scene.width = scene.height = size;
  scene.camera.view = glm::mat4(1.0F);
  scene.camera.fov_y_degrees = 90;
  if (!divides) scene.camera.orthographic_height = 2.0F;
  scene.smoothing = smoothing_preset("rigid");
  Mesh mesh;
  mesh.faces = faces;
  const float unit = 2.0F / static_cast<float>(dpr::test::k_subpixels * size);
  for (const GridPoint& p : points) {
    const float depth = std::round(random(16, 64)) / 8;
    const float scale = divides ? unit * depth : unit;
    mesh.positions.emplace_back(static_cast<float>(p.x) * scale, static_cast<float>(p.y) * scale, -depth);
  }
  scene.meshes.push_back({std::move(mesh), glm::mat4(1.0F)});
  for (const glm::uvec3& f : faces) result.triangles.push_back({points[f.x], points[f.y], points[f.z]});
  return result;
}

/// Samples of a rigid image against the integer rasterizer.
struct Coverage {
  std::size_t differing = 0;   ///< other triangles than it says, or another alpha than 0 or 1
  std::size_t unbalanced = 0;  ///< not owned by as many triangles from the front as from the back
  std::size_t owned = 0, owned_once = 0, on_edges = 0;
};

Coverage compare_coverage(Renderer& renderer, const GridScene& grid) {
  const int size = grid.scene.width;
  const auto count = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  std::vector<std::size_t> owners(count, 0);
  std::vector<int> sides(count, 0);
  std::vector<bool> on_edge(count, false);
  for (const GridTriangle& t : grid.triangles) {
    const std::int64_t area = dpr::test::cross(t[0], t[1], t[2]);
    // The samples of its bounding box, and a pixel more.
    const auto [left, right] = std::minmax({t[0].x, t[1].x, t[2].x});
    const auto [bottom, top] = std::minmax({t[0].y, t[1].y, t[2].y});
    const auto pixel_of = [&](std::int64_t at) {
      return static_cast<int>(std::clamp<std::int64_t>(at / dpr::test::k_subpixels + size / 2, 0, size));
    };
    for (int row = pixel_of(-top - 16); row < pixel_of(-bottom + 32); ++row) {
      for (int column = pixel_of(left - 16); column < pixel_of(right + 32); ++column) {
        const GridPoint sample = dpr::test::sample_of(column, row, size, size);
        if (!dpr::test::owns(t, sample)) continue;
        const auto pixel = static_cast<std::size_t>(row * size + column);
        ++owners[pixel];
        sides[pixel] += area > 0 ? 1 : -1;
        for (std::size_t k = 0; k < 3; ++k) {
          if (dpr::test::cross(t[k], t[(k + 1) % 3], sample) == 0) on_edge[pixel] = true;
        }
      }
    }
  }
  renderer.set_scene(grid.scene);
  impl_of(renderer).hidden_reach = INFINITY;  // what covers a sample is asked for, not what is seen
  renderer.forward();
  const Image image = renderer.image();
  const std::vector<Pixel> found = pixels_of(renderer);
  Coverage result;
  for (std::size_t i = 0; i < count; ++i) {
    const bool differs = found[i].size() != owners[i] || image.pixels[i].a != (owners[i] > 0 ? 1.0F : 0.0F);
    result.differing += differs ? 1 : 0;
    result.unbalanced += sides[i] != 0 ? 1 : 0;
    result.owned += owners[i] > 0 ? 1 : 0;
    result.owned_once += owners[i] == 1 ? 1 : 0;
    result.on_edges += on_edge[i] ? 1 : 0;
  }
  return result;
}

/// Dents and bumps all over, as an animal has.
Mesh bumpy(Mesh mesh, Random& random) {
  for (glm::vec3& p : mesh.positions) p *= random(0.55F, 1.1F);
  return mesh;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("rigid: the preset equals a z-buffer on cube, torus and two meshes that intersect") {
    const int width = reduced(96, 14), height = reduced(67, 9);
    const Device device = open_device();
    std::vector<std::pair<std::string, Scene>> scenes{
        {"cube", scene_of(make_cube(), width, height)},
        {"torus",
         scene_of(make_torus(1.1F, 0.45F, static_cast<unsigned>(reduced(32, 5)), 12), width, height)}};
    scenes.emplace_back("two", scenes[0].second);
    scenes[2].second.meshes.push_back({make_icosphere(static_cast<unsigned>(reduced(2, 0)), 1.35F),
                                       placed(70.0F, 1.0F, {0.2F, 0.3F, 0.1F})});
    for (auto& named : scenes) {
      const std::string& name = named.first;
      Scene& scene = named.second;
      CAPTURE(name);
      scene.smoothing = smoothing_preset("rigid");
      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.forward();
      const std::vector<ZPixel> expected = zbuffer(scene);
      const Comparison result = compare(renderer.image(), expected);
      CHECK(result.worst < 1e-5);
      CHECK(result.covered > expected.size() / 10);
      CHECK(result.uncertain < expected.size() / 100 + 1);
      MESSAGE(name << ": worst " << result.worst << " over " << expected.size() - result.uncertain
                   << " pixels");
      // A few degrees are seen.
      scene.meshes[0].transform = placed(static_cast<float>(reduced(26, 53)));
      CHECK(compare(renderer.image(), zbuffer(scene)).worst > 1e-5);
    }
  }

  TEST_CASE("rigid: less and less smoothing approaches it in the joint composition") {
    const int size = reduced(48, 9);
    Scene scene = cube_scene(size, size);
    scene.smoothing.composition = Composition::joint;
    const std::vector<ZPixel> expected = zbuffer(scene);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    double last = INFINITY;
    for (const float scale : {1.0F, 0.1F, 0.01F}) {
      Smoothing smoothing = scene.smoothing;
      smoothing.sigma *= scale;
      smoothing.gamma *= scale;
      renderer.set_smoothing(smoothing);
      renderer.forward();
      const Image image = renderer.image();
      double mean = 0;
      for (std::size_t i = 0; i < expected.size(); ++i) {
        mean += glm::length(glm::dvec4(image.pixels[i]) - expected[i].color) /
                static_cast<double>(expected.size());
      }
      CHECK(mean < last);
      last = mean;
    }
    CHECK(last < 0.02);
  }

  TEST_CASE("rigid: no crack along a diagonal, in a grid aligned with the pixels, nor in a frontal cube") {
    const int size = reduced(256, 32);
    const Device device = open_device();
    Renderer renderer(device);
    Random random(40);
    // Vertices at the samples, or at the pixels' corners.
    for (const int shift : {0, 8}) {
      std::vector<GridPoint> points;
      std::vector<glm::uvec3> faces;
      const int cells = size / 2 + 2;
      const auto side = static_cast<unsigned>(cells + 1);
      for (int i = 0; i <= cells; ++i) {
        for (int j = 0; j <= cells; ++j)
          points.push_back({32 * j - 16 * cells + shift, 32 * i - 16 * cells + shift});
      }
      for (unsigned i = 0; i < side - 1; ++i) {
        for (unsigned j = 0; j < side - 1; ++j) {
          const unsigned a = i * side + j;
          faces.insert(faces.end(), {{a, a + 1, a + side + 1}, {a, a + side + 1, a + side}});
        }
      }
      const Coverage grid = compare_coverage(renderer, grid_scene(device, points, faces, size, random));
      CHECK(grid.differing == 0);
      CHECK(grid.owned == static_cast<std::size_t>(size) * static_cast<std::size_t>(size));
      CHECK(grid.owned == grid.owned_once);
    }
    const std::int64_t half = 8 * size / 2;
    const std::vector<GridPoint> corners{{-half, -half}, {half, -half}, {half, half}, {-half, half}};
    const Coverage quad =
        compare_coverage(renderer, grid_scene(device, corners, {{0, 1, 2}, {0, 2, 3}}, size, random));
    CHECK(quad.differing == 0);
    CHECK(quad.owned == static_cast<std::size_t>(size) * static_cast<std::size_t>(size) / 4);

    Scene scene = scene_of(make_cube(), size, size);
    scene.meshes[0].transform = glm::mat4(1.0F);
    scene.camera = orbit_camera(3.0F, 0.0F, 0.0F);
    Mesh& cube = scene.meshes[0].mesh;
    cube.vertex_colors.clear();
    cube.face_colors.clear();
    for (const glm::uvec3& f : cube.faces) {
      const float front = std::min({cube.positions[f.x].z, cube.positions[f.y].z, cube.positions[f.z].z});
      cube.face_colors.push_back(front > 0 ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0));
    }
    for (const char* preset : {"rigid", "nmr"}) {
      CAPTURE(preset);
      scene.smoothing = smoothing_preset(preset);
      renderer.set_scene(scene);
      renderer.forward();
      const Image image = renderer.image();
      std::size_t seen = 0, back = 0;
      for (const glm::vec4& pixel : image.pixels) {
        seen += pixel.a > 0.5F ? 1 : 0;
        back += pixel.r > scene.background.r + 1e-4F ? 1 : 0;
      }
      CHECK(seen > image.pixels.size() / 8);
      CHECK(back == 0);
    }
  }

  TEST_CASE("rigid: closed meshes on the pixel grid cover what an integer rasterizer says") {
    const int size = 64, renders = reduced(1000, 3);
    const Device device = open_device();
    Renderer renderer(device);
    Random random(41);
    const std::array<Mesh, 4> shapes{make_icosphere(2), make_cube(), make_torus(0.8F, 0.4F, 20, 12),
                                     bumpy(make_icosphere(3), random)};
    Coverage all;
    for (int render = 0; render < renders; ++render) {
      const Mesh& shape = shapes[static_cast<std::size_t>(render) % shapes.size()];
      const glm::mat4 pose = placed(random(0, 360), random(0.2F, 1.6F), random.vector(-0.4F, 0.4F));
      const std::int64_t step = render % 3 == 0 ? 1 : 8;  // sixteenths of a pixel, or halves: the samples
      std::vector<GridPoint> points;
      for (const glm::vec3& position : shape.positions) {
        const glm::vec3 p(pose * glm::vec4(position, 1));
        const auto snapped = [&](float x) {
          return step * std::lround(x * static_cast<float>(dpr::test::k_subpixels * size / 2 / step));
        };
        points.push_back({snapped(p.x), snapped(p.y)});
      }
      const Coverage found =
          compare_coverage(renderer, grid_scene(device, points, shape.faces, size, random));
      all.differing += found.differing;
      all.unbalanced += found.unbalanced;
      all.owned += found.owned;
      all.on_edges += found.on_edges;
    }
    CHECK(all.differing == 0);
    CHECK(all.unbalanced == 0);
    CHECK(all.on_edges > all.owned / 50);
    MESSAGE(renders << " renders: " << all.owned << " samples covered, " << all.on_edges
                    << " of them on edges");
  }
}

}  // namespace rigid_test
