// Devices that vanish, fail or are slow beside others: the work is done by the others, to the same bits.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <glm/gtc/matrix_transform.hpp>
#include <string>
#include <vector>

#include "check/comparison.hpp"
#include "device/context.hpp"
#include "dpr/dpr.hpp"
#include "faults/opencl_faults.hpp"
#include "pipeline/scenes.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"
#include "support/several_devices.hpp"

namespace devices_test {

using namespace dpr;
using namespace dpr::test;
using namespace dpr::test::pipeline;

namespace {

constexpr std::size_t k_views = 12;

/// Devices, and what their queues are made to do until the end.
struct Devices {
  explicit Devices(std::size_t count) {
    for (std::size_t d = 0; d < count; ++d) list.push_back(open_device());
  }
  ~Devices() { heal(); }
  Devices(const Devices&) = delete;
  Devices& operator=(const Devices&) = delete;

  void* queue(std::size_t device) const { return impl_of(list[device]).queue(); }
  void lose(std::size_t device, std::size_t nth) const { dpr_lose_queue(queue(device), nth); }
  void slow(std::size_t device, unsigned microseconds) const { dpr_slow_queue(queue(device), microseconds); }
  void heal() const {
    for (std::size_t d = 0; d < list.size(); ++d) {
      dpr_lose_queue(queue(d), 0);
      dpr_slow_queue(queue(d), 0);
    }
  }

  std::vector<Device> list;
};

Scene small_scene() { return cube_scene(12, 13); }

std::vector<View> ring(const Scene& scene) {
  std::vector<View> views;
  for (std::size_t v = 0; v < k_views; ++v) {
    Camera camera = scene.camera;
    const float turn = 6.2831853F * static_cast<float>(v) / static_cast<float>(k_views);
    camera.view = camera.view * glm::rotate(glm::mat4(1.0F), turn, glm::vec3(0.1F, 1.0F, 0.2F));
    views.push_back({camera, {scene.meshes[0].transform}});
  }
  return views;
}

MultiDeviceRenderer make_renderer(const std::vector<Device>& devices) {
  const Scene scene = small_scene();
  MultiDeviceRenderer renderer(devices);
  renderer.set_scene(scene);
  renderer.set_views(ring(scene));
  renderer.set_loss({.mse = 1.0F},
                    std::vector<Image>(k_views, Image(scene.width, scene.height, glm::vec4(0.4F))));
  return renderer;
}

/// Loss and gradients of an evaluation.
std::vector<double> values(MultiDeviceRenderer& renderer) {
  const MultiDeviceRenderer::Evaluation found = renderer.evaluate();
  std::vector<double> all = found.per_view;
  for (const Block& block : blocks_of(found.gradient))
    all.insert(all.end(), block.found.begin(), block.found.end());
  return all;
}

/// The views file of a coloured triangle from two sides.
void write_views(const TempDir& folder) {
  std::string views;
  for (const char* const matrix : {"[[1,0,0,0],[0,1,0,0],[0,0,1,-4],[0,0,0,1]]",
                                   "[[0.8,0,0.6,0],[0,1,0,0],[-0.6,0,0.8,-4],[0,0,0,1]]"}) {
    const std::string camera = std::string(R"({"view": )") + matrix + R"(, "fov_y_degrees": 60, "zfar": 8})";
    folder.write("scene.json", R"({"width": 12, "height": 12, "camera": )" + camera + R"(, "meshes": [{
        "positions": [[-1,-1,0],[1,-1,0.3],[0,1,0.1]], "faces": [[0,1,2]], "face_colors": [[1,0.2,0]]}]})");
    const std::string image = "view" + std::to_string(views.size()) + ".exr";
    REQUIRE(run_command(folder, {"render", "--scene", "scene.json", "-o", image}).status == 0);
    views += (views.empty() ? "" : ", ") + (R"({"image": ")" + image + R"(", "camera": )" + camera + "}");
  }
  folder.write("views.json", R"({"width": 12, "height": 12, "views": [)" + views + "]}");
}

