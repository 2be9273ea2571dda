// Auxiliary outputs: of a rigid image against ray casting, of smooth ones against the reference's weights.
#include "dpr/aov.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/determinism.hpp"
#include "pipeline/scenes.hpp"
#include "reference/aggregate.hpp"
#include "renderer/renderer_impl.hpp"
#include "scene/gradient_table.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/temp_dir.hpp"

namespace aov_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

constexpr Aov k_all[] = {Aov::depth,        Aov::normal, Aov::face_id,
                         Aov::barycentrics, Aov::uv,     Aov::effective_faces};

/// A cube and a sphere that intersect.
Scene two_meshes(int width, int height) {
  Scene scene = cube_scene(width, height);
  scene.meshes.push_back({make_icosphere(1, 0.9F), placed(50.0F, 1.0F, {0.7F, 0.5F, 0.6F})});
  return scene;
}

/// Hit of the ray through a pixel's centre on a face, camera space: depth and barycentrics.
struct Hit {
  double depth = std::numeric_limits<double>::infinity();
  std::int32_t face = -1;
  glm::dvec3 barycentrics{0.0}, normal{0.0};  // world
};

Hit cast(const Scene& scene, int column, int row) {
  const double half = std::tan(glm::radians(static_cast<double>(scene.camera.fov_y_degrees)) / 2);
  const glm::dvec3 ray((column + 0.5 - 0.5 * scene.width) * 2 / scene.height * half,
                       (0.5 * scene.height - row - 0.5) * 2 / scene.height * half, -1);
  Hit nearest;
  std::int32_t face = 0;
  for (const Instance& instance : scene.meshes) {
    const glm::dmat4 to_world(instance.transform), to_view = glm::dmat4(scene.camera.view) * to_world;
    for (const glm::uvec3& f : instance.mesh.faces) {
      glm::dvec3 corner[3], world[3];
      for (int i = 0; i < 3; ++i) {
        const glm::dvec4 position(instance.mesh.positions[f[i]], 1.0);
        corner[i] = glm::dvec3(to_view * position);
        world[i] = glm::dvec3(to_world * position);
      }
      // corner * b = t * ray with the b summing to 1.
      const glm::dvec3 b = glm::inverse(glm::dmat3(corner[0], corner[1], corner[2])) * ray;
      const double sum = b.x + b.y + b.z;
      if (b.x / sum > 0 && b.y / sum > 0 && b.z / sum > 0 && 1 / sum > 0 && 1 / sum < nearest.depth) {
        nearest = {1 / sum, face, b / sum,
                   glm::normalize(glm::cross(world[1] - world[0], world[2] - world[0]))};
      }
      ++face;
    }
  }
  return nearest;
}

/// The reference's weights of a pixel's fragments, background last, from the rasterizer's depths and
/// occupancies.
struct Weighted {
  std::vector<double> weights, depths;
  std::vector<cl_uint> faces;
};

