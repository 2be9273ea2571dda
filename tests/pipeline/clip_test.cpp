// Faces that cross the near plane in whole renders: nothing else changes, quadrilaterals have no seam, noise
// on the pixel follows the cut, gradients against differences.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/determinism.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/messages.hpp"

namespace clip_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

/// With a triangle of its own at three places of the camera's space.
Scene with_triangle(Scene scene, const std::vector<glm::vec3>& in_camera) {
  Mesh mesh;
  const glm::mat4 to_world = glm::inverse(scene.camera.view);
  for (const glm::vec3& corner : in_camera) mesh.positions.emplace_back(to_world * glm::vec4(corner, 1.0F));
  mesh.faces = {{0, 1, 2}};
  scene.meshes.push_back({mesh, glm::mat4(1.0F)});
  return scene;
}

std::size_t clipped_faces(const Renderer& renderer) {
  std::size_t count = 0;
  for (const shared::ClippedFace& face : impl_of(renderer).clip.faces.download()) count += face.corners != 0;
  return count;
}

/// Beside the image, and behind the camera.
Scene with_triangle_beside(const Scene& scene) {
  return with_triangle(scene, {{90, 90, -5}, {91, 90, -5}, {90, 91, -5}});
}
Scene with_triangle_behind(const Scene& scene) {
  return with_triangle(scene, {{0, 0, 5}, {1, 0, 5}, {0, 1, 5}});
}

Scene pixel_noise(Scene scene, float sigma = 2e-3F) {
  scene.smoothing = smoothing_preset("pixel", scene.width, scene.height);
  scene.smoothing.sigma = sigma;
  scene.smoothing.gamma = 1e-8F;
  return scene;
}

/// A solid cut open under a random lens of that model and random intrinsics.
Scene random_lens_scene(unsigned seed, LensModel model) {
  Random random(seed);
  Scene scene = scene_cut_open(seed % 2 == 0 ? welded_cube() : make_icosphere(1, 1.4F), reduced(32, 12),
                               reduced(26, 10));
  scene.camera.view = orbit_camera(2.2F, random(-40, 40), random(0, 360), random.vector(-0.1F, 0.1F)).view;
  const auto side = static_cast<float>(scene.height);
  scene.camera.intrinsics = {random(0.9F, 1.3F) * side, random(0.9F, 1.3F) * side,
                             random(0.45F, 0.55F) * static_cast<float>(scene.width),
                             random(0.45F, 0.55F) * side};
  scene.camera.distortion = {random(-0.2F, 0.2F), random(-0.05F, 0.05F), random(-0.02F, 0.02F),
                             random(-0.02F, 0.02F), random(-0.01F, 0.01F)};
  const Distortion& d = *scene.camera.distortion;
  if (model == LensModel::fisheye) scene.camera.distortion = fisheye(d.k1, d.k2, d.p1, d.p2);
  scene.gradients.distortion = true;
  return scene;
}

/// Central differences of the weighted image, by each number of the scene's camera.
std::vector<double> difference_of(Renderer& renderer, const Scene& scene, const Image& weights,
                                  const std::vector<std::function<float*(Camera&)>>& numbers, float step) {
  std::vector<double> differences;
  for (const auto& number : numbers) {
    double sum = 0;
    for (const float way : {step, -step}) {
      Scene moved = scene;
      *number(moved.camera) += way;
      renderer.set_scene(moved);
      renderer.forward();
      const Image image = renderer.image();
      for (std::size_t i = 0; i < image.pixels.size(); ++i)
        sum +=
            static_cast<double>(way) * glm::dot(glm::dvec4(image.pixels[i]), glm::dvec4(weights.pixels[i]));
    }
    differences.push_back(sum / (2.0 * static_cast<double>(step * step)));
  }
  return differences;
}

