// The shape solver on a small ellipsoid: it finds it, goes on from a checkpoint to the same bits, stops when
// it is told to, takes soup and images without silhouettes, and says what it refuses.
#include "dpr/shape.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "dpr/aov.hpp"
#include "dpr/error.hpp"
#include "dpr/renderer.hpp"
#include "dpr/voxels.hpp"
#include "solve/large_steps.hpp"
#include "solve/shape_space.hpp"
#include "solve/shape_state.hpp"
#include "support/file_size_limit.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/temp_dir.hpp"

namespace shape_test {

namespace {

using dpr::Mesh;
using dpr::ShapeOptions;
using dpr::ShapeResult;
using dpr::ShapeSolver;
using dpr::ShapeViews;
using dpr::test::reduced;
using dpr::test::TempDir;

const glm::vec3 k_place(0.4F, -0.2F, 0.1F);

Mesh ellipsoid() {
  Mesh mesh = dpr::make_icosphere(dpr::test::is_reduced() ? 1 : 3);
  for (glm::vec3& p : mesh.positions) p = k_place + glm::vec3(1.2F, 0.7F, 0.5F) * p;
  mesh.vertex_colors.assign(mesh.positions.size(), glm::vec3(0.9F, 0.4F, 0.1F));
  return mesh;
}

/// A ball to begin with: the views' hull would be nearly the ellipsoid.
Mesh start() {
  Mesh mesh = dpr::make_icosphere(3, 0.8F);
  for (glm::vec3& p : mesh.positions) p += k_place;
  return mesh;
}

/// Rigid renders from all around.
ShapeViews make_views(const dpr::Device& device, int count = reduced(6, 2), int size = reduced(32, 8)) {
  ShapeViews views;
  views.width = views.height = size;
  views.background = glm::vec3(0.1F, 0.2F, 0.3F);
  views.initial = start();
  dpr::Scene scene;
  scene.width = scene.height = size;
  scene.background = views.background;
  scene.meshes.push_back({ellipsoid()});
  scene.smoothing = dpr::rigid_smoothing();
  dpr::Renderer renderer(device);
  for (int i = 0; i < count; ++i) {
    scene.camera = dpr::orbit_camera(4, i % 2 == 0 ? 35.0F : -35.0F,
                                     360.0F * static_cast<float>(i) / static_cast<float>(count), k_place);
    scene.camera.zfar = 8;
    renderer.set_scene(scene);
    renderer.forward();
    views.views.push_back({renderer.image(), scene.camera});
  }
  return views;
}

ShapeOptions small_options() {
  ShapeOptions options;
  options.levels = reduced(2, 1);
  options.iterations = reduced(40, 2);
  options.batch = 3;
  options.remesh_interval = reduced(10, 2);
  options.learning_rate = 0.1;
  options.lambda = 2;  // a mesh this small is stiff
  return options;
}

double error_of(const Mesh& mesh) {
  const dpr::Bounds box{k_place - 1.6F, k_place + 1.6F};
  return 1 - dpr::iou(dpr::voxelize(mesh, 24, box), dpr::voxelize(ellipsoid(), 24, box));
}

struct Measured {
  dpr::Image depth, normal;
};

/// Measurements of a mesh by a perfect sensor.
Measured measured(const dpr::Device& device, const Mesh& mesh, const dpr::Camera& camera) {
  dpr::Scene scene;
  scene.width = scene.height = reduced(32, 8);
  scene.camera = camera;
  scene.meshes.push_back({mesh});
  scene.smoothing = dpr::rigid_smoothing();
  dpr::Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  const dpr::AuxiliaryOutputs outputs = dpr::auxiliary_outputs(renderer);
  return {dpr::aov_image(outputs, dpr::Aov::depth), dpr::aov_image(outputs, dpr::Aov::normal)};
}

/// The mean distance of pixels that show something in both.
double difference(const dpr::Image& a, const dpr::Image& b) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    if (a.pixels[i].w == 0 || b.pixels[i].w == 0) continue;
    sum += static_cast<double>(glm::distance(glm::vec3(a.pixels[i]), glm::vec3(b.pixels[i])));
    ++count;
  }
  return sum / count;
}