std::vector<Weighted> reference_weights(const Renderer& renderer) {
  const Renderer::Impl& m = impl_of(renderer);
  const std::vector<cl_uint> starts = m.rasterize.pixel_starts.download(), list = m.rasterize.list.download(),
                             pair = m.rasterize.fragment_pair.download(),
                             pair_face = m.bin.pair_face.download();
  const auto plane = [&](cl_uint number) { return m.rasterize.plane(m.frame, number); };
  const std::vector<float> depth = plane(DPR_PLANE_DEPTH), p = plane(DPR_PLANE_OCCUPANCY),
                           log_p = plane(DPR_PLANE_LOG_OCCUPANCY);
  const Smoothing& s = m.scene.smoothing;
  reference::AggregateParameters parameters;
  parameters.composition =
      s.composition == Composition::joint ? reference::Composition::joint : reference::Composition::barrier;
  parameters.prior = static_cast<reference::Prior>(static_cast<int>(s.depth_prior));
  parameters.gamma = static_cast<double>(s.gamma);
  parameters.alpha = static_cast<double>(s.alpha);
  parameters.znear = static_cast<double>(m.scene.camera.znear);
  parameters.zfar = static_cast<double>(m.scene.camera.zfar);
  parameters.background_depth = static_cast<double>(s.background_depth);
  std::vector<Weighted> pixels;
  for (std::size_t i = 0; i + 1 < starts.size(); ++i) {
    Weighted& pixel = pixels.emplace_back();
    std::vector<reference::FragmentInput> fragments;
    for (cl_uint at = starts[i]; at < starts[i + 1]; ++at) {
      const cl_uint k = list[at];
      pixel.depths.push_back(static_cast<double>(depth[k]));
      pixel.faces.push_back(pair_face[pair[k]] % m.frame.faces);
      fragments.push_back(
          {pixel.depths.back(), static_cast<double>(p[k]), static_cast<double>(log_p[k]), {}});
    }
    const reference::AggregateResult result = reference::aggregate_forward(fragments, parameters);
    pixel.weights = result.weights;
    pixel.weights.push_back(result.background_weight);
  }
  return pixels;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("aov: a rigid image shows what rays meet") {
    const int width = reduced(50, 14), height = reduced(37, 11);
    Scene scene = two_meshes(width, height);
    scene.smoothing = smoothing_preset("rigid");
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const AuxiliaryOutputs found = auxiliary_outputs(renderer);
    int hits = 0, others = 0, of_sphere = 0;
    for (int row = 0; row < height; ++row) {
      for (int column = 0; column < width; ++column) {
        const auto i = static_cast<std::size_t>(row * width + column);
        const Hit hit = cast(scene, column, row);
        if (found.face_id[i] != hit.face) {  // a pixel's centre on an edge
          ++others;
          continue;
        }
        if (hit.face < 0) {
          CHECK(found.depth[i] == 0);
          CHECK(found.effective_faces[i] == 0);
          CHECK(found.normal[i] == glm::vec3(0));
          CHECK(found.barycentrics[i] == glm::vec3(0));
          continue;
        }
        ++hits;
        if (hit.face >= 12) ++of_sphere;
        CHECK(static_cast<double>(found.depth[i]) == doctest::Approx(hit.depth).epsilon(1e-5));
        CHECK(glm::length(glm::dvec3(found.normal[i]) - hit.normal) < 1e-4);
        CHECK(glm::length(glm::dvec3(found.barycentrics[i]) - hit.barycentrics) < 1e-3);
        CHECK(found.effective_faces[i] == doctest::Approx(1).epsilon(1e-4));
      }
    }
    CHECK(hits > width * height / 10);
    CHECK(of_sphere > 3);
    CHECK(others < width * height / 100 + 1);
    CHECK(found.uv.empty());
  }

  TEST_CASE("aov: smooth images count faces by the reference's weights") {
    const Device device = open_device();
    for (const Composition composition : {Composition::barrier, Composition::joint}) {
      Scene scene = two_meshes(reduced(20, 8), reduced(16, 6));
      scene.smoothing.composition = composition;
      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.forward();
      const AuxiliaryOutputs found = auxiliary_outputs(renderer);
      const std::vector<Weighted> expected = reference_weights(renderer);
      double most = 0;
      int of_background = 0;
      for (std::size_t i = 0; i < expected.size(); ++i) {
        const Weighted& pixel = expected[i];
        double sum = 0, squares = 0, depth = 0;
        for (std::size_t k = 0; k < pixel.depths.size(); ++k) {
          sum += pixel.weights[k];
          squares += pixel.weights[k] * pixel.weights[k];
          depth += pixel.weights[k] * pixel.depths[k];
        }
        if (sum < 1e-3) continue;  // of the sum of nearly nothing few digits are known
        CHECK(static_cast<double>(found.depth[i]) == doctest::Approx(depth / sum).epsilon(1e-4));
        CHECK(static_cast<double>(found.effective_faces[i]) ==
              doctest::Approx(sum * sum / squares).epsilon(1e-3));
        most = std::max(most, sum * sum / squares);
        CHECK(std::abs(glm::length(found.normal[i]) - 1) < 1e-5F);
        // The largest, unless a second is as large.
        std::vector<double> sorted = pixel.weights;
        std::ranges::sort(sorted, std::greater());
        if (sorted[0] - sorted[1] < 1e-4) continue;
        const auto largest =
            static_cast<std::size_t>(std::ranges::max_element(pixel.weights) - pixel.weights.begin());
        const bool is_face = largest < pixel.faces.size();
        CHECK(found.face_id[i] == (is_face ? static_cast<std::int32_t>(pixel.faces[largest]) : -1));
        if (!is_face) ++of_background;
      }
      CAPTURE(to_string(composition));
      CHECK(most > 2);  // several faces are seen somewhere
      // Somewhere the background has the largest weight beside faces.
      if (!dpr::test::is_reduced()) CHECK(of_background > 0);
    }
  }

  TEST_CASE("aov: every view has its own, and the gradients after them are the same") {
    Scene scene = cube_scene(reduced(24, 9), reduced(16, 7));
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    View first = renderer.views().front(), second = first;
    second.transforms[0] = placed(80.0F, 0.8F, {0.2F, 0.1F, 0.0F});
    const std::vector<View> views{first, second};
    renderer.set_views(views);
    renderer.forward();
    const std::vector<Image> grads(2, random_image(scene.width, scene.height, -1.0F, 1.0F));
    const std::vector<glm::vec3> before = renderer.backward(grads).meshes[0].positions;
    const AuxiliaryOutputs a = auxiliary_outputs(renderer, 0), b = auxiliary_outputs(renderer, 1);
    CHECK(renderer.backward(grads).meshes[0].positions == before);
    CHECK(a.face_id != b.face_id);
    renderer.set_views(std::span(&second, 1));
    renderer.forward();
    const AuxiliaryOutputs alone = auxiliary_outputs(renderer);
    CHECK(alone.face_id == b.face_id);
    CHECK(alone.depth == b.depth);
    CHECK(alone.normal == b.normal);
  }

  TEST_CASE("aov: of noise on the pixel, between backward passes, change no gradient") {
    // By a coarse grid, where the samples' gradient takes the place of the samples.
    Scene scene = two_meshes(32, 32);
    scene.smoothing = smoothing_preset("pixel", scene.width, scene.height);
    scene.smoothing.sigma = 0.1F;
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    REQUIRE_FALSE(impl_of(renderer).pixel_noise->blur.scale_reads_raster());
    const std::vector<Image> grads(1, random_image(scene.width, scene.height, -1.0F, 1.0F));
    const SceneGradient first = renderer.backward(grads), second = renderer.backward(grads);
    CHECK(first.sigma != 0);
    CHECK(same_bits(first, second));
    CHECK(&impl_of(renderer).pixel_noise->grad_raster(impl_of(renderer).aggregate.image) ==
          &impl_of(renderer).aggregate.image);
    static_cast<void>(auxiliary_outputs(renderer));
    CHECK(same_bits(first, renderer.backward(grads)));
  }

  TEST_CASE("aov: of noise on the pixel, gradients without the scale's take less memory, and change none") {
    for (const float sigma : {1e-3F, 0.1F}) {  // by the raster itself, and by a coarse grid
      Scene scene = two_meshes(32, 32);
      scene.smoothing = smoothing_preset("pixel", scene.width, scene.height);
      scene.smoothing.sigma = sigma;
      const std::vector<Image> grads(1, random_image(scene.width, scene.height, -1.0F, 1.0F));
      Renderer whole(open_device());
      whole.set_scene(scene);
      whole.forward();
      const SceneGradient expected = whole.backward(grads);
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      GradientRequest shape = no_gradients();
      shape.positions = shape.colors = true;
      renderer.set_gradients(shape);
      const SceneGradient first = renderer.backward(grads), second = renderer.backward(grads);
      CHECK(first.meshes[0].positions == expected.meshes[0].positions);
      CHECK(first.meshes[0].colors == expected.meshes[0].colors);
      CHECK(same_bits(first, second));
      const auto& p = impl_of(renderer).frame;
      // Where the raster is read, its gradient beside it.
      const std::size_t of_samples = std::size_t{p.width} * p.height * sizeof(cl_float4);
      const std::size_t spared = impl_of(renderer).pixel_noise->blur.scale_reads_raster() ? 1 : 0;
      CHECK(renderer.statistics().device_bytes + spared * of_samples < whole.statistics().device_bytes);
      renderer.set_gradients(scene.gradients);
      CHECK(same_bits(expected, renderer.backward(grads)));
    }
  }

  TEST_CASE("aov: frames in bands show the same") {
    Device device = open_device();
    Scene scene = two_meshes(40, 40);
    scene.smoothing.composition = Composition::joint;
    Renderer renderer(device);
    renderer.set_scene(scene);
    renderer.forward();
    const AuxiliaryOutputs whole = auxiliary_outputs(renderer);
    const std::size_t enough = device.memory_budget();
    device.set_memory_budget(renderer.statistics().fragments * 70);
    renderer.forward();
    REQUIRE(renderer.statistics().bands > 1);
    const AuxiliaryOutputs found = auxiliary_outputs(renderer);
    CHECK(found.depth == whole.depth);
    CHECK(found.normal == whole.normal);
    CHECK(found.face_id == whole.face_id);
    CHECK(found.barycentrics == whole.barycentrics);
    CHECK(found.effective_faces == whole.effective_faces);
    const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
    const SamplingError error = estimate_sampling_error(renderer, std::span(&grad, 1));
    CHECK(error.pixel_gradients.empty());
    CHECK(error.images.size() == 1);
    device.set_memory_budget(enough);
  }

  TEST_CASE("aov: sampled weights count too") {
    Scene scene = cube_scene(reduced(24, 9), reduced(16, 7));
    scene.smoothing = smoothing_preset("paper_gaussian");
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const AuxiliaryOutputs found = auxiliary_outputs(renderer);
    for (std::size_t i = 0; i < found.depth.size(); ++i) {
      CHECK(std::isfinite(found.depth[i] + found.effective_faces[i] + found.normal[i].x));
      CHECK((found.effective_faces[i] == 0 || found.effective_faces[i] >= 1 - 1e-5F));
      CHECK((found.depth[i] > 0) == (found.effective_faces[i] > 0));
      if (found.face_id[i] >= 0) CHECK(found.depth[i] > 0);
    }
  }

  TEST_CASE("aov: texture coordinates of an OBJ, interpolated") {
    const test::TempDir folder;
    folder.write(
        "square.obj",
        "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 2 0\nvt 2 3\nvt 0 3\nf 1/1 2/2 3/3 4/4\n");
    Scene scene;
    scene.width = scene.height = reduced(16, 6);
    scene.camera.view[3].z = -4;
    scene.meshes.push_back({read_mesh(folder / "square.obj")});
    scene.meshes[0].transform = placed(25.0F, 1.3F);  // so that perspective counts
    scene.smoothing = smoothing_preset("rigid");
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const AuxiliaryOutputs found = auxiliary_outputs(renderer);
    const double half = std::tan(glm::radians(30.0));
    const glm::dmat4 to_object =
        glm::inverse(glm::dmat4(scene.camera.view) * glm::dmat4(scene.meshes[0].transform));
    int seen = 0;
    for (std::size_t i = 0; i < found.uv.size(); ++i) {
      if (found.face_id[i] < 0) {
        CHECK(found.uv[i] == glm::vec2(0));
        continue;
      }
      ++seen;
      const auto width = static_cast<std::size_t>(scene.width);
      const double x = (static_cast<double>(i % width) + 0.5) * 2 / scene.width - 1;
      const double y = 1 - (static_cast<double>(i / width) + 0.5) * 2 / scene.height;
      const double depth = static_cast<double>(found.depth[i]);
      const glm::dvec4 point = to_object * glm::dvec4(x * half * depth, y * half * depth, -depth, 1);
      CHECK(static_cast<double>(found.uv[i].x) == doctest::Approx(point.x + 1).epsilon(1e-3));
      CHECK(static_cast<double>(found.uv[i].y) == doctest::Approx(1.5 * (point.y + 1)).epsilon(1e-3));
    }
    CHECK(seen > 4);
    for (const Aov aov : k_all) CHECK(aov_image(found, aov).pixels.size() == found.depth.size());
    CHECK(aov_image(found, Aov::uv).pixels[found.uv.size() / 2].y == found.uv[found.uv.size() / 2].y);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("aov: what is not there is said") {
    Renderer renderer(open_device());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, auxiliary_outputs(renderer), "forward() first");
    renderer.set_scene(cube_scene(5, 4));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, auxiliary_outputs(renderer), "forward() first");
    renderer.forward();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, auxiliary_outputs(renderer, 1), "view: got 1, expected below 1");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, aov_image(auxiliary_outputs(renderer), Aov::uv),
                          "without texture coordinates");
    for (const Aov aov : k_all) CHECK(parse_aov(to_string(aov), "x") == aov);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, parse_aov("deep", "--aov"),
                          "--aov: got \"deep\", expected depth, normal");
  }

  TEST_CASE("aov: nothing in sight is background") {
    Scene scene = cube_scene(6, 5);
    scene.meshes[0].transform = placed(0.0F, 1.0F, {500.0F, 0.0F, 0.0F});
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const AuxiliaryOutputs found = auxiliary_outputs(renderer);
    CHECK(std::ranges::count(found.face_id, -1) == 30);
    CHECK(std::ranges::count(found.depth, 0.0F) == 30);
    CHECK(aov_image(found, Aov::depth).pixels[7].a == 0);
  }
}

}  // namespace aov_test