/// What a gradient is off from differences, relative to these.
double relative_error(std::vector<double> found, const std::vector<double>& differences) {
  const double scale = norm(differences);
  for (std::size_t i = 0; i < found.size(); ++i) found[i] -= differences[i];
  return norm(found) / scale;
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

std::vector<Scene> scenes_of_members() {
  return {test_scene(), joint_scene(), sampled_scene(), sampled_joint_scene(), pixel_noise(test_scene())};
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("clip: frames in which no face crosses the near plane are what they were, looked at or not") {
    const Device device = open_device();
    for (const Scene& scene : scenes_of_members()) {
      Renderer spared(device), searched(device);
      spared.set_scene(with_triangle_beside(scene));
      searched.set_scene(with_triangle_behind(scene));
      const Result a = render(spared), b = render(searched);
      CHECK(impl_of(spared).frame.clips == 0);
      CHECK(impl_of(searched).frame.clips == 1);
      CHECK(clipped_faces(searched) == 0);
      CHECK(same_bits(a.image, b.image));
      CHECK(a.gradient.meshes[0].positions == b.gradient.meshes[0].positions);
      CHECK(a.gradient.meshes[0].colors == b.gradient.meshes[0].colors);
    }
  }

  TEST_CASE("clip: rigid samples of a cut surface belong to one of its faces, along diagonals too") {
    // Faces of a plane: each sample in sight of it is covered once.
    Scene scene = floor_scene(reduced(61, 21), reduced(47, 18));
    for (const bool tilted : {false, true}) {
      if (tilted) scene.meshes[0].transform = placed(7.0F);
      scene.smoothing = smoothing_preset("rigid");
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      CHECK(clipped_faces(renderer) >= 4);
      const Image image = renderer.image();
      const std::vector<cl_uint> starts = impl_of(renderer).rasterize.pixel_starts.download();
      std::size_t covered = 0;
      for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        CHECK(starts[i + 1] - starts[i] <= 1);
        covered += starts[i + 1] - starts[i];
      }
      CHECK(covered > image.pixels.size() / 4);
      // Below the horizon and within its sides nothing is left out.
      const auto row = static_cast<std::size_t>(scene.height - 3);
      for (int column = scene.width / 4; column < scene.width * 3 / 4; ++column)
        CHECK(
            image.pixels[row * static_cast<std::size_t>(scene.width) + static_cast<std::size_t>(column)].w ==
            1);
    }
  }

  TEST_CASE("clip: from within a closed mesh every pixel is covered, with both noises") {
    for (const Mesh& mesh : {welded_cube(), make_icosphere(2, 1.4F)}) {
      const Scene scene = scene_within(mesh, reduced(40, 12), reduced(32, 10));
      Scene rigid = scene;
      rigid.smoothing = smoothing_preset("rigid");
      for (const Scene& each : {rigid, pixel_noise(scene)}) {
        Renderer renderer(open_device());
        renderer.set_scene(each);
        renderer.forward();
        CHECK(clipped_faces(renderer) > 0);
        for (const glm::vec4& pixel : renderer.image().pixels) CHECK(pixel.w > 0.9999F);
      }
    }
  }

  TEST_CASE("clip: cutting a triangle into clipped ones does not change the image") {
    // The part that a quadrilateral shows, and the same as a triangle that the plane does not reach.
    Scene whole = with_triangle(scene_of(make_cube(), reduced(40, 12), reduced(36, 11)),
                                {{-0.9F, -0.6F, -3.0F}, {0.8F, -0.5F, -3.5F}, {0.1F, 0.2F, 0.4F}});
    whole.meshes.erase(whole.meshes.begin());
    Scene apart = whole;
    const std::vector<glm::vec3>& p = whole.meshes[0].mesh.positions;
    // Divided along the way from the first corner to the middle of the opposite side, and without the tip.
    apart.meshes[0].mesh.positions = {p[0], p[1], p[2], 0.5F * (p[1] + p[2])};
    apart.meshes[0].mesh.faces = {{0, 1, 3}, {0, 3, 2}};
    whole.smoothing = apart.smoothing = smoothing_preset("rigid");
    CHECK(same_bits(render(open_device(), whole).image, render(open_device(), apart).image));
  }

  TEST_CASE("clip: bands, views and repeats give the same bits") {
    for (Scene scene : {scene_within(make_icosphere(2, 1.4F), reduced(48, 12), reduced(40, 10)),
                        pixel_noise(scene_cut_open(welded_cube(), reduced(40, 24), reduced(32, 20)))}) {
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      const Result first = render(renderer), again = render(renderer);
      CHECK(same_bits(first, again));
      const std::vector<View> views(3, {scene.camera, {scene.meshes[0].transform}});
      renderer.set_views(views);
      renderer.forward();
      for (std::size_t v = 0; v < views.size(); ++v) CHECK(same_bits(renderer.image(v), first.image));
      Device small = open_device();
      small.set_memory_budget(std::max<std::size_t>(renderer.statistics().fragments * 50 / 3, 28000));
      Renderer in_bands(small);
      in_bands.set_scene(scene);
      CHECK(same_bits(render(in_bands), first));
      CHECK(in_bands.statistics().bands > 1);
    }
  }

  TEST_CASE("clip: a corner that comes through the near plane changes the image little by little") {
    Scene scene = scene_of(make_cube(), reduced(40, 12), reduced(36, 11));
    const auto image_at = [&](float depth) {
      Scene one = with_triangle(scene, {{-0.9F, -0.6F, -3.0F}, {0.8F, -0.5F, -3.5F}, {0.1F, 0.2F, -depth}});
      one.meshes.erase(one.meshes.begin());
      return render(open_device(), one).image;
    };
    const Image beyond = image_at(1.0F + 1e-5F), on = image_at(1.0F), before = image_at(1.0F - 1e-5F);
    float largest = 0;
    for (std::size_t i = 0; i < on.pixels.size(); ++i) {
      for (const glm::vec4& d : {on.pixels[i] - beyond.pixels[i], on.pixels[i] - before.pixels[i]})
        largest = std::max({largest, std::abs(d.x), std::abs(d.y), std::abs(d.z), std::abs(d.w)});
    }
    CHECK(largest < 5e-3F);
  }

  TEST_CASE("clip: odd faces at the near plane are drawn without a number that is not finite") {
    Scene scene = scene_of(make_cube(), reduced(24, 9), reduced(20, 8));
    const float n = scene.camera.znear;
    const std::vector<std::vector<glm::vec3>> faces{
        {{0, 0, 0}, {0.5F, 0, -3}, {0, 0.5F, -3}},                 // a corner in the camera
        {{0, 0, -n}, {0.5F, 0, -n}, {0, 0.5F, 3}},                 // an edge on the plane, the rest before it
        {{0, 0, -n}, {0.5F, 0, -n}, {0, 0.5F, -n}},                // all of it on the plane
        {{0.1F, 0, 1}, {0.1F, 0, 1}, {0.1F, 0.5F, -3}},            // no area
        {{-1e6F, -1e6F, 3}, {1e6F, -1e6F, -9}, {0, 1e6F, -9}},     // far larger than the image
        {{0.2F, 0, 1}, {0.2F + 1e-6F, 0, 1}, {0.3F, 0.5F, -3}},    // thinner than a pixel
        {{0, -1, 100}, {1e-3F, -1, 100}, {0, 1, -n * 1.000001F}},  // hardly beyond the plane
        {{0.4F, 0.1F, 0}, {0.5F, 0.1F, 0}, {0.4F, 0.4F, -2}}};     // an edge in the camera's plane
    for (const auto& face : faces) scene = with_triangle(scene, face);
    for (const bool of_pixel : {false, true}) {
      const Scene each = of_pixel ? pixel_noise(scene) : scene;
      Renderer renderer(open_device());
      renderer.set_scene(each);
      const Result found = render(renderer);  // backward() throws where a gradient is not finite
      for (const glm::vec4& pixel : found.image.pixels)
        CHECK(std::isfinite(pixel.x + pixel.y + pixel.z + pixel.w));
      CHECK(clipped_faces(renderer) >= 4);
    }
  }

  TEST_CASE("clip: gradients of intrinsics and of a lens that moves cuts are those of differences") {
    using Number = std::function<float*(Camera&)>;
    const std::vector<Number> intrinsics{
        [](Camera& c) { return &c.intrinsics->fx; }, [](Camera& c) { return &c.intrinsics->fy; },
        [](Camera& c) { return &c.intrinsics->cx; }, [](Camera& c) { return &c.intrinsics->cy; }};
    const std::vector<Number> lens{
        [](Camera& c) { return &c.distortion->k1; }, [](Camera& c) { return &c.distortion->k2; },
        [](Camera& c) { return &c.distortion->p1; }, [](Camera& c) { return &c.distortion->p2; },
        [](Camera& c) { return &c.distortion->k3; }};
    const std::vector<Number> fisheye_lens{lens[0], lens[1], lens[4],
                                           [](Camera& c) { return &c.distortion->k4; }};
    const Device device = open_device();
    for (const auto& [model, of_pixel] :
         {std::pair{LensModel::brown, false}, {LensModel::brown, true}, {LensModel::fisheye, false}}) {
      const auto& numbers = model == LensModel::fisheye ? fisheye_lens : lens;
      CAPTURE(static_cast<int>(model));
      CAPTURE(of_pixel);
      if (of_pixel && dpr::test::is_reduced()) continue;  // ten pixels are too few for its gradients
      // Longer ones see jumps of faces seen edge-on; noise of the pixel has kinks where samples change faces.
      const float step = of_pixel ? 1e-3F : 1e-4F;
      std::vector<double> of_intrinsics, of_lens;
      for (unsigned seed = 0; seed < static_cast<unsigned>(reduced(10, 2)); ++seed) {
        Scene scene = random_lens_scene(seed, model);
        if (of_pixel) {
          scene = pixel_noise(scene, 2e-2F);
          scene.smoothing.supersampling = 4;
        }
        Renderer renderer(device);
        renderer.set_scene(scene);
        renderer.forward();
        CHECK(clipped_faces(renderer) > 0);
        const Image weights = random_image(scene.width, scene.height, -1.0F, 1.0F);
        const CameraGradient found = renderer.backward({&weights, 1}).views[0].camera;
        of_intrinsics.push_back(
            relative_error({found.intrinsics.begin(), found.intrinsics.end()},
                           difference_of(renderer, scene, weights, intrinsics, 20 * step)));
        const std::vector<double> found_lens =
            model == LensModel::fisheye
                ? std::vector<double>(found.fisheye.begin(), found.fisheye.end())
                : std::vector<double>(found.distortion.begin(), found.distortion.end());
        of_lens.push_back(relative_error(found_lens, difference_of(renderer, scene, weights, numbers, step)));
      }
      MESSAGE("median errors: intrinsics " << median(of_intrinsics) << ", distortion " << median(of_lens));
      const double tolerance = of_pixel ? 3e-2 : 6e-3;
      CHECK(median(of_intrinsics) < tolerance);
      CHECK(median(of_lens) < tolerance);
    }
  }

  TEST_CASE("clip: of moved meshes and views' own shapes it is known that they cross the plane") {
    const Scene scene = scene_of(make_cube(), reduced(24, 9), reduced(20, 8));
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    CHECK(impl_of(renderer).frame.clips == 0);
    std::vector<glm::vec3> large = scene.meshes[0].mesh.positions;
    for (glm::vec3& p : large) p *= 5.0F;
    renderer.set_positions(0, large);
    const Image moved = render(renderer).image;
    CHECK(clipped_faces(renderer) > 0);
    renderer.set_positions(0, scene.meshes[0].mesh.positions);
    renderer.forward();
    CHECK(impl_of(renderer).frame.clips == 0);
    renderer.set_shapes(large, {});
    renderer.forward();
    CHECK(same_bits(renderer.image(), moved));
    renderer.set_views(std::vector<View>{{scene.camera, {scene.meshes[0].transform}}});
    renderer.forward();
    CHECK(impl_of(renderer).frame.clips == 0);
  }
}

}  // namespace clip_test