bool same(const Mesh& a, const Mesh& b) {
  return a.positions == b.positions && a.faces == b.faces && a.vertex_colors == b.vertex_colors;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("common view: where the axes meet, and for one camera the nearest point to the origin") {
    ShapeViews views;
    views.width = 64, views.height = 32;
    for (const float azimuth : {0.0F, 100.0F, 200.0F})
      views.views.push_back({{}, dpr::orbit_camera(5, 20, azimuth, k_place)});
    const dpr::CommonView common = dpr::common_view(views);
    CHECK(glm::distance(common.centre, glm::dvec3(k_place)) < 1e-5);
    CHECK(common.radius == doctest::Approx(0.5 * 5 * std::tan(glm::radians(30.0))).epsilon(1e-5));
    CHECK(common.pixel == doctest::Approx(5 * std::tan(glm::radians(30.0)) / 16).epsilon(1e-5));
    views.views.resize(1);
    views.views[0].camera = dpr::orbit_camera(5, 0, 0);
    CHECK(glm::length(dpr::common_view(views).centre) < 1e-5);
    views.views[0].camera.znear = 4.5F;  // nearer to the centre than the sphere would reach
    CHECK(dpr::common_view(views).radius == doctest::Approx(0.9 * 0.5));
  }

  TEST_CASE("an initial mesh keeps its colours as those of vertices") {
    Mesh mesh;  // two triangles at an edge, the second twice as large, and one without area
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -2, 0}, {9, 9, 9}};
    mesh.faces = {{0, 1, 2}, {0, 3, 1}, {4, 4, 4}};
    const auto check = [&](const std::vector<glm::vec3>& expected) {
      const Mesh shape = dpr::with_vertex_colors(mesh);
      CHECK(shape.faces == mesh.faces);
      CHECK(shape.textures.empty());
      REQUIRE(shape.vertex_colors.size() == expected.size());
      for (std::size_t v = 0; v < expected.size(); ++v)
        CHECK(glm::distance(shape.vertex_colors[v], expected[v]) < 1e-6F);
    };
    check(std::vector<glm::vec3>(5, glm::vec3(0.5F)));
    mesh.face_colors = {{3, 0, 0}, {0, 3, 0}, {0, 0, 1}};
    check({{1, 2, 0}, {1, 2, 0}, {3, 0, 0}, {0, 3, 0}, {0, 0, 1}});

    // The textures' texels, at the corners' coordinates, times the colours.
    mesh.textures = {{2, 1, {{0.5F, 0, 0}, {1, 0, 0}}, dpr::Wrap::clamp}, {1, 1, {{1, 0.25F, 1}}}};
    mesh.texcoords = {{0, 0}, {1, 1}};
    mesh.face_texcoords = {{0, 1, 0}, {0, 0, 0}, {0, 0, 0}};
    mesh.face_textures = {0, 1, dpr::k_no_texture};
    check({{0.5F, 0.5F, 0}, {1, 0.5F, 0}, {1.5F, 0, 0}, {0, 0.75F, 0}, {0, 0, 1}});
    mesh.face_colors.clear();
    mesh.vertex_colors.assign(5, {2, 2, 2});
    check({{5.0F / 3, 1.0F / 3, 4.0F / 3}, {2, 1.0F / 3, 4.0F / 3}, {1, 0, 0}, {2, 0.5F, 2}, {2, 2, 2}});
  }

  TEST_CASE("large steps solve (I + lambda L) x = b") {
    const Mesh mesh = dpr::make_torus(1, 0.3F, 5, 4);
    const double lambda = 7;
    std::vector<double> b;
    for (std::size_t i = 0; i < 3 * mesh.positions.size(); ++i) b.push_back(std::sin(static_cast<double>(i)));
    const std::vector<double> x = dpr::LargeSteps(mesh, lambda).solve(b);
    std::vector<double> product = x;
    // Every edge of a closed mesh is a side of two faces, once in each direction.
    for (const glm::uvec3& f : mesh.faces) {
      for (int i = 0; i < 3; ++i) {
        const std::size_t from = f[i], to = f[(i + 1) % 3];
        for (std::size_t k = 0; k < 3; ++k)
          product[3 * from + k] += lambda * (x[3 * from + k] - x[3 * to + k]);
      }
    }
    for (std::size_t i = 0; i < b.size(); ++i) CHECK(product[i] == doctest::Approx(b[i]).epsilon(1e-9));
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("a few iterations find most of an ellipsoid, and its colour") {
    const dpr::Device device = dpr::open_device();
    const ShapeSolver solver(device, make_views(device), small_options());
    const ShapeResult result = solver.solve();
    CHECK(result.finished);
    REQUIRE(result.history.size() == solver.most_iterations());
    CHECK(result.mesh.vertex_colors.size() == result.mesh.positions.size());
    if (dpr::test::is_reduced()) return;
    CHECK(result.history.back().loss < 0.35 * result.history.front().loss);
    CHECK(error_of(result.start) > 0.4);
    CHECK(error_of(result.mesh) < 0.2);
    CHECK(result.history.back().smoothing.sigma < result.history.front().smoothing.sigma);
  }

  TEST_CASE("adaptive smoothing finds it too, and stays between a level's beginning and end") {
    const dpr::Device device = dpr::open_device();
    ShapeOptions options = small_options();
    options.schedule = dpr::ShapeSchedule::adaptive;
    const ShapeViews views = make_views(device);
    const ShapeResult result = ShapeSolver(device, views, options).solve();
    const float finest = dpr::finest_smoothing(views, options).sigma;
    const float ratio = (options.blur / options.blur_end) * (options.blur / options.blur_end);
    for (const dpr::ShapeIteration& i : result.history) {
      const float end = i.level + 1 == options.levels ? finest : 4 * finest;
      CHECK(i.smoothing.sigma >= end * 0.999F);
      CHECK(i.smoothing.sigma <= end * ratio * 1.001F);
    }
    if (dpr::test::is_reduced()) return;
    CHECK(error_of(result.mesh) < 0.3);
    CHECK(result.history.back().smoothing.sigma < 0.5F * finest * ratio);  // it has adapted
  }

  TEST_CASE("stopped by the callback and gone on from its checkpoint, a run ends with the same bits") {
    const dpr::Device device = dpr::open_device();
    const ShapeViews views = make_views(device, 2, reduced(16, 8));
    ShapeOptions options = small_options();
    options.levels = 2;
    options.iterations = reduced(8, 2);
    options.remesh_interval = 3;
    options.batch = 1;
    SUBCASE("annealed") {}
    SUBCASE("adaptive") { options.schedule = dpr::ShapeSchedule::adaptive; }
    const ShapeSolver solver(device, views, options);
    const ShapeResult whole = solver.solve();
    const TempDir folder;
    for (const unsigned stop :
         {0U, static_cast<unsigned>(reduced(10, 2))}) {  // first iteration; second level
      const auto file = folder / ("stop" + std::to_string(stop));
      const ShapeResult part =
          solver.solve([&](const dpr::ShapeIteration& i, const Mesh&) { return i.iteration < stop; }, file);
      CHECK_FALSE(part.finished);
      CHECK(part.history.size() == stop + 1);
      const ShapeResult rest = solver.solve({}, file);
      CHECK(rest.finished);
      CHECK(same(rest.mesh, whole.mesh));
      REQUIRE(rest.history.size() == whole.history.size());
      for (std::size_t i = 0; i < whole.history.size(); ++i) {
        CHECK(rest.history[i].loss == whole.history[i].loss);
        const dpr::Smoothing &a = rest.history[i].smoothing, &b = whole.history[i].smoothing;
        CHECK(a.sigma == b.sigma);
        CHECK(a.gamma == b.gamma);
        CHECK(a.samples == b.samples);
        CHECK(a.seed == b.seed);
        CHECK(a.composition == b.composition);
      }
      CHECK(same(solver.solve({}, file).mesh, whole.mesh));  // nothing is left to do
    }
    CHECK(folder.entries() == 2);
  }

  TEST_CASE("soup keeps its faces; images without silhouettes are compared in colour") {
    const dpr::Device device = dpr::open_device();
    ShapeViews views = make_views(device, 2);
    Mesh soup = dpr::make_icosphere(1);
    for (glm::vec3& p : soup.positions) p += k_place;
    const glm::uvec3 face = soup.faces.front();
    soup.faces.emplace_back(face.x, face.y, 20);  // a third face at an edge
    soup.vertex_colors.clear();
    views.initial = soup;
    for (dpr::ShapeView& view : views.views) {
      view.has_alpha = false;
      for (glm::vec4& pixel : view.image.pixels) pixel.a = 1;  // as read_image() leaves it
    }
    ShapeOptions options = small_options();
    options.loss = {.mse = 5};
    options.regularizers = {
        .laplacian = 0.01F, .edge_length = 0.1F, .normal_consistency = 0.01F, .flatness = 0.01F};
    options.steps = dpr::ShapeSteps::direct;
    options.learning_rate = 0.01;
    const ShapeResult result = ShapeSolver(device, views, options).solve();
    CHECK(result.mesh.faces == soup.faces);
    CHECK(result.history.back().mesh_loss > 0);
    if (!dpr::test::is_reduced()) CHECK(error_of(result.mesh) < error_of(result.start));
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("depths and normals of a view find what its colours leave open") {
    if (dpr::test::is_reduced()) return;  // no few pixels and steps show it
    const dpr::Device device = dpr::open_device();
    ShapeViews views = make_views(device, 1);
    Measured target = measured(device, ellipsoid(), views.views[0].camera);
    const auto found = [&](float depth, float normal) {
      ShapeOptions options = small_options();
      options.depth = depth;
      options.normal = normal;
      return measured(device, ShapeSolver(device, views, options).solve().mesh, views.views[0].camera);
    };
    const Measured by_colors = found(1, 1);
    views.views[0].depth = target.depth;
    views.views[0].normal = target.normal;
    const Measured by_depth = found(1, 0), by_normal = found(0, 1);
    MESSAGE("depth off by " << difference(by_colors.depth, target.depth) << ", with depths "
                            << difference(by_depth.depth, target.depth));
    MESSAGE("normals off by " << difference(by_colors.normal, target.normal) << ", with normals "
                              << difference(by_normal.normal, target.normal));
    CHECK(difference(by_depth.depth, target.depth) < 0.3 * difference(by_colors.depth, target.depth));
    CHECK(difference(by_normal.normal, target.normal) < 0.6 * difference(by_colors.normal, target.normal));
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("the shape solver refuses what it cannot use") {
    const dpr::Device device = dpr::open_device();
    const ShapeViews views = make_views(device, 1, 8);
    const auto refuses = [&](auto change_views, auto change_options) {
      ShapeViews wrong = views;
      ShapeOptions options;
      change_views(wrong);
      change_options(options);
      CHECK_THROWS_AS(ShapeSolver(device, wrong, options), dpr::InvalidArgument);
    };
    const auto nothing = [](auto&) {};
    refuses([](ShapeViews& v) { v.views.clear(); }, nothing);
    refuses([](ShapeViews& v) { v.views[0].image = dpr::Image(4, 8); }, nothing);
    refuses([](ShapeViews& v) { v.views[0].camera.view[3][2] = 20; }, nothing);  // the point is behind it
    refuses([](ShapeViews& v) { v.views[0].camera.zfar = 3; }, nothing);         // or beyond what it sees
    refuses([](ShapeViews& v) { v.width = v.height = 0, v.views[0].image = {}; }, nothing);
    refuses([](ShapeViews& v) { v.views[0].image.pixels[3].x = std::numeric_limits<float>::infinity(); },
            nothing);
    refuses([](ShapeViews& v) { v.initial = Mesh{}; }, nothing);
    const auto refuses_initial = [&](auto change) {
      ShapeViews wrong = views;
      for (glm::vec3& p : wrong.initial->positions) p = change(p);
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, ShapeSolver(device, wrong, ShapeOptions()),
                            "initial mesh (shape): got one that no image shows");
    };
    refuses_initial([](glm::vec3 p) { return p + glm::vec3(100, 0, 0); });
    refuses_initial([](glm::vec3) { return k_place; });  // no area
    refuses([](ShapeViews& v) { v.views[0].depth = dpr::Image(4, 8, glm::vec4(1)); }, nothing);
    refuses([](ShapeViews& v) { v.views[0].normal = dpr::Image(8, 8); }, nothing);  // no pixel counts
    refuses([](ShapeViews& v) { v.views[0].depth = dpr::Image(8, 8, glm::vec4(-1)); }, nothing);
    refuses(
        [](ShapeViews& v) {  // one view has depths, the other none
          v.views[0].depth = dpr::Image(8, 8, glm::vec4(1));
          v.views.push_back(v.views[0]);
          v.views[1].depth = {};
        },
        nothing);
    refuses(nothing, [](ShapeOptions& o) { o.depth = -1; });
    refuses(nothing, [](ShapeOptions& o) { o.normal = std::numeric_limits<float>::infinity(); });
    refuses(nothing, [](ShapeOptions& o) { o.levels = 0; });
    refuses(nothing, [](ShapeOptions& o) { o.levels = 5; });              // less than a pixel
    refuses(nothing, [](ShapeOptions& o) { o.iterations = 1U << 31U; });  // more than can be counted
    refuses(nothing, [](ShapeOptions& o) { o.batch = 0; });
    refuses(nothing, [](ShapeOptions& o) { o.blur = 0; });
    refuses(nothing, [](ShapeOptions& o) { o.lambda = -1; });
    refuses(nothing, [](ShapeOptions& o) { o.learning_rate = 0; });
    refuses(nothing, [](ShapeOptions& o) { o.loss = {}; });
    refuses([](ShapeViews& v) { v.views[0].has_alpha = false; },
            [](ShapeOptions& o) { o.loss = {.silhouette = 1}; });
    refuses(nothing, [](ShapeOptions& o) { o.regularizers.laplacian = -1; });
  }

  TEST_CASE("checkpoints that are damaged, cut off, something else, or of another run are refused") {
    const dpr::Device device = dpr::open_device();
    ShapeViews views = make_views(device, 1, 8);
    ShapeOptions options = small_options();
    options.levels = options.iterations = 1;
    const TempDir folder;
    const auto file = folder / "checkpoint";
    ShapeSolver(device, views, options).solve({}, file);
    const std::string good = folder.read("checkpoint");
    const auto solve = [&](const std::string& content, const ShapeOptions& with) {
      folder.write("checkpoint", content);
      return ShapeSolver(device, views, with).solve({}, file);
    };
    CHECK_NOTHROW(solve(good, options));
    CHECK_THROWS_AS(ShapeSolver(device, views, options).solve({}, folder.path()), dpr::IoError);
    CHECK_THROWS_AS(solve("", options), dpr::IoError);
    CHECK_THROWS_AS(solve("not a checkpoint", options), dpr::IoError);
    CHECK_THROWS_AS(solve(good.substr(0, good.size() / 2), options), dpr::IoError);
    for (const std::size_t at : {good.size() / 3, good.size() / 2, good.size() - 5}) {
      std::string damaged = good;
      damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
      CHECK_THROWS_AS(solve(damaged, options), dpr::IoError);
    }
    ShapeOptions other = options;
    other.lambda = 3;
    CHECK_THROWS_AS(solve(good, other), dpr::InvalidArgument);
    views.views[0].image.pixels[0].x += 0.5F;
    CHECK_THROWS_AS(solve(good, options), dpr::InvalidArgument);
    CHECK(folder.read("checkpoint") == good);
  }

  TEST_CASE("checkpoints that were made up, with right checksums, are refused too") {
    const TempDir folder;
    dpr::ShapeState state;
    state.iteration = 1;
    state.faces = {{0, 1, 2}};
    state.positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    state.colors.assign(9, 0.5);
    state.history.resize(1);
    const auto read = [&](const auto& change) {
      dpr::ShapeState changed = state;
      change(changed);
      dpr::write_checkpoint(folder / "checkpoint", changed, 7);
      return dpr::read_checkpoint(folder / "checkpoint", 7, {});
    };
    CHECK(read([](dpr::ShapeState&) {}).positions == state.positions);
    const auto refuses = [&](const auto& change) {
      DPR_CHECK_MESSAGE_HAS(dpr::IoError, read(change), "the checkpoint is damaged");
    };
    refuses([](dpr::ShapeState& s) { s.faces[0].y = 3; });
    refuses([](dpr::ShapeState& s) { s.faces.clear(); });
    refuses([](dpr::ShapeState& s) { s.positions.pop_back(); });
    refuses([](dpr::ShapeState& s) { s.positions[4] = std::numeric_limits<double>::infinity(); });
    refuses([](dpr::ShapeState& s) { s.colors.clear(); });
    refuses([](dpr::ShapeState& s) { s.color_steps.second_moment.assign(9, 0); });
    refuses([](dpr::ShapeState& s) { s.position_steps.first_moment = s.position_steps.second_moment = {1}; });
    refuses([](dpr::ShapeState& s) { s.history.clear(); });

    // A million lists in each other, each of one element.
    const std::string nested(1'000'000, '\x81');
    folder.write("checkpoint", dpr::checkpoint_bytes(nested, 7));
    DPR_CHECK_MESSAGE_HAS(dpr::IoError, dpr::read_checkpoint(folder / "checkpoint", 7, {}), "is damaged");
  }

  TEST_CASE("a checkpoint that finds no room leaves the one before") {
    const TempDir folder;
    folder.write("checkpoint", "before");
    dpr::ShapeState state;
    state.positions.assign(999, 0.5);
    const dpr::test::FileSizeLimit full_disk(100);
    DPR_CHECK_MESSAGE_HAS(dpr::IoError, dpr::write_checkpoint(folder / "checkpoint", state, 7),
                          "File too large");
    CHECK(folder.read("checkpoint") == "before");
    CHECK(folder.entries() == 1);
  }
}

}  // namespace shape_test
