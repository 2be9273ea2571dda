// Shapes that silhouettes bound, what a fit makes of them, and their textures.
#include "solve/visual_hull.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "dpr/aov.hpp"
#include "dpr/renderer.hpp"
#include "dpr/voxels.hpp"
#include "support/reduced.hpp"

namespace visual_hull_test {

namespace {

using dpr::Mesh;
using dpr::ShapeViews;
using dpr::test::reduced;

constexpr float k_distance = 3.2F;

Mesh ring() {
  Mesh mesh = dpr::make_torus(0.7F, 0.25F, 32, 16);
  mesh.vertex_colors.assign(mesh.positions.size(), glm::vec3(0.9F, 0.4F, 0.1F));
  return mesh;
}

/// Rigid renders from places on a spiral around the sphere.
ShapeViews views_of(const Mesh& mesh, int count, const std::optional<dpr::Distortion>& lens = {}) {
  const dpr::Device device = dpr::open_device();
  ShapeViews views;
  views.width = views.height = reduced(48, 16);
  dpr::Scene scene;
  scene.width = scene.height = views.width;
  scene.meshes.push_back({mesh});
  scene.smoothing = dpr::rigid_smoothing();
  dpr::Renderer renderer(device);
  for (int i = 0; i < count; ++i) {
    const float height = 0.95F * (1 - (2 * static_cast<float>(i) + 1) / static_cast<float>(count));
    scene.camera =
        dpr::orbit_camera(k_distance, glm::degrees(std::asin(height)), 137.508F * static_cast<float>(i));
    scene.camera.fov_y_degrees = 50;
    scene.camera.zfar = 6;
    scene.camera.distortion = lens;
    renderer.set_scene(scene);
    renderer.forward();
    views.views.push_back({renderer.image(), scene.camera});
  }
  return views;
}

long euler_characteristic(const Mesh& mesh) {
  return static_cast<long>(mesh.positions.size()) - static_cast<long>(mesh.faces.size()) / 2;
}

double overlap(const Mesh& a, const Mesh& b) {
  const dpr::Bounds box{glm::vec3(-1.2F), glm::vec3(1.2F)};
  return dpr::iou(dpr::voxelize(a, 48, box), dpr::voxelize(b, 48, box));
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("a ring's hull has its hole, and a fit keeps it") {
    if (dpr::test::is_reduced()) return;  // no few pixels show it
    const ShapeViews views = views_of(ring(), 12);
    const std::optional<Mesh> hull = dpr::visual_hull(views);
    REQUIRE(hull.has_value());
    CHECK(euler_characteristic(*hull) == 0);
    CHECK(overlap(*hull, ring()) > 0.8);
    dpr::ShapeOptions options;
    options.iterations = 40;
    const dpr::ShapeResult result = dpr::ShapeSolver(dpr::open_device(), views, options).solve();
    CHECK(euler_characteristic(result.mesh) == 0);
    CHECK(overlap(result.mesh, ring()) > 0.93);
  }

  TEST_CASE("a lens bends the lines of sight") {
    if (dpr::test::is_reduced()) return;
    const auto hull_of = [](const ShapeViews& views) {
      const std::optional<Mesh> hull = dpr::visual_hull(views);
      return hull ? overlap(*hull, ring()) : 0;
    };
    ShapeViews views = views_of(ring(), 12, dpr::Distortion{.k1 = -0.8F, .k2 = 0.3F});
    CHECK(hull_of(views) > 0.8);
    for (dpr::ShapeView& view : views.views) view.camera.distortion.reset();
    CHECK(hull_of(views) < 0.75);
    CHECK(hull_of(views_of(ring(), 12, dpr::fisheye(0.1F, 0, 0, 0))) > 0.8);
  }

  TEST_CASE("depths open what silhouettes hide") {
    Mesh bowl = dpr::make_icosphere(4);  // the upper half folded into the lower
    for (glm::vec3& p : bowl.positions) {
      if (p.y > 0) p *= glm::vec3(0.7F, -0.7F, 0.7F);
    }
    ShapeViews views = views_of(bowl, 16);
    const Mesh full = dpr::visual_hull(views).value();
    dpr::Scene scene;
    scene.width = scene.height = views.width;
    scene.meshes.push_back({bowl});
    scene.smoothing = dpr::rigid_smoothing();
    dpr::Renderer renderer(dpr::open_device());
    for (dpr::ShapeView& view : views.views) {
      scene.camera = view.camera;
      renderer.set_scene(scene);
      renderer.forward();
      view.depth = dpr::aov_image(dpr::auxiliary_outputs(renderer), dpr::Aov::depth);
    }
    const Mesh hollow = dpr::visual_hull(views).value();
    CHECK(overlap(full, bowl) < 0.75);
    if (!dpr::test::is_reduced())
      CHECK(overlap(hollow, bowl) > 0.8);  // 0.84 of the cells, a third of which lie at the surface
  }

  TEST_CASE("a texture shows what a shape's vertices are too far apart for") {
    Mesh ball = dpr::make_icosphere(4);
    for (std::size_t i = 0; i < ball.positions.size(); ++i)
      ball.vertex_colors[i] = glm::vec3(std::sin(12 * ball.positions[i].x) > 0 ? 0.9F : 0.1F);
    const ShapeViews views = views_of(ball, reduced(8, 2));
    Mesh coarse = dpr::make_icosphere(2);
    coarse.vertex_colors.assign(coarse.positions.size(), glm::vec3(0.5F));
    std::vector<double> losses;
    const auto find = [&](const ShapeViews& seen) {
      return dpr::find_texture({dpr::open_device()}, seen, coarse, 128, [&](unsigned, double loss) {
        losses.push_back(loss);
        return !dpr::test::is_reduced() || losses.size() < 2;
      });
    };
    const Mesh painted = find(views);
    CHECK(painted.positions == coarse.positions);
    CHECK(painted.vertex_colors.empty());
    REQUIRE(painted.textures.size() == 1);
    for (const glm::vec3& texel : painted.textures[0].texels)
      REQUIRE((texel.x >= 0 && texel.x <= 1 && texel.y >= 0 && texel.y <= 1));
    CHECK(losses.back() < losses.front());
    if (!dpr::test::is_reduced()) CHECK(losses.back() < 0.2 * losses.front());
    ShapeViews unknown = views;
    unknown.views[0].knowledge = dpr::CameraKnowledge::unknown;
    CHECK_THROWS_AS(find(unknown), dpr::InvalidArgument);
  }

  TEST_CASE("a fit begins with a ball where silhouettes do not bound a shape") {
    const dpr::Device device = dpr::open_device();
    const auto begins_with_ball = [&](const ShapeViews& views) {
      return !dpr::visual_hull(views) &&
             dpr::ShapeSolver(device, views).start().faces == dpr::make_icosphere(3).faces;
    };
    ShapeViews views = views_of(ring(), 8);
    CHECK(!begins_with_ball(views));
    SUBCASE("one view leaves its cone open") { views.views.resize(1); }
    SUBCASE("pictures without alpha") {
      for (dpr::ShapeView& view : views.views) view.has_alpha = false;
    }
    SUBCASE("silhouettes that have no point in common") {
      std::ranges::fill(views.views[0].image.pixels, glm::vec4(0));
    }
    SUBCASE("pictures that the object fills") {
      for (dpr::ShapeView& view : views.views) std::ranges::fill(view.image.pixels, glm::vec4(1));
    }
    CHECK(begins_with_ball(views));
  }

  TEST_CASE("a masked pixel says nothing") {
    ShapeViews views = views_of(ring(), 12);
    const double whole = overlap(dpr::visual_hull(views).value(), ring());
    dpr::ShapeView& view = views.views[3];
    view.mask = dpr::Image(views.width, views.height, glm::vec4(1));
    for (int y = 0; y < views.height; ++y) {
      for (int x = 0; x < views.width / 2; ++x) {
        const auto i = static_cast<std::size_t>(y * views.width + x);
        view.image.pixels[i] = glm::vec4(0);  // something stands before it
        view.mask.pixels[i] = glm::vec4(0);
      }
    }
    const std::optional<Mesh> masked = dpr::visual_hull(views);
    REQUIRE(masked.has_value());
    CHECK(overlap(*masked, ring()) > 0.9 * whole);
    view.mask = {};
    const std::optional<Mesh> cut = dpr::visual_hull(views);
    CHECK((!cut || overlap(*cut, ring()) < 0.8 * whole));
  }
}

}  // namespace visual_hull_test
