// The shape solver with cameras that are off: it moves them to where they belong, and with them comes the shape.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "dpr/error.hpp"
#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "dpr/shape.hpp"
#include "dpr/voxels.hpp"
#include "solve/shape_cameras.hpp"
#include "solve/shape_state.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/temp_dir.hpp"

namespace shape_cameras_test {

namespace {

using dpr::Mesh;
using dpr::ShapeOptions;
using dpr::ShapeResult;
using dpr::ShapeSolver;
using dpr::ShapeViews;
using dpr::test::reduced;

/// A box, unlike from every side, in colours that differ from place to place.
Mesh box() {
  Mesh mesh = dpr::make_icosphere(dpr::test::is_reduced() ? 1 : 4);
  mesh.vertex_colors.clear();
  for (glm::vec3& p : mesh.positions) {
    const glm::vec3 size = glm::abs(p);
    mesh.vertex_colors.push_back(0.5F + 0.4F * glm::sin(glm::vec3(5, 4, 6) * p));
    p *= glm::vec3(0.8F, 0.5F, 0.3F) / std::max({size.x, size.y, size.z});
  }
  return mesh;
}

struct Problem {
  ShapeViews views;
  std::vector<dpr::Camera> truth;
};

/// Rigid renders from all around; then the cameras are turned about the object by so many degrees and moved by so many
/// parts of their distance, in the mean over the views not at all.
Problem make_problem(const dpr::Device& device, double degrees, double part) {
  constexpr float k_distance = 3;
  const int size = reduced(64, 8), count = reduced(12, 2);
  Problem problem;
  ShapeViews& views = problem.views;
  views.width = views.height = size;
  dpr::Scene scene;
  scene.width = scene.height = size;
  scene.meshes.push_back({box()});
  scene.smoothing = dpr::rigid_smoothing();
  dpr::Renderer renderer(device);
  for (int i = 0; i < count; ++i) {
    scene.camera = dpr::orbit_camera(k_distance, 25.0F * static_cast<float>(i % 5 - 2),
                                     360.0F * static_cast<float>(i) / static_cast<float>(count));
    renderer.set_scene(scene);
    renderer.forward();
    views.views.push_back({renderer.image(), scene.camera});
    problem.truth.push_back(scene.camera);
  }
  std::mt19937_64 generator(3);
  std::normal_distribution<double> normal;
  const auto errors = [&](double deviation) {
    std::vector<glm::dvec3> list(views.views.size());
    glm::dvec3 mean(0.0);
    for (glm::dvec3& error : list) {
      for (int k = 0; k < 3; ++k) error[k] = deviation / std::sqrt(3.0) * normal(generator);
      mean += error / static_cast<double>(list.size());
    }
    for (glm::dvec3& error : list) error -= mean;
    return list;
  };
  const auto turns = errors(glm::radians(degrees)), shifts = errors(part * static_cast<double>(k_distance));
  for (std::size_t i = 0; i < views.views.size(); ++i) {
    glm::dmat4 error(dpr::rotation_from_vector(turns[i]));
    error[3] = glm::dvec4(shifts[i], 1.0);
    views.views[i].camera.view = glm::mat4(glm::dmat4(problem.truth[i].view) * error);
  }
  return problem;
}

/// Root mean square distance, over the views, between where a camera and the true one see the corners of a cube.
double error_of(const std::vector<dpr::Camera>& cameras, const std::vector<dpr::Camera>& truth) {
  double sum = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    for (unsigned corner = 0; corner < 8; ++corner) {
      const glm::dvec4 p((corner & 1U) != 0 ? 0.5 : -0.5, (corner & 2U) != 0 ? 0.5 : -0.5,
                         (corner & 4U) != 0 ? 0.5 : -0.5, 1.0);
      const glm::dvec4 a = glm::dmat4(cameras[i].view) * p, b = glm::dmat4(truth[i].view) * p;
      const glm::dvec2 difference = glm::dvec2(a) / a.z - glm::dvec2(b) / b.z;
      sum += glm::dot(difference, difference);
    }
  }
  return std::sqrt(sum / (8.0 * static_cast<double>(truth.size())));
}

std::vector<dpr::Camera> given(const ShapeViews& views) { return dpr::moved_cameras(views, {}); }

ShapeOptions options_for(bool refines) {
  ShapeOptions options;
  options.iterations = reduced(120, 4);
  options.levels = reduced(2, 1);
  options.batch = reduced(6, 1);
  options.remesh_interval = reduced(20, 2);
  options.refine_cameras = refines;
  return options;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("cameras that are off by 1.5 degrees and 3% are found, and most of the shape that they cost") {
    if (dpr::test::is_reduced()) return;  // no few pixels and steps show it
    const dpr::Device device = dpr::open_device();
    const Problem problem = make_problem(device, 1.5, 0.03);
    const dpr::Bounds bounds{glm::vec3(-1), glm::vec3(1)};
    const dpr::VoxelGrid truth = dpr::voxelize(box(), 48, bounds);
    const auto overlap = [&](const ShapeResult& result) {
      return dpr::iou(dpr::voxelize(result.mesh, 48, bounds), truth);
    };
    const ShapeResult fixed = ShapeSolver(device, problem.views, options_for(false)).solve();
    const ShapeResult refined = ShapeSolver(device, problem.views, options_for(true)).solve();
    const double before = error_of(given(problem.views), problem.truth);
    MESSAGE("IoU " << overlap(fixed) << ", refined " << overlap(refined) << "; cameras off by " << before
                   << ", refined " << error_of(refined.cameras, problem.truth));
    CHECK(fixed.cameras.front().view == problem.views.views.front().camera.view);
    CHECK(error_of(refined.cameras, problem.truth) < 0.4 * before);
    CHECK(1 - overlap(refined) < 0.6 * (1 - overlap(fixed)));
    CHECK(refined.history.back().loss < 0.7 * fixed.history.back().loss);
  }

  TEST_CASE("stopped while cameras move and gone on from its checkpoint, a run ends with the same bits") {
    const dpr::Device device = dpr::open_device();
    const Problem problem = make_problem(device, 0.7, 0.01);
    ShapeOptions options = options_for(true);
    options.iterations = reduced(12, 4);
    const ShapeSolver solver(device, problem.views, options);
    const ShapeResult whole = solver.solve();
    CHECK(whole.cameras.front().view != problem.views.views.front().camera.view);
    const dpr::test::TempDir folder;
    const unsigned stop = options.iterations * options.levels - 2;
    const auto file = folder / "checkpoint";
    solver.solve([&](const dpr::ShapeIteration& i, const Mesh&) { return i.iteration < stop; }, file);
    const ShapeResult rest = solver.solve({}, file);
    CHECK(rest.finished);
    CHECK(rest.mesh.positions == whole.mesh.positions);
    for (std::size_t i = 0; i < whole.cameras.size(); ++i) {
      CAPTURE(i);
      CHECK(rest.cameras[i].view == whole.cameras[i].view);
    }
    options.camera_learning_rate *= 2;
    CHECK_THROWS_AS(ShapeSolver(device, problem.views, options).solve({}, file), dpr::InvalidArgument);
  }
}

TEST_SUITE("unit") {
  TEST_CASE("a step turns a camera about the common centre and moves it by radii, however far it stands") {
    ShapeViews views;
    views.width = views.height = 8;
    const glm::vec3 centre(1, 2, 3);
    for (const float azimuth : {0.0F, 90.0F})
      views.views.push_back({{}, dpr::orbit_camera(5, 20, azimuth, centre)});
    const dpr::CommonView common{.centre = glm::dvec3(centre), .radius = 2};
    const std::vector<dpr::ShapeState::MovedCamera> before = dpr::unmoved_cameras(views);
    std::vector<dpr::ShapeState::MovedCamera> cameras = before;
    dpr::ViewGradient gradient;
    const glm::dvec3 about = before[1].view * glm::dvec4(common.centre, 1.0);
    gradient.camera.view.translation = glm::dvec3(0, 0, 4);
    gradient.camera.view.rotation =
        glm::cross(about - glm::dvec3(before[1].view[3]), gradient.camera.view.translation);  // at the centre
    const std::size_t second = 1;
    dpr::move_cameras({&gradient, 1}, {&second, 1}, common, 0.01, cameras);
    CHECK(cameras[0].view == before[0].view);
    CHECK(cameras[0].steps.iteration == 0);
    // No rotation moves the centre, and a step of Adam has the size of the learning rate.
    const glm::dvec3 moved = glm::dvec3(cameras[1].view * glm::dvec4(common.centre, 1.0)) - about;
    CHECK(glm::length(moved - glm::dvec3(0, 0, -0.02)) < 1e-6);
    CHECK(dpr::angle_degrees(glm::dmat3(cameras[1].view), glm::dmat3(before[1].view)) < 1e-3);
  }
}

TEST_SUITE("unit") {
  TEST_CASE("an anchored scene looks as before, and its cameras are in the mean where they were") {
    const dpr::Device device = dpr::open_device();
    ShapeViews views = make_problem(device, 0, 0).views;
    const dpr::CommonView common = dpr::common_view(views);
    const glm::dvec3 p(0.3, -0.2, 0.5);
    glm::dmat4 motion(dpr::rotation_from_vector({0.02, -0.03, 0.01}));
    motion[3] = glm::dvec4(0.05, 0.02, -0.04, 1);
    std::vector<dpr::ShapeState::MovedCamera> cameras = dpr::unmoved_cameras(views);
    for (dpr::ShapeState::MovedCamera& camera : cameras) camera.view = camera.view * motion;
    const glm::dvec4 before = cameras[1].view * glm::dvec4(p, 1.0);
    std::vector<double> positions{p.x, p.y, p.z};
    dpr::anchor(views, common, cameras, positions);
    const glm::dvec4 after = cameras[1].view * glm::dvec4(positions[0], positions[1], positions[2], 1.0);
    CHECK(glm::distance(after, before) < 1e-9);
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const glm::dmat4 difference = cameras[i].view - glm::dmat4(views.views[i].camera.view);
      for (int column = 0; column < 4; ++column) CHECK(glm::length(difference[column]) < 1e-5);
    }
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("cameras that cannot be refined, and checkpoints of other cameras, are refused") {
    const dpr::Device device = dpr::open_device();
    ShapeViews views = make_problem(device, 0, 0).views;
    ShapeOptions options = options_for(true);
    options.camera_learning_rate = 0;
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, ShapeSolver(device, views, options), "camera_learning_rate");
    options.camera_learning_rate = 0.01;
    views.views.resize(1);
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, ShapeSolver(device, views, options), "at least two");

    const dpr::test::TempDir folder;
    dpr::ShapeState state;
    state.faces = {{0, 1, 2}};
    state.positions = state.colors = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    state.cameras.resize(2);
    const auto read = [&](const auto& change, std::size_t cameras = 2) {
      dpr::ShapeState changed = state;
      change(changed);
      dpr::write_checkpoint(folder / "checkpoint", changed, 7);
      return dpr::read_checkpoint(folder / "checkpoint", 7, {}, cameras);
    };
    const auto nothing = [](dpr::ShapeState&) {};
    CHECK(read(nothing).cameras.size() == 2);
    DPR_CHECK_MESSAGE_HAS(dpr::IoError, read(nothing, 3), "is damaged");
    DPR_CHECK_MESSAGE_HAS(dpr::IoError, read([](dpr::ShapeState& s) { s.cameras[1].view[0][0] = 2; }),
                          "is damaged");
    DPR_CHECK_MESSAGE_HAS(dpr::IoError, read([](dpr::ShapeState& s) {
                            s.cameras[0].steps.first_moment = {1, 2};
                          }),
                          "is damaged");
  }
}

}  // namespace shape_cameras_test
