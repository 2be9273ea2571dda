// The shape solver on several devices: the bits of one, whoever renders what.
#include <doctest/doctest.h>

#include <algorithm>
#include <vector>

#include "dpr/multi_device.hpp"
#include "dpr/shape.hpp"
#include "pipeline/scenes.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/several_devices.hpp"

namespace shape_devices_test {

using namespace dpr;
using dpr::test::reduced;
using dpr::test::pipeline::random_image;

namespace {

/// Views of noise: with a mask, without a silhouette, or with all of either.
ShapeViews make_views() {
  const int size = reduced(20, 8), count = reduced(7, 2);
  ShapeViews views;
  views.width = views.height = size;
  for (int i = 0; i < count; ++i) {
    Camera camera = orbit_camera(4, i % 2 == 0 ? 30.0F : -20.0F, 50.0F * static_cast<float>(i));
    camera.zfar = 8;
    const auto seed = static_cast<unsigned>(i);
    ShapeView view{random_image(size, size, 0.0F, 1.0F, seed), camera};
    view.has_alpha = i % 3 != 0;
    if (i % 2 == 0) view.mask = random_image(size, size, 0.1F, 1.0F, 50 + seed);
    views.views.push_back(view);
  }
  return views;
}

ShapeOptions make_options() {
  ShapeOptions options;
  options.levels = reduced(2, 1);
  options.iterations = reduced(12, 2);
  options.batch = 4;
  options.remesh_interval = 4;
  options.loss = {.mse = 1, .silhouette = 1, .robust = 2, .robust_scale = 0.2F};
  options.regularizers = {.laplacian = 0.01F, .flatness = 0.02F};
  return options;
}

bool same(const ShapeResult& a, const ShapeResult& b) {
  const auto losses = [](const ShapeResult& result) {
    std::vector<double> all;
    for (const ShapeIteration& step : result.history) {
      all.push_back(step.image_loss);
      all.push_back(step.mesh_loss);
    }
    return all;
  };
  return a.mesh.positions == b.mesh.positions && a.mesh.faces == b.mesh.faces &&
         a.mesh.vertex_colors == b.mesh.vertex_colors && losses(a) == losses(b);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("a fit on two parts of a device is that on two others, and on one part with chunks as large") {
    const Device whole = open_device();
    if (!dpr::test::is_divisible(whole)) return;
    const std::vector<Device> first = split_device(whole, 1), second = split_device(whole, 1);
    const ShapeViews views = make_views();
    ShapeOptions options = make_options();
    SUBCASE("noise of the pixel, annealed") {}
    SUBCASE("sampled, adaptive") { options.schedule = ShapeSchedule::adaptive; }
    ShapeViews given = views;
    if (options.schedule == ShapeSchedule::adaptive) given.smoothing = smoothing_preset("paper_gaussian");
    const ShapeResult two = ShapeSolver({first[0], first[1]}, given, options).solve();
    CHECK(same(two, ShapeSolver({second[1], second[0]}, given, options).solve()));
    CHECK(same(two, ShapeSolver({first[0], first[1], second[0]}, given, options).solve()));
    options.chunk = 1;  // a twelfth of four views, rounded up
    CHECK(same(two, ShapeSolver(first[0], given, options).solve()));
    CHECK(same(two, ShapeSolver(open_device(), given, options).solve()));
    options.chunk = 0;
    const ShapeResult together = ShapeSolver(first[0], given, options).solve();
    options.chunk = 4;
    CHECK(same(together, ShapeSolver({first[0], first[1]}, given, options).solve()));
    REQUIRE(two.history.size() == together.history.size());
    // Later on the last bits matter.
    for (std::size_t i = 0; i < std::min<std::size_t>(two.history.size(), 5); ++i)
      CHECK(two.history[i].loss == doctest::Approx(together.history[i].loss).epsilon(1e-3));
    options.regularizers.laplacian += 1e-3F;
    CHECK_FALSE(same(together, ShapeSolver(first[0], given, options).solve()));
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("the shape solver refuses a list of devices that is none") {
    const ShapeViews views = make_views();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, ShapeSolver(std::vector<Device>{}, views), "devices");
    const Device twice = open_device();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, ShapeSolver({twice, twice}, views), "devices[1]");
  }
}

}  // namespace shape_devices_test
