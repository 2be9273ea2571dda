// Batches of unlike scenes: to the bit what a renderer for each scene gives.
#include "dpr/scene_batch.hpp"

#include <doctest/doctest.h>

#include <cstring>
#include <limits>
#include <span>
#include <vector>

#include "dpr/dpr.hpp"
#include "dpr/opencl_handles.hpp"
#include "pipeline/determinism.hpp"
#include "pipeline/scenes.hpp"
#include "support/caller.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace dpr::test::pipeline::scene_batch_test {
namespace {

int width() { return reduced(24, 9); }
int height() { return reduced(19, 7); }

/// Meshes of other topologies, one with a texture, one twice, one lit; other cameras, backgrounds, smoothings
/// and requests; one draws samples.
std::vector<Scene> unlike_scenes() {
  std::vector<Scene> scenes{
      cube_scene(width(), height()), scene_of(make_icosphere(1), width(), height()),
      textured_scene(make_cube(), random_texture(4, 3, Wrap::clamp, Filter::bilinear), width(), height()),
      scene_of(random_soup(7, 3), width(), height())};
  scenes[0].lights = two_lights(Shading::phong);
  scenes[0].gradients.lights = true;
  scenes[1].camera = orbit_camera(4.0F, -20.0F, 80.0F);
  scenes[1].background = {0.9F, 0.1F, 0.4F};
  scenes[1].smoothing = smoothing_preset("pixel");
  scenes[1].meshes[0].transform = placed(10.0F, 0.7F, {0.5F, 0, 0});
  scenes[1].meshes.push_back({{}, placed(40.0F, 0.6F, {-0.8F, 0.1F, 0.3F}), 0});
  scenes[2].gradients.texture = true;
  scenes[3].smoothing = smoothing_preset("paper_gaussian");
  scenes[3].gradients.camera = false;
  return scenes;
}

std::vector<Image> random_images(std::size_t count) {
  std::vector<Image> images;
  for (std::size_t v = 0; v < count; ++v)
    images.push_back(random_image(width(), height(), -1.0F, 1.0F, 60 + static_cast<unsigned>(v)));
  return images;
}

std::vector<glm::vec4> joined(const std::vector<Image>& images) {
  std::vector<glm::vec4> pixels;
  for (const Image& image : images) pixels.insert(pixels.end(), image.pixels.begin(), image.pixels.end());
  return pixels;
}

/// Gradients of the scenes' own renderers, which have been rendered.
std::vector<SceneGradient> gradients_alone(std::vector<Renderer>& alone, std::span<const Image> weights) {
  std::vector<SceneGradient> gradients;
  for (Renderer& renderer : alone) {
    const std::size_t views = renderer.views().size();
    gradients.push_back(renderer.backward(weights.first(views)));
    weights = weights.subspan(views);
  }
  return gradients;
}

void check_same(const std::vector<SceneGradient>& found, const std::vector<SceneGradient>& expected) {
  REQUIRE(found.size() == expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    CAPTURE(i);
    CHECK(same_bits(found[i], expected[i]));
  }
}

std::vector<Renderer> renderers_of(const Device& device, std::span<const Scene> scenes) {
  std::vector<Renderer> renderers;
  for (const Scene& scene : scenes) renderers.emplace_back(device).set_scene(scene);
  return renderers;
}

/// Several views for one of the scenes.
std::vector<View> some_views(const Scene& scene) {
  std::vector<View> views;
  for (const float azimuth : {10.0F, 100.0F, 190.0F}) {
    Camera camera = orbit_camera(5.3F, 20.0F, azimuth);
    camera.zfar = 20.0F;
    views.push_back({camera, {scene.meshes[0].transform}});
  }
  return views;
}

TEST_SUITE("pipeline") {
  TEST_CASE("a batch gives what a renderer for each scene gives") {
    const std::vector<Scene> scenes = unlike_scenes();
    SceneBatch batch(open_device());
    batch.set_scenes(scenes);
    CHECK(batch.scenes() == 4);
    CHECK(batch.views() == 4);
    std::vector<Renderer> alone = renderers_of(batch.device(), scenes);
    for (int frame = 0; frame < 3; ++frame) {  // the first counts; the second has other views and shapes
      CAPTURE(frame);
      if (frame == 1) {
        std::vector<glm::vec3> moved = scenes[3].meshes[0].mesh.positions;
        for (glm::vec3& p : moved) p *= 1.2F;
        batch.renderer(3).set_positions(0, moved);
        alone[3].set_positions(0, moved);
        batch.renderer(2).set_views(some_views(scenes[2]));
        alone[2].set_views(some_views(scenes[2]));
        CHECK(batch.views() == 6);
      }
      batch.forward();
      std::size_t view = 0;
      for (Renderer& renderer : alone) {
        renderer.forward();
        for (std::size_t v = 0; v < renderer.views().size(); ++v)
          CHECK(same_bits(batch.image(view++), renderer.image(v)));
      }
      const std::vector<Image> weights = random_images(batch.views());
      const std::vector<SceneGradient> expected = gradients_alone(alone, weights);
      check_same(batch.backward(weights), expected);
      check_same(batch.backward_pixels(joined(weights)), expected);
    }
    CHECK(batch.statistics().faces == 12 + 2 * 80 + 3 * 12 + 7);
  }

  TEST_CASE("frames that outgrow their buffers are rendered again") {
    std::vector<Scene> scenes = unlike_scenes();
    scenes.resize(2);
    std::swap(scenes[0], scenes[1]);
    scenes[0].smoothing = scenes[1].smoothing;
    const auto far = [&](Scene scene) {
      scene.camera = orbit_camera(15.0F, 20.0F, 30.0F);
      scene.camera.zfar = 20.0F;
      return scene;
    };
    SceneBatch batch(open_device());
    batch.set_scenes(std::vector{far(scenes[0]), far(scenes[1])});
    batch.forward();
    static_cast<void>(batch.image(0));
    std::vector<Renderer> alone = renderers_of(batch.device(), scenes);
    for (std::size_t s = 0; s < 2; ++s) {
      const View near{scenes[s].camera, std::vector<glm::mat4>(scenes[s].meshes.size(), glm::mat4(1))};
      batch.renderer(s).set_views({&near, 1});
      alone[s].set_views({&near, 1});
    }
    batch.forward();
    for (std::size_t s = 0; s < 2; ++s) {
      alone[s].forward();
      CHECK(same_bits(batch.image(s), alone[s].image()));
    }
  }

  TEST_CASE("one loss with a target for every scene") {
    const std::vector<Scene> scenes = unlike_scenes();
    SceneBatch batch(open_device());
    batch.set_scenes(scenes);
    batch.forward();
    const std::vector<Image> targets = random_images(4);
    const LossWeights weights{.mse = 1.0F, .silhouette = 0.5F};
    ImageLoss loss(batch.device(), weights, targets);
    const double value = loss.evaluate(batch);
    const std::vector<SceneGradient> found = batch.backward(loss);
    double sum = 0;
    for (std::size_t s = 0; s < 4; ++s) {
      CAPTURE(s);
      Renderer alone(batch.device());
      alone.set_scene(scenes[s]);
      alone.forward();
      ImageLoss own(batch.device(), weights, std::span(&targets[s], 1));
      const double of_scene = own.evaluate(alone);
      CHECK(loss.per_view()[s] == doctest::Approx(of_scene));
      sum += of_scene;
      const std::vector<Block> of_one = blocks_of(alone.backward(own));
      std::vector<Block> of_batch = blocks_of(found[s]);
      REQUIRE(of_batch.size() == of_one.size());
      for (std::size_t b = 0; b < of_one.size(); ++b) {  // of a mean over four: a quarter
        CAPTURE(of_one[b].name);
        of_batch[b].expected = of_one[b].found;
        for (double& number : of_batch[b].expected) number /= 4;
        CHECK(block_error(of_batch[b], 1e-5) < 1e-5);
      }
    }
    CHECK(value == doctest::Approx(sum / 4));
  }

  TEST_CASE("a mesh's own loss joins in every scene") {
    const std::vector<Scene> scenes = unlike_scenes();
    SceneBatch batch(open_device());
    batch.set_scenes(scenes);
    batch.forward();
    ImageLoss loss(batch.device(), {.mse = 1}, random_images(4));
    loss.evaluate(batch);
    const std::vector<SceneGradient> of_images = batch.backward(loss);
    std::vector<MeshLoss> smooth;
    for (std::size_t s = 0; s < 4; ++s) {
      const MeshLossWeights weights{.edge_length = 0.1F * static_cast<float>(s + 1)};
      smooth.emplace_back(batch.device(), weights, scenes[s].meshes[0].mesh).evaluate(batch.renderer(s));
    }
    std::vector<const MeshLoss*> own{&smooth[0], &smooth[1], nullptr, &smooth[3]};
    std::vector<SceneGradient> found = batch.backward(loss, own);
    CHECK(same_bits(found[2], of_images[2]));
    own[2] = &smooth[2];
    found = batch.backward(loss, own);
    for (std::size_t s = 0; s < 4; ++s) {
      CAPTURE(s);
      Renderer alone(batch.device());
      alone.set_scene(scenes[s]);
      alone.forward();
      ImageLoss nothing(batch.device(), {.mse = 1}, std::vector{alone.image()});
      nothing.evaluate(alone);  // its gradient is 0
      smooth[s].evaluate(alone);
      Block block{"positions", flat(found[s].meshes[0].positions), flat(of_images[s].meshes[0].positions)};
      const std::vector<double> more = flat(alone.backward(nothing, smooth[s]).meshes[0].positions);
      CHECK(norm(more) > 1e-3);
      for (std::size_t i = 0; i < more.size(); ++i) block.expected[i] += more[i];
      CHECK(block_error(block, 1e-5) < 1e-5);
    }
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.backward(loss, own), "mesh_loss (backward)");
    own.pop_back();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.backward(loss, own), "one for each of the 4 scenes");
  }

  TEST_CASE("images and gradients by buffer") {
    const Caller caller;
    SceneBatch batch(adopt_device(caller.context(), caller.queue()));
    batch.set_scenes(unlike_scenes());
    batch.forward();
    std::vector<glm::vec4> pixels(batch.views() * static_cast<std::size_t>(width() * height()));
    batch.read_pixels(pixels);
    const BufferView view = image_view(batch);
    CHECK(view.count == pixels.size());
    const cl::Buffer images(view.buffer, true);
    const std::vector<float> floats = caller.read(images);
    CHECK(std::memcmp(floats.data(), pixels.data(), pixels.size() * sizeof(glm::vec4)) == 0);

    const std::vector<glm::vec4> weights = joined(random_images(batch.views()));
    const cl::Buffer grad = caller.buffer(weights);
    check_same(backward(batch, grad()), batch.backward_pixels(weights));
    const cl::Buffer short_one = caller.buffer(std::vector<float>(8));
    CHECK_THROWS_AS(static_cast<void>(backward(batch, short_one())), InvalidArgument);
  }

  TEST_CASE("a mesh without area beside a good one leaves that as it is") {
    const Scene good = scene_of(make_icosphere(1), width(), height());
    Scene collapsed = good;
    for (glm::vec3& position : collapsed.meshes[0].mesh.positions) position = glm::vec3(0.2F);
    for (const Noise noise : {Noise::triangle, Noise::pixel}) {
      std::vector<Scene> scenes{good, collapsed, good};
      for (Scene& scene : scenes) scene.smoothing.noise = noise;
      SceneBatch batch(open_device());
      batch.set_scenes(scenes);
      batch.forward();
      const std::vector<Image> grads = random_images(3);
      const std::vector<SceneGradient> found = batch.backward(grads);
      Renderer alone(batch.device());
      alone.set_scene(scenes[0]);
      alone.forward();
      for (const std::size_t s : {0, 2}) {
        CHECK(same_bits(batch.image(s), alone.image()));
        CHECK(same_bits(found[s], alone.backward(std::span(&grads[s], 1))));
      }
    }
  }

  TEST_CASE("a batch is used again for other scenes") {
    std::vector<Scene> scenes = unlike_scenes();
    SceneBatch batch(open_device());
    batch.set_scenes(scenes);
    batch.forward();
    std::swap(scenes[0], scenes[3]);
    scenes.pop_back();
    batch.set_scenes(scenes);
    batch.forward();
    std::vector<Renderer> alone = renderers_of(batch.device(), scenes);
    for (std::size_t s = 0; s < scenes.size(); ++s) {
      alone[s].forward();
      CHECK(same_bits(batch.image(s), alone[s].image()));
    }
    scenes.push_back(cube_scene(width(), height()));
    scenes.push_back(cube_scene(width(), height()));
    batch.set_scenes(scenes);
    CHECK(batch.scenes() == 5);
    batch.forward();
    CHECK(same_bits(batch.image(3), batch.image(4)));
  }

  TEST_CASE("what a batch refuses") {
    std::vector<Scene> scenes = unlike_scenes();
    SceneBatch batch(open_device());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.set_scenes({}), "scenes (SceneBatch): got none");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.forward(), "set_scenes() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.image(0), "forward() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.renderer(0), "scene (SceneBatch::renderer): got 0");
    scenes[2].width += 1;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.set_scenes(scenes), "size (scenes[2])");
    scenes[2].width -= 1;
    scenes[1].meshes[1].instance_of = 4;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.set_scenes(scenes), "scenes[1]: instance_of (meshes[1])");
    scenes[1].meshes[1].instance_of = 0;
    scenes[3].background.x = std::numeric_limits<float>::quiet_NaN();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.set_scenes(scenes), "scenes[3]: background");
    scenes[3].background.x = 0;
    batch.set_scenes(scenes);
    batch.forward();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.image(4), "below 4");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.backward(random_images(3)), "each of the 4 views");

    const std::vector<Image> targets = random_images(4);
    ImageLoss loss(batch.device(), {.mse = 1}, targets),
        of_three(batch.device(), {.mse = 1}, random_images(3));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, of_three.evaluate(batch), "each of the 4 views");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.backward(loss), "a loss evaluated on");
    const std::vector<Image> deep(4, Image(width(), height(), glm::vec4(1)));
    const std::vector<AttributeTarget> depths{{Attribute::depth, {.mse = 1}, deep}};
    ImageLoss with_depth(batch.device(), LossOptions{.weights = {.mse = 1}, .attributes = depths}, targets);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, with_depth.evaluate(batch), "none for a SceneBatch");
    loss.evaluate(batch);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.renderer(3).backward(loss), "a loss evaluated on");
    batch.renderer(1).forward();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.backward(loss), "scenes[1] (SceneBatch::backward)");
    Scene larger = scenes[0];
    larger.height += 2;
    batch.renderer(0).set_scene(larger);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.forward(), "size (scenes[1])");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, batch.image(0), "forward() first");
  }
}

}  // namespace
}  // namespace dpr::test::pipeline::scene_batch_test
