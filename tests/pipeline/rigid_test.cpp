// The rigid member of the family against a z-buffer, and what approaches it.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/reduced.hpp"

using namespace dpr;
using namespace dpr::test::pipeline;
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
}
