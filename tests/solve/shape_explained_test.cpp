// Judgement of a shape by its views: coverage, colours, masks, robust losses and views that stand out.
#include "solve/shape_explained.hpp"

#include <doctest/doctest.h>

#include <type_traits>
#include <vector>

#include "dpr/device.hpp"
#include "dpr/error.hpp"
#include "dpr/renderer.hpp"

namespace shape_explained_test {

namespace {

using dpr::Image;
using dpr::ShapeOptions;
using dpr::ShapeViews;
using dpr::ViewExplanation;

/// A red square of so many columns on black.
Image square(int columns, float red = 0.8F) {
  Image image(10, 10);
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < columns; ++x) image.at(x, y) = glm::vec4(red, 0, 0, 1);
  }
  return image;
}

ShapeViews views_of(const std::vector<Image>& images) {
  ShapeViews views;
  views.width = views.height = 10;
  for (const Image& image : images) views.views.push_back({image, {}});
  return views;
}

template <typename Value>
ShapeOptions with(Value ShapeOptions::*member, const std::type_identity_t<Value>& value) {
  ShapeOptions options;
  options.*member = value;
  return options;
}

ViewExplanation explain(const dpr::ShapeView& view, const Image& shown, const ShapeOptions& options = {}) {
  ShapeViews views = views_of({});
  views.views.push_back(view);
  return dpr::explain_views(views, options, {&shown, 1}).front();
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("explained views: coverage and colours, each within the part that may be left") {
    const auto same = explain({square(5), {}}, square(5));
    CHECK(same.explained);
    CHECK(same.iou == 1);
    CHECK(same.unexplained_part == 0);
    const auto narrow = explain({square(5), {}}, square(4));
    CHECK_FALSE(narrow.explained);
    CHECK(narrow.iou.value() == doctest::Approx(0.8));
    CHECK(narrow.unexplained_part == doctest::Approx(0.2).epsilon(1e-3));
    CHECK(explain({square(5), {}}, square(4), with(&ShapeOptions::explained, 0.25F)).explained);
    const auto dim = explain({square(5), {}}, square(5, 0.4F));  // a quarter of the squares is left
    CHECK_FALSE(dim.explained);
    CHECK(dim.iou == 1);
    CHECK(dim.unexplained_part == doctest::Approx(0.25).epsilon(1e-3));
    CHECK(explain({square(5), {}}, square(5, 0.4F), with(&ShapeOptions::loss, {.silhouette = 1})).explained);
    CHECK(explain({square(5), {}}, square(5, 0.4F), with(&ShapeOptions::color_learning_rate, 0.0)).explained);
    Image blurred = square(4, 0), dark = square(5, 0);  // black on black
    for (int y = 0; y < 10; ++y) {
      blurred.at(4, y).a = 0.6F;
      blurred.at(5, y).a = 0.4F;
    }
    CHECK(explain({dark, {}}, blurred).iou == 1);
    CHECK_FALSE(explain({dark, {}}, square(3, 0)).explained);
  }

  TEST_CASE("explained views: no silhouette, a mask, and pictures of nothing") {
    const auto colors_alone = explain({.image = square(5), .camera = {}, .has_alpha = false}, square(1));
    CHECK_FALSE(colors_alone.iou.has_value());
    CHECK_FALSE(colors_alone.explained);
    CHECK_FALSE(explain({.image = square(5), .camera = {}, .has_alpha = false}, square(1),
                        with(&ShapeOptions::color_learning_rate, 0.0))
                    .explained);
    Image mask(10, 10, glm::vec4(1));
    for (int y = 0; y < 10; ++y) mask.at(4, y) = glm::vec4(0);
    CHECK(explain({.image = square(5), .camera = {}, .mask = mask}, square(4)).iou == 1);
    const auto empty = explain({Image(10, 10), {}}, Image(10, 10));
    CHECK(empty.explained);
    CHECK(empty.iou == 1);
    const auto intruder = explain({Image(10, 10), {}}, square(5));
    CHECK_FALSE(intruder.explained);
    CHECK(intruder.iou == 0);
    CHECK(intruder.unexplained_part > 1);
  }

  TEST_CASE("explained views: a robust loss counts what differs by its area") {
    const ShapeOptions robust = with(&ShapeOptions::loss, {.robust = 1, .robust_scale = 0.1F});
    const auto narrow = explain({.image = square(5), .camera = {}, .has_alpha = false}, square(4), robust);
    CHECK(narrow.unexplained_part == doctest::Approx(0.2).epsilon(0.01));
    CHECK(narrow.explained);  // below the square root of a tenth
    CHECK_FALSE(explain({.image = square(5), .camera = {}, .has_alpha = false}, square(3), robust).explained);
  }

  TEST_CASE("explained views: one that leaves far more than the others stands out") {
    const auto is_explained = [](float others, float last) {
      std::vector<Image> shown(5, square(5, 0.8F * (1 - others)));
      shown.push_back(square(5, 0.8F * (1 - last)));
      const std::vector<Image> targets(6, square(5));
      return dpr::explain_views(views_of(targets), ShapeOptions(), shown).back().explained;
    };
    CHECK_FALSE(is_explained(0.05F, 0.2F));  // 0.0025 and 0.04
    CHECK(is_explained(0.1F, 0.2F));         // 0.01
    CHECK(is_explained(0.01F, 0.1F));        // both are little
    CHECK_FALSE(is_explained(0.3F, 0.4F));   // 0.09 and 0.16
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("a shape from true cameras explains their views, and not that of a camera turned by 20 degrees") {
    const dpr::Device device = dpr::open_device();
    ShapeViews views;
    views.width = views.height = 32;
    views.initial = dpr::make_torus(1, 0.3F, 24, 12);
    views.initial->vertex_colors.assign(views.initial->positions.size(), glm::vec3(0.9F, 0.4F, 0.1F));
    dpr::Scene scene;
    scene.width = scene.height = 32;
    scene.meshes.push_back({*views.initial});
    scene.smoothing = dpr::rigid_smoothing();
    dpr::Renderer renderer(device);
    for (int i = 0; i < 3; ++i) {
      scene.camera = dpr::orbit_camera(4, 35, 120 * static_cast<float>(i));
      renderer.set_scene(scene);
      renderer.forward();
      views.views.push_back({renderer.image(), scene.camera});
    }
    views.views[1].camera = dpr::orbit_camera(4, 55, 120);
    ShapeOptions options;
    options.levels = options.iterations = 1;
    options.batch = 2;
    options.remesh_interval = 0;
    options.learning_rate = options.color_learning_rate = 1e-6;
    const dpr::ShapeResult result = dpr::ShapeSolver(device, views, options).solve();
    REQUIRE(result.explanations.size() == 3);
    for (std::size_t i = 0; i < 3; ++i) {
      CAPTURE(i);
      CAPTURE(result.explanations[i].iou.value());
      CAPTURE(result.explanations[i].unexplained_part);
      CHECK(result.explanations[i].explained == (i != 1));
    }
    options.explained = 1;
    CHECK_THROWS_AS(dpr::ShapeSolver(device, views, options), dpr::InvalidArgument);
  }
}

}  // namespace shape_explained_test
