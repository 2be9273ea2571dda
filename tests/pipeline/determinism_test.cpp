// The same input gives the same bits: from run to run, from renderer to renderer, alone or in a batch, set
// piece by piece or at once, in one band or in many. And memory: independent of the samples, settled after
// the first iteration, within the budget.
#include <doctest/doctest.h>

#include <vector>

#include "dpr/dpr.hpp"
#include "pipeline/determinism.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace determinism_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

bool is_finite(const Result& result) {
  for (const glm::vec4& p : result.image.pixels) {
    if (!std::isfinite(p.x + p.y + p.z + p.w)) return false;
  }
  for (const Block& block : blocks_of(result.gradient)) {
    if (!std::isfinite(norm(block.found))) return false;
  }
  return true;
}

/// Bytes of a renderer that grow with the fragments of a band, without those that every buffer has for loads
/// of whole vectors.
std::size_t fragment_memory(const Renderer::Impl& m) {
  constexpr std::size_t k_padding = 32 * sizeof(float);
  std::size_t bytes = 0;
  for (const Buffer<cl_uint>* buffer :
       {&m.rasterize.list, &m.rasterize.fragment_pair, &m.rasterize.fragment_pixel}) {
    bytes += buffer->capacity_bytes() - k_padding;
  }
  for (const Buffer<float>* buffer : {&m.rasterize.values, &m.rasterize.grads})
    bytes += buffer->capacity_bytes() - k_padding;
  return bytes;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("determinism: two runs and two renderers agree in every bit") {
    const Device device = open_device();
    for (const Scene& scene : {test_scene(), sampled_scene(), joint_scene(), sampled_joint_scene()}) {
      Renderer renderer(device);
      renderer.set_scene(scene);
      const Result first = render(renderer);
      CHECK(is_finite(first));
      CHECK(norm(flat(first.gradient.meshes[0].positions)) > 0);
      CHECK(same_bits(first, render(renderer)));
      CHECK(same_bits(first, render(device, scene)));
      CHECK(same_bits(first, render(open_device(), scene)));
    }
  }

  TEST_CASE("determinism: another seed or another scene is told apart") {
    const Device device = open_device();
    Scene scene = sampled_scene();
    const Result first = render(device, scene);
    scene.smoothing.seed += 1;
    const Result other_seed = render(device, scene);
    CHECK_FALSE(same_bits(first.image, other_seed.image));
    CHECK_FALSE(same_bits(first.gradient, other_seed.gradient));
    scene = test_scene();
    const Result exact = render(device, scene);
    scene.meshes[0].mesh.positions[0].x += 1e-5F;
    CHECK_FALSE(same_bits(exact, render(device, scene)));
    scene = test_scene();
    scene.smoothing.seed += 1;
    CHECK(same_bits(exact, render(device, scene)));  // nothing is random in the exact renderer
  }

  TEST_CASE("determinism: sampled inside sampled is finite for every prior and both variance reductions") {
    const Device device = open_device();
    for (const Prior prior : dpr::test::k_sampled_priors) {
      for (const VarianceReduction reduction : {VarianceReduction::none, VarianceReduction::rigid}) {
        if (reduced(1, 0) == 0 && prior != Prior::cauchy) continue;
        Scene scene = sampled_scene();
        scene.smoothing.occupancy_prior = scene.smoothing.depth_prior = prior;
        scene.smoothing.variance_reduction = reduction;
        CAPTURE(to_string(prior));
        const Result first = render(device, scene);
        CHECK(is_finite(first));
        CHECK(same_bits(first, render(device, scene)));
      }
    }
  }

  TEST_CASE("determinism: memory does not grow with the samples, nor from one iteration to the next") {
    std::vector<std::size_t> bytes, peaks;
    for (const std::uint32_t samples : {8U, 128U}) {
      const Device device = open_device();
      Scene scene = sampled_scene();
      scene.smoothing.samples = reduced(1, 0) == 1 ? samples : samples / 4;
      Renderer renderer(device);
      renderer.set_scene(scene);
      const View view = renderer.views()[0];
      renderer.set_views(std::span(&view, 1));  // setters prepare what they set beside what is in force
      render(renderer);
      const std::size_t allocated = device.allocated_bytes(), peak = device.peak_allocated_bytes();
      bytes.push_back(renderer.statistics().device_bytes);
      peaks.push_back(peak);
      for (int iteration = 0; iteration < 2; ++iteration) {
        renderer.set_views(std::span(&view, 1));
        renderer.set_smoothing(scene.smoothing);
        render(renderer);
      }
      CHECK(device.allocated_bytes() == allocated);
      CHECK(device.peak_allocated_bytes() == peak);
    }
    CHECK(bytes[0] > 0);
    CHECK(bytes[0] == bytes[1]);
    CHECK(peaks[0] == peaks[1]);
    // A larger image is told apart, and what is destroyed is given back.
    const Device device = open_device();
    Scene scene = sampled_scene();
    scene.width *= 4;
    {
      Renderer renderer(device);
      renderer.set_scene(scene);
      render(renderer);
      CHECK(renderer.statistics().device_bytes > bytes[0]);
    }
    CHECK(device.allocated_bytes() == 0);
  }

  TEST_CASE("determinism: the statistics of a renderer do not count another's memory") {
    const Device device = open_device();
    Renderer first(device), second(device);
    first.set_scene(test_scene());
    first.forward();
    const std::size_t alone = first.statistics().device_bytes;
    second.set_scene(test_scene());
    second.forward();
    CHECK(first.statistics().device_bytes == alone);
    CHECK(second.statistics().device_bytes == alone);
  }

  TEST_CASE("determinism: a batch of views equals the single renders") {
    const Device device = open_device();
    Scene scene = test_scene();
    scene.meshes.push_back({make_cube(), placed(70.0F, 0.4F, {0.9F, 0.4F, 0.2F})});
    std::vector<View> views;
    const int count = reduced(5, 2);
    for (int v = 0; v < count; ++v) {
      const auto turn = static_cast<float>(v);
      View view{orbit_camera(5.0F + 0.3F * turn, 20.0F - 9.0F * turn, 70.0F * turn), {}};
      view.camera.fov_y_degrees = 40.0F + turn;
      view.camera.zfar = 20.0F;
      view.transforms = {placed(11.0F * turn), placed(40.0F * turn, 0.4F, {0.9F, 0.4F, 0.2F})};
      views.push_back(view);
    }
    for (const Composition composition : {Composition::barrier, Composition::joint}) {
      scene.smoothing.composition = composition;
      std::vector<Image> grads;
      for (int v = 0; v < count; ++v) {
        grads.push_back(random_image(scene.width, scene.height, -1.0F, 1.0F, 30U + static_cast<unsigned>(v)));
      }
      Renderer batch(device);
      batch.set_scene(scene);
      batch.set_views(views);
      batch.forward();
      const SceneGradient together = batch.backward(grads);
      REQUIRE(together.views.size() == views.size());

      std::vector<std::vector<double>> positions(2), colors(2);
      double sigma = 0, gamma = 0;
      Renderer single(device);
      single.set_scene(scene);
      for (std::size_t v = 0; v < views.size(); ++v) {
        single.set_views(std::span(&views[v], 1));
        single.forward();
        CHECK(same_bits(batch.image(v), single.image()));
        const SceneGradient g = single.backward(std::span(&grads[v], 1));
        const auto view_values = [](const ViewGradient& view) {
          std::vector<double> values =
              flat<glm::dvec3>({view.camera.view.rotation, view.camera.view.translation});
          values.push_back(view.camera.fov_y_degrees);
          for (const PoseGradient& pose : view.transforms) {
            append(values, pose.rotation);
            append(values, pose.translation);
          }
          return values;
        };
        CHECK(block_error({"view", view_values(together.views[v]), view_values(g.views[0])}, 1e-5) < 1e-5);
        for (std::size_t m = 0; m < 2; ++m) {
          const std::vector<double> p = flat(g.meshes[m].positions), c = flat(g.meshes[m].colors);
          positions[m].resize(p.size());
          colors[m].resize(c.size());
          for (std::size_t i = 0; i < p.size(); ++i) positions[m][i] += p[i];
          for (std::size_t i = 0; i < c.size(); ++i) colors[m][i] += c[i];
        }
        sigma += g.sigma;
        gamma += g.gamma;
      }
      for (std::size_t m = 0; m < 2; ++m) {
        const MeshGradient& mesh = together.meshes[m];
        CHECK(block_error({"positions", flat(mesh.positions), positions[m]}, 1e-5) < 1e-5);
        CHECK(block_error({"colors", flat(mesh.colors), colors[m]}, 1e-5) < 1e-5);
        positions[m][0] += 1e-4 * norm(positions[m]);
        CHECK(block_error({"positions", flat(mesh.positions), positions[m]}, 1e-5) > 1e-5);
      }
      CHECK(block_error({"sigma", {together.sigma}, {sigma}}, 1e-5) < 1e-4);
      CHECK(block_error({"gamma", {together.gamma}, {gamma}}, 1e-5) < 1e-4);
    }
  }

  TEST_CASE("determinism: the memory budget changes no bit of images and gradients") {
    const int count = reduced(3, 2);
    for (Scene scene : {test_scene(), sampled_scene(), joint_scene()}) {
      scene.meshes.push_back({make_cube(), placed(70.0F, 0.4F, {0.9F, 0.4F, 0.2F})});
      Device device = open_device();
      Renderer renderer(device);
      renderer.set_scene(scene);
      const std::vector<View> views(static_cast<std::size_t>(count), renderer.views()[0]);
      renderer.set_views(views);
      const std::vector<Image> grads(views.size(), random_image(scene.width, scene.height, -1.0F, 1.0F));
      renderer.forward();
      CHECK(renderer.statistics().bands == 1);
      const Image whole = renderer.image(views.size() - 1);
      const SceneGradient gradient = renderer.backward(grads);

      std::size_t most_bands = 1, least_bytes = renderer.statistics().device_bytes;
      std::string refusal;
      for (std::size_t budget = 2 * fragment_memory(impl_of(renderer)); refusal.empty();
           budget -= budget / 3) {
        device.set_memory_budget(budget);
        Renderer banded(device);
        banded.set_scene(scene);
        banded.set_views(views);
        try {
          banded.forward();
        } catch (const InvalidArgument& error) {
          refusal = error.what();
          continue;
        }
        CHECK(same_bits(banded.image(views.size() - 1), whole));
        CHECK(same_bits(banded.backward(grads), gradient));
        CHECK(same_bits(banded.backward(grads), gradient));
        CHECK(same_bits(banded.image(views.size() - 1), whole));
        CHECK(fragment_memory(impl_of(banded)) <= budget);
        most_bands = std::max(most_bands, banded.statistics().bands);
        least_bytes = std::min(least_bytes, banded.statistics().device_bytes);
      }
      // More than rows of tiles: rows have been cut. The small frames have one tile a row that holds
      // fragments.
      CHECK(most_bands >=
            views.size() * impl_of(renderer).frame.tiles_y + static_cast<std::size_t>(reduced(1, 0)));
      CHECK(least_bytes < renderer.statistics().device_bytes);
      CHECK(dpr::test::contains(refusal, "memory budget (frame)"));
      CHECK(dpr::test::contains(refusal, "for the fragments of one tile"));
      // A renderer that was refused renders again once it may.
      device.set_memory_budget(std::size_t{1} << 30);
      renderer.forward();
      CHECK(same_bits(renderer.image(views.size() - 1), whole));
    }
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, open_device().set_memory_budget(0), "memory budget");
  }

  TEST_CASE("determinism: pieces replaced one by one equal a fresh scene") {
    const Device device = open_device();
    Scene scene = test_scene();
    scene.meshes.push_back({make_cube(), placed(70.0F, 0.4F, {0.9F, 0.4F, 0.2F})});
    Renderer renderer(device);
    renderer.set_scene(scene);
    const Result before = render(renderer);

    std::vector<glm::vec3>& positions = scene.meshes[1].mesh.positions;
    for (glm::vec3& position : positions) position = 1.1F * position + glm::vec3(0.05F, -0.02F, 0.1F);
    renderer.set_positions(1, positions);
    const Result moved = render(renderer);
    CHECK(same_bits(moved, render(device, scene)));
    CHECK_FALSE(same_bits(moved, before));

    Mesh& mesh = scene.meshes[0].mesh;
    std::vector<glm::vec3>& colors = mesh.vertex_colors.empty() ? mesh.face_colors : mesh.vertex_colors;
    for (glm::vec3& color : colors) color = glm::vec3(1) - color * color;
    renderer.set_colors(0, colors);
    const Result colored = render(renderer);
    CHECK(same_bits(colored, render(device, scene)));
    CHECK_FALSE(same_bits(colored, moved));

    for (Smoothing smoothing : {smoothing_preset("softras"), smoothing_preset("joint_gaussian"),
                                smoothing_preset("paper_cauchy"), smoothing_preset("gaussian")}) {
      smoothing.sigma *= 2;
      smoothing.distance = DistanceMetric::squared;
      scene.smoothing = smoothing;
      renderer.set_smoothing(smoothing);
      CHECK(same_bits(render(renderer), render(device, scene)));
    }

    View view{renderer.views()[0]};
    view.camera.view[3].x += 0.2F;
    scene.camera = view.camera;
    renderer.set_views(std::span(&view, 1));
    CHECK(same_bits(render(renderer), render(device, scene)));

    // A second scene in the same renderer leaves nothing of the first.
    const Scene other = joint_scene();
    renderer.set_scene(other);
    CHECK(same_bits(render(renderer), render(device, other)));
  }
}

}  // namespace determinism_test
