// Scenes whose faces were cut for a lens: images against meshes of small faces and the lens' formula,
// gradients against finite differences of the reference, and those of the same scene uncut.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/directions.hpp"
#include "pipeline/scenes.hpp"
#include "support/reduced.hpp"

namespace lens_subdivision_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

const glm::vec3 k_corner{-1.3F, -1.0F, -1.6F}, k_along{2.7F, 0.1F, -0.3F}, k_up{-0.1F, 2.1F, -0.2F};

/// A wall of so many quads a side, textured.
Mesh wall(unsigned quads) {
  Mesh mesh;
  const auto count = static_cast<float>(quads);
  for (unsigned row = 0; row <= quads; ++row) {
    for (unsigned column = 0; column <= quads; ++column) {
      const glm::vec2 place(static_cast<float>(column) / count, static_cast<float>(row) / count);
      mesh.positions.push_back(k_corner + place.x * k_along + place.y * k_up);
      mesh.texcoords.push_back(0.81F * place + 0.07F);  // no corner of a piece between texels
      mesh.vertex_colors.push_back({1, 0.4F + 0.5F * place.x, 1 - 0.7F * place.y});
    }
  }
  for (unsigned row = 0; row < quads; ++row) {
    for (unsigned column = 0; column < quads; ++column) {
      const unsigned first = row * (quads + 1) + column, above = first + quads + 1;
      mesh.faces.insert(mesh.faces.end(), {{first, first + 1, above + 1}, {first, above + 1, above}});
    }
  }
  mesh.face_texcoords = mesh.faces;
  mesh.textures = {random_texture(5, 4, Wrap::clamp, Filter::bilinear)};
  return mesh;
}

Scene lens_scene(Mesh mesh, int width, int height) {
  Scene scene = scene_of(std::move(mesh), width, height);
  scene.smoothing = Smoothing{};
  scene.meshes[0].transform = glm::mat4(1);
  scene.camera = Camera{};
  const auto focal = 0.62F * static_cast<float>(height);
  scene.camera.intrinsics =
      Intrinsics{focal, 1.02F * focal, 0.49F * static_cast<float>(width), 0.52F * static_cast<float>(height)};
  scene.camera.distortion = Distortion{-0.2F, 0.025F, 0.01F, -0.008F, 0};
  scene.camera.znear = 0.2F;
  scene.camera.zfar = 10;
  return scene;
}

/// The least distance of a pixel's centre from the wall's border, pixels, as the lens' formula has it.
double distance_from_border(const Camera& camera, const glm::dvec2& pixel) {
  constexpr int k_steps = 400;
  const Distortion& d = *camera.distortion;
  const Intrinsics& k = *camera.intrinsics;
  double least = 1e9;
  for (int i = 0; i < 4 * k_steps; ++i) {
    const double along = static_cast<double>(i % k_steps) / k_steps;
    const int side = i / k_steps;
    const glm::dvec2 place = side < 2 ? glm::dvec2(along, side) : glm::dvec2(side - 2, along);
    const glm::dvec3 p = glm::dvec3(k_corner) + place.x * glm::dvec3(k_along) + place.y * glm::dvec3(k_up);
    const double x = p.x / -p.z, y = p.y / p.z, r2 = x * x + y * y;
    const double radial = 1 + r2 * (d.k1 + r2 * double{d.k2});
    const glm::dvec2 shown(x * radial + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x),
                           y * radial + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y);
    least = std::min(least, glm::distance(pixel, glm::dvec2(k.fx, k.fy) * shown + glm::dvec2(k.cx, k.cy)));
  }
  return least;
}

/// How far from the border the silhouettes differ, pixels.
double furthest_difference(const Scene& scene, const Image& a, const Image& b) {
  double furthest = 0;
  for (int row = 0; row < scene.height; ++row) {
    for (int column = 0; column < scene.width; ++column) {
      if (a.at(column, row).w == b.at(column, row).w) continue;
      furthest = std::max(furthest, distance_from_border(scene.camera, {column + 0.5, row + 0.5}));
    }
  }
  return furthest;
}

double mean_difference(const Image& a, const Image& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    sum += static_cast<double>(glm::length(a.pixels[i] - b.pixels[i]));
  return sum / static_cast<double>(a.pixels.size());
}

/// Moves new values, in double precision, as the old ones are.
void move_combined(const Combinations& list, std::size_t channels, const std::vector<double>& way,
                   const std::function<void(std::size_t value, std::size_t channel, double by)>& add) {
  for (std::size_t i = 0; i < list.of.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      for (std::size_t c = 0; c < channels; ++c)
        add(i, c, static_cast<double>(list.weights[i][k]) * way[list.of[i][k] * channels + c]);
    }
  }
}

std::vector<Direction> directions(const MeshSubdivision& how, const MeshGradient& g) {
  using Way = std::vector<double>;
  return {{"positions", flat(g.positions),
           [&how](reference::Scene& s, const Way& way) {
             move_combined(how.vertices, 3, way,
                           [&](auto i, auto c, double by) { s.meshes[0].positions[i][c] += by; });
           }},
          {"colours", flat(g.colors),
           [&how](reference::Scene& s, const Way& way) {
             move_combined(how.vertices, 3, way,
                           [&](auto i, auto c, double by) { s.meshes[0].vertex_colors[i][c] += by; });
           }},
          {"texcoords", flat(g.texcoords), [&how](reference::Scene& s, const Way& way) {
             move_combined(how.texcoords, 2, way, [&](auto i, auto c, double by) {
               (c == 0 ? s.meshes[0].texcoords[i].x : s.meshes[0].texcoords[i].y) += by;
             });
           }}};
}

