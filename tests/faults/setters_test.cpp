// Whatever fails in a call of the library, a renderer has its old state or its new one, whole, and works on.
#include <doctest/doctest.h>

#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "check/comparison.hpp"
#include "device/context.hpp"
#include "dpr/dpr.hpp"
#include "dpr/opencl_handles.hpp"
#include "faults/sweep.hpp"
#include "pipeline/scenes.hpp"
#include "support/reduced.hpp"

namespace setters_test {

using namespace dpr;
using namespace dpr::test;
using namespace dpr::test::pipeline;

namespace {

constexpr int k_size = 12;

Scene old_scene() {
  Scene scene = cube_scene(k_size, k_size);
  scene.smoothing.aggregation_estimator = Estimator::monte_carlo;
  scene.smoothing.samples = 4;
  scene.gradients = {};
  scene.gradients.positions = scene.gradients.colors = true;
  return scene;
}

/// Other geometry, another size, lights, other kernels.
Scene new_scene() {
  Scene scene = scene_of(random_soup(7, 3), k_size + 5, k_size - 2);
  scene.lights = two_lights(Shading::gouraud);
  scene.smoothing.occupancy_prior = Prior::logistic;
  scene.smoothing.depth_prior = Prior::gumbel;
  scene.gradients = {};
  scene.gradients.positions = true;
  return scene;
}

Smoothing new_smoothing() {
  Smoothing smoothing = old_scene().smoothing;
  smoothing.occupancy_prior = Prior::cauchy;
  smoothing.aggregation_estimator = Estimator::exact;
  smoothing.composition = Composition::joint;
  smoothing.sigma *= 2;
  smoothing.distance = DistanceMetric::euclidean;
  return smoothing;
}

std::vector<View> three_views(const Scene& scene) {
  std::vector<View> views(3, {scene.camera, {scene.meshes[0].transform}});
  views[1].transforms[0] = placed(50.0F);
  views[2].camera.fov_y_degrees += 9;
  return views;
}

std::vector<glm::vec3> moved(std::vector<glm::vec3> values, float factor) {
  for (glm::vec3& v : values) v *= factor;
  return values;
}

void add(std::vector<double>& values, const std::vector<glm::vec3>& vectors) {
  for (const glm::vec3& v : vectors) append(values, v);
}

/// All that one can see of a renderer's state: what it says its scene is, its images, its gradients.
std::vector<double> seen(Renderer& renderer) {
  const Scene& scene = renderer.scene();
  std::vector<double> values{static_cast<double>(scene.smoothing.sigma), static_cast<double>(scene.width)};
  for (const Instance& instance : scene.meshes) {
    add(values, instance.mesh.positions);
    add(values, instance.mesh.vertex_colors);
    add(values, instance.mesh.face_colors);
  }
  renderer.forward();
  std::vector<glm::vec4> pixels(static_cast<std::size_t>(scene.width) *
                                static_cast<std::size_t>(scene.height) * renderer.views().size());
  renderer.read_pixels(pixels);
  for (const glm::vec4& p : pixels) {
    for (int k = 0; k < 4; ++k) values.push_back(static_cast<double>(p[k]));
  }
  const SceneGradient gradient = renderer.backward_pixels(pixels);
  for (const Block& block : blocks_of(gradient))
    values.insert(values.end(), block.found.begin(), block.found.end());
  add(values, gradient.shapes.positions);
  add(values, gradient.shapes.colors);
  return values;
}

bool same(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

struct Operation {
  std::string name;
  std::function<void(Renderer&)> run;
};

std::vector<Operation> operations(const Device& device) {
  const Scene scene = old_scene();
  const Mesh& mesh = scene.meshes[0].mesh;
  std::vector<glm::vec3> values = moved(mesh.positions, 0.6F);
  const cl::Buffer positions(impl_of(device).context, CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR,
                             values.size() * sizeof(glm::vec3), values.data());
  return {
      {"set_positions from a buffer", [positions](Renderer& r) { set_positions(r, 0, {positions()}); }},
      {"set_shapes from buffers", [positions](Renderer& r) { set_shapes(r, {positions()}, {}); }},
      {"on device",
       [](Renderer& r) {
         forward_on_device(r);
         backward_on_device(r, image_view(r).span());
         gradient_view(r, "meshes[0].positions");
       }},
      {"set_scene", [](Renderer& r) { r.set_scene(new_scene()); }},
      {"set_views", [scene](Renderer& r) { r.set_views(three_views(scene)); }},
      {"set_smoothing", [](Renderer& r) { r.set_smoothing(new_smoothing()); }},
      {"set_positions", [mesh](Renderer& r) { r.set_positions(0, moved(mesh.positions, 0.7F)); }},
      {"set_colors", [mesh](Renderer& r) { r.set_colors(0, moved(mesh.face_colors, 0.7F)); }},
      {"set_lights", [](Renderer& r) { r.set_lights(every_light(Shading::blinn)); }},
      {"set_shapes",
       [mesh](Renderer& r) { r.set_shapes(moved(mesh.positions, 1.1F), moved(mesh.face_colors, 0.4F)); }},
      {"set_background",
       [](Renderer& r) {
         r.set_background({0.9F, 0.1F, 0.2F});
       }},
      {"forward", [](Renderer& r) { r.forward(); }},
      {"backward",
       [](Renderer& r) {
         const Image grad(k_size, k_size, glm::vec4(1));
         r.forward();
         r.backward(std::span(&grad, 1));
       }},
      {"losses",
       [device, mesh](Renderer& r) {
         const Image target(k_size, k_size, glm::vec4(0.5F));
         ImageLoss loss(device, {.mse = 1, .silhouette = 1}, std::span(&target, 1));
         MeshLoss shape(device, {.laplacian = 1, .flatness = 1}, mesh);
         r.forward();
         loss.evaluate(r);
         shape.evaluate(r);
         r.backward(loss, shape);
       }},
      {"auxiliary_outputs",
       [](Renderer& r) {
         r.forward();
         auxiliary_outputs(r);
         r.statistics();
       }},
      {"estimate_sampling_error",
       [](Renderer& r) {
         const Image grad(k_size, k_size, glm::vec4(1));
         estimate_sampling_error(r, std::span(&grad, 1), 2);
       }},
  };
}

/// The operation with every fault of a kind, on the old scene with room for more. Returns how many there
/// were.
std::size_t check_operation(const Operation& operation, const FaultKind& kind, Renderer& renderer,
                            std::size_t most) {
  CAPTURE(operation.name);
  const auto prepare = [&] {
    renderer.set_scene(old_scene());
    renderer.forward();
    renderer.image();
  };
  prepare();
  const std::vector<double> before = seen(renderer);
  operation.run(renderer);
  const std::vector<double> after = seen(renderer);
  const std::size_t faults = sweep(
      kind, most, prepare, [&] { operation.run(renderer); },
      [&](Ending ending, std::size_t) {
        CHECK(same(seen(renderer), ending == Ending::failed ? before : after));
      });
  prepare();
  CHECK(same(seen(renderer), before));
  return faults;
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("faults: a call that fails changes nothing, one that does not changes everything") {
    const Device device = open_device();
    for (const FaultKind& kind : {opencl_faults(), allocation_faults()}) {
      Renderer renderer(device);
      std::size_t faults = 0;
      for (const Operation& operation : operations(device)) {
        faults += check_operation(operation, kind, renderer, static_cast<std::size_t>(reduced(60, 5)));
      }
      CHECK(faults > 0);
    }
  }

  TEST_CASE("faults: a frame that outgrows its buffers is whole or an error") {
    const Scene scene = old_scene();
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const std::vector<double> wanted = seen(renderer);
    const std::size_t faults = sweep(
        opencl_faults(), static_cast<std::size_t>(reduced(60, 5)),
        [&] {
          renderer.set_scene(scene);
          renderer.set_positions(0, moved(scene.meshes[0].mesh.positions, 0.2F));
          renderer.forward();
          renderer.image();
          renderer.set_positions(0, scene.meshes[0].mesh.positions);
        },
        [&] {
          renderer.forward();
          renderer.image();
        },
        [&](Ending, std::size_t) { CHECK(same(seen(renderer), wanted)); });
    CHECK(faults > 0);
  }

  TEST_CASE("faults: own shading that failed works the next time") {
    Scene scene = old_scene();
    scene.smoothing = smoothing_preset("pixel");
    Renderer renderer(open_device());
    std::vector<double> seen_samples;
    const auto shade = [&] {
      seen_samples.clear();
      renderer.forward();
      const Samples samples = renderer.samples(true);
      const std::vector<float> values(5 * samples.faces.size(), 0.5F), pixels = renderer.resolve(values, 5);
      const ResolveGradient resolved = renderer.resolve_backward(values, 5, pixels);
      const SceneGradient inside = renderer.samples_backward(samples.barycentrics, samples.depths);
      for (const std::vector<float>& numbers : {pixels, resolved.samples, samples.depths})
        seen_samples.insert(seen_samples.end(), numbers.begin(), numbers.end());
      for (const SceneGradient* const gradient : {&resolved.scene, &inside})
        for (const Block& block : blocks_of(*gradient))
          seen_samples.insert(seen_samples.end(), block.found.begin(), block.found.end());
    };
    for (const FaultKind& kind : {opencl_faults(), allocation_faults()}) {
      renderer.set_scene(scene);
      shade();
      const std::vector<double> wanted = seen_samples;
      const std::size_t faults = sweep(
          kind, static_cast<std::size_t>(reduced(60, 5)), [&] { renderer.set_scene(scene); }, shade,
          [&](Ending, std::size_t) {
            shade();
            CHECK(same(seen_samples, wanted));
          });
      CHECK(faults > 0);
    }
  }

  TEST_CASE("faults: kernels that do not build leave the old ones") {
    for (const char* const name : {"clBuildProgram", "clCreateProgramWithSource"}) {
      // Programs are kept: a device of its own for each fault.
      std::size_t n = 1;
      for (bool failed = true; failed; ++n) {
        REQUIRE(n < 20);
        Renderer renderer(open_device());
        renderer.set_scene(old_scene());
        const std::vector<double> before = seen(renderer);
        const FaultKind kind = opencl_faults(name);
        {
          const Armed armed(kind, n);
          try {
            renderer.set_scene(new_scene());
            renderer.set_smoothing(old_scene().smoothing);
          } catch (const Error&) {
          }
          failed = kind.disarm();
        }
        if (!failed) break;
        // The scene came before its smoothing: either both of its kernels built, or nothing changed.
        if (renderer.scene().width == old_scene().width) CHECK(same(seen(renderer), before));
        renderer.set_scene(new_scene());
        const std::vector<double> recovered = seen(renderer);
        Renderer fresh(renderer.device());
        fresh.set_scene(new_scene());
        CHECK(same(recovered, seen(fresh)));
      }
      CHECK(n > 2);
    }
  }

  TEST_CASE("faults: a renderer that cannot be made leaves nothing on the device") {
    const Device device = open_device();
    { const Renderer warm(device); }
    const std::size_t held = device.allocated_bytes();
    for (const FaultKind& kind : {opencl_faults(), allocation_faults()}) {
      const std::size_t faults = sweep(
          kind, static_cast<std::size_t>(reduced(100, 4)), [] {}, [&] { const Renderer renderer(device); },
          [&](Ending, std::size_t) { CHECK(device.allocated_bytes() == held); });
      CHECK(faults > 0);
    }
  }

  TEST_CASE("faults: several devices have one scene, whatever fails on one of them") {
    const std::vector<Device> devices{open_device(), open_device()};
    if (devices[0].info().platform == "Oclgrind") return;
    const Scene scene = old_scene();
    const auto values = [&](MultiDeviceRenderer& renderer) {
      std::vector<double> all;
      for (const Image& image : renderer.render()) {
        for (const glm::vec4& p : image.pixels) append(all, glm::vec3(p));
      }
      return all;
    };
    const auto change = [&](MultiDeviceRenderer& renderer) {
      renderer.set_smoothing(new_smoothing());
      renderer.set_positions(0, moved(scene.meshes[0].mesh.positions, 0.8F));
      renderer.set_views(three_views(scene));
    };
    MultiDeviceRenderer whole(devices);
    whole.set_scene(scene);
    change(whole);
    const std::vector<double> wanted = values(whole);
    MultiDeviceRenderer renderer(devices);
    const std::size_t faults = sweep(
        opencl_faults(), static_cast<std::size_t>(reduced(60, 3)),
        [&] {
          renderer.set_scene(scene);
          renderer.render();
          change(renderer);
        },
        [&] { renderer.render(); }, [&](Ending, std::size_t) { CHECK(same(values(renderer), wanted)); });
    CHECK(faults > 0);
  }
}

}  // namespace setters_test