/// dpr fit on two parts of the CPU, which have the command queues 1 and 2, with an order to the faults'
/// library.
Outcome fit_on_parts(const TempDir& folder, const std::string& output, const std::string& order) {
  std::vector<std::string> arguments{std::string("LD_PRELOAD=") + std::getenv("DPR_OPENCL_FAULTS")};
  if (!order.empty()) arguments.push_back(order);
  arguments.push_back(program_path("DPR_CLI"));
  for (const char* const word : {"fit", "--views", "views.json", "--device", "cpu/2", "--levels", "1",
                                 "--iterations", "8", "--report", "report", "-o"})
    arguments.emplace_back(word);
  arguments.push_back(output);
  return run_program("env", folder, arguments);
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("devices: one that vanishes is lost, and the others give the same bits") {
    const Devices devices(3);
    MultiDeviceRenderer whole = make_renderer({devices.list[0]});
    const std::vector<double> wanted = values(whole);
    for (const std::size_t nth : {1U, 7U, 60U, 150U}) {
      CAPTURE(nth);
      devices.heal();
      MultiDeviceRenderer renderer = make_renderer(devices.list);
      CHECK(values(renderer) == wanted);
      CHECK(renderer.take_notes().empty());
      devices.lose(1, nth);
      std::vector<std::string> notes;
      for (int call = 0; call < 200 && notes.empty(); ++call) {
        CHECK(values(renderer) == wanted);
        notes = renderer.take_notes();
      }
      REQUIRE(notes.size() == 1);
      CHECK(contains(notes[0], "device 1 of the list, is lost"));
      CHECK(contains(notes[0], "CL_DEVICE_NOT_AVAILABLE"));
      const std::size_t rendered = renderer.views_rendered()[1];
      CHECK(values(renderer) == wanted);
      CHECK(renderer.take_notes().empty());
      CHECK(renderer.views_rendered()[1] == rendered);
    }
  }

  TEST_CASE("devices: the error of the first where all vanish; the next call tries them again") {
    const Devices devices(2);
    MultiDeviceRenderer renderer = make_renderer(devices.list);
    const std::vector<double> wanted = values(renderer);
    devices.lose(0, 1);
    devices.lose(1, 1);
    DPR_CHECK_MESSAGE_HAS(DeviceError, renderer.evaluate(), "CL_DEVICE_NOT_AVAILABLE");
    DPR_CHECK_MESSAGE_HAS(DeviceError, renderer.evaluate(), "CL_DEVICE_NOT_AVAILABLE");
    devices.heal();
    CHECK(values(renderer) == wanted);
  }

  TEST_CASE("devices: kernels that do not build on one of them are built on the others") {
    const Devices devices(2);
    MultiDeviceRenderer renderer = make_renderer(devices.list);
    Smoothing other = small_scene().smoothing;
    other.occupancy_prior = Prior::logistic;
    renderer.set_smoothing(other);
    dpr_arm_opencl_fault("clBuildProgram", 1);
    const std::vector<double> found = values(renderer);
    CHECK(dpr_disarm_opencl_fault());
    CHECK(renderer.take_notes().size() == 1);
    MultiDeviceRenderer whole = make_renderer({devices.list[0]});
    whole.set_smoothing(other);
    CHECK(values(whole) == found);
  }

  TEST_CASE("devices: a slow one does not hold up the others") {
    const Devices devices(2);
    MultiDeviceRenderer whole = make_renderer({devices.list[0]});
    const std::vector<double> wanted = values(whole);
    constexpr unsigned k_delay_microseconds = 100'000;  // of each of the waits of a chunk
    devices.slow(1, k_delay_microseconds);
    MultiDeviceRenderer renderer = make_renderer(devices.list);
    // Its time is known after two chunks, the first of which is not timed. In small calls it may come too
    // late.
    for (int call = 0; call < 1000 && renderer.views_rendered()[1] < 2; ++call)
      CHECK(values(renderer) == wanted);
    REQUIRE(renderer.views_rendered()[1] == 2);
    for (int call = 0; call < 10; ++call) CHECK(values(renderer) == wanted);
    CHECK(renderer.views_rendered()[1] == 2);
    CHECK(renderer.take_notes().empty());
  }

  TEST_CASE("devices: a fit goes on to the same bits without the device that vanishes, and says so once") {
    const Devices devices(2);
    ShapeViews views;
    views.width = views.height = 12;
    for (int i = 0; i < 4; ++i) {
      Camera camera = orbit_camera(4, 20, 90.0F * static_cast<float>(i));
      camera.zfar = 8;
      views.views.push_back({random_image(12, 12, 0.0F, 1.0F, 5 + static_cast<unsigned>(i)), camera});
    }
    ShapeOptions options;
    options.levels = 1;
    options.iterations = 12;
    options.remesh_interval = 5;
    const ShapeSolver solver(devices.list, views, options);
    const Mesh wanted = solver.solve().mesh;
    devices.slow(0, 3'000);  // so that the other gets most of the work
    devices.lose(1, 300);
    std::size_t notes = 0;
    const ShapeResult found = solver.solve([&](const ShapeIteration& step, const Mesh&) {
      notes += step.notes.size();
      return true;
    });
    CHECK(notes == 1);
    CHECK(found.mesh.positions == wanted.positions);
    CHECK(found.mesh.vertex_colors == wanted.vertex_colors);
    devices.lose(0, 1);
    DPR_CHECK_MESSAGE_HAS(DeviceError, solver.solve(), "CL_DEVICE_NOT_AVAILABLE");
  }

  TEST_CASE("devices: dpr fit notes a device that vanishes") {
    if (is_skipped() || is_skipped("DPR_OPENCL_FAULTS")) return;
    if (!is_divisible(open_device("cpu"))) return;
    const TempDir folder;
    write_views(folder);
    const Outcome whole = fit_on_parts(folder, "whole.obj", "");
    CAPTURE(whole.err);
    REQUIRE(whole.status == 0);
    // The second of them, or the first, which renders the report's pictures too.
    for (const char* const order : {"DPR_LOST_QUEUE=2:40", "DPR_LOST_QUEUE=1:40"}) {
      CAPTURE(order);
      const Outcome lost = fit_on_parts(folder, "lost.obj", order);
      CAPTURE(lost.err);
      CHECK(lost.status == 0);
      CHECK(lost.err.starts_with("dpr: note: "));
      CHECK(contains(lost.err, " of the list, is lost"));
      CHECK(std::ranges::count(lost.err, '\n') == std::ranges::count(whole.err, '\n') + 1);
      CHECK(folder.read("lost.obj") == folder.read("whole.obj"));
    }
  }
}

}  // namespace devices_test