SceneGradient gradient_of(const Scene& scene, const Image& weights) {
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  renderer.forward();
  return renderer.backward(std::span(&weights, 1));
}

template <typename Vector>
double relative_difference(const std::vector<Vector>& a, const std::vector<Vector>& b) {
  REQUIRE(a.size() == b.size());
  REQUIRE(!a.empty());
  std::vector<double> difference = flat(a), expected = flat(b);
  for (std::size_t i = 0; i < difference.size(); ++i) difference[i] -= expected[i];
  return norm(difference) / norm(expected);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("lens subdivision: two triangles are drawn as many small ones") {
    const int width = reduced(160, 40), height = reduced(120, 30);
    Scene scene = lens_scene(wall(1), width, height),
          dense = lens_scene(wall(reduced(64, 16)), width, height);
    const float pixel = static_cast<float>(width) / 160;
    const Scene cut = subdivide_for_lens(scene, {.tolerance = 0.25F * pixel}).scene;
    CHECK(cut.meshes[0].mesh.faces.size() > 10);
    const double colours = mean_difference(rendered(cut), rendered(dense));
    CHECK(mean_difference(rendered(scene), rendered(dense)) > 20 * colours);
    Scene sharp = cut;
    sharp.smoothing = scene.smoothing = dense.smoothing = smoothing_preset("rigid");
    const Image expected = rendered(dense);
    CHECK(furthest_difference(scene, rendered(sharp), expected) < 0.3 * static_cast<double>(pixel));
    CHECK(furthest_difference(scene, rendered(scene), expected) > 3 * static_cast<double>(pixel));
  }

  TEST_CASE("lens subdivision: faces are named as they were") {
    const Scene scene = lens_scene(wall(1), 40, 30);
    const SubdividedScene cut = subdivide_for_lens(scene);
    Renderer renderer(open_device());
    renderer.set_scene(cut.scene);
    renderer.forward();
    AuxiliaryOutputs outputs = auxiliary_outputs(renderer);
    name_old_faces(scene, cut, outputs);
    CHECK(*std::ranges::max_element(outputs.face_id) == 1);
    const Mesh& mesh = scene.meshes[0].mesh;
    for (std::size_t i = 0; i < outputs.face_id.size(); ++i) {
      if (outputs.face_id[i] < 0) continue;
      const glm::uvec3& face = mesh.face_texcoords[static_cast<std::size_t>(outputs.face_id[i])];
      const glm::vec3& b = outputs.barycentrics[i];
      const glm::vec2 uv =
          b.x * mesh.texcoords[face.x] + b.y * mesh.texcoords[face.y] + b.z * mesh.texcoords[face.z];
      CHECK(glm::distance(uv, outputs.uv[i]) < 1e-4F);
    }
  }

  TEST_CASE("lens subdivision: what shading shows does not depend on it") {
    const int width = reduced(48, 20);
    Scene scene = scene_of(make_icosphere(2), width, reduced(36, 15));
    scene.smoothing = Smoothing{};
    scene.lights = two_lights(Shading::phong);
    scene.meshes[0].transform = placed(35, 0.8F) * glm::mat4(-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1);
    Camera with_lens = scene.camera;
    with_lens.distortion = Distortion{-8, 0, 0, 0, 0};
    const View seen{with_lens, {scene.meshes[0].transform}};
    const SubdividedScene cut =
        subdivide_for_lens(scene, {.tolerance = 4e-4F * static_cast<float>(width)}, std::span(&seen, 1));
    REQUIRE(cut.meshes[0].is_cut());
    // Here through no lens.
    const Image image = rendered(scene);
    const double error = mean_difference(rendered(cut.scene), image);
    CHECK(error < 2e-4);
    Scene faceted = cut.scene;  // with the normals that the pieces' own faces have
    faceted.meshes[0].mesh.normals.clear();
    faceted.meshes[0].mesh.face_normals.clear();
    CHECK(mean_difference(rendered(faceted), image) > 20 * error);
    const Image weights = random_image(scene.width, scene.height, 0, 1);
    const SceneGradient expected = gradient_of(scene, weights);
    const SceneGradient found = pull_back(scene, cut, gradient_of(cut.scene, weights));
    CHECK(found.meshes[0].normals.empty());
    CHECK(relative_difference(found.meshes[0].colors, expected.meshes[0].colors) < 2e-3);
    CHECK(relative_difference(found.meshes[0].positions, expected.meshes[0].positions) < 2e-2);
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("lens subdivision: gradients of the faces that were cut are those of finite differences") {
    Scene scene = lens_scene(wall(1), reduced(24, 12), reduced(18, 9));
    scene.smoothing = scene_of(wall(1), 1, 1).smoothing;  // of the triangles: without jumps
    scene.gradients.texcoords = true;
    const SubdividedScene cut = subdivide_for_lens(scene, {.tolerance = 0.1F});
    REQUIRE(cut.meshes[0].is_cut());
    const Image weights = random_image(scene.width, scene.height, -1, 1);
    const SceneGradient found = pull_back(scene, cut, gradient_of(cut.scene, weights));
    CHECK(found.meshes[0].positions.size() == 4);
    for (const Direction& block : directions(cut.meshes[0], found.meshes[0])) {
      CAPTURE(block.name);
      CHECK(error_along(cut.scene, block, weights, 9) < 1e-3);
    }
  }
}

}  // namespace lens_subdivision_test
