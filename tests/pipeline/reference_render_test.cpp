// The exact renderer end to end against the serial reference in double precision: images, losses and every
// block of gradients, over shapes, cameras, image sizes, lights, priors, compositions and metrics.
#include <doctest/doctest.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/reference_comparison.hpp"
#include "pipeline/scenes.hpp"
#include "support/reduced.hpp"

namespace reference_render_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

// Tolerances. The Cauchy prior's heavy tails cost digits.
constexpr double k_image_largest = 1e-4;
constexpr double k_image_mean = 1e-6;
constexpr double k_block = 1e-3;
constexpr double k_sensitivity = 1e-2;
constexpr double k_cauchy_slack = 10;

double slack_of(const Smoothing& s) {
  return s.occupancy_prior == Prior::cauchy || s.depth_prior == Prior::cauchy ? k_cauchy_slack : 1;
}

double tolerance_of(const Block& block, const Smoothing& smoothing) {
  return (is_sensitivity(block.name) ? k_sensitivity : k_block) * slack_of(smoothing);
}

/// The worst figures of many scenes: by block, in units of the tolerance too.
class Worst {
 public:
  void add(const std::string& what, const std::string& scene, double error, double tolerance) {
    Entry& entry = entries_[what];
    if (error / tolerance < entry.share) return;
    entry = {error, error / tolerance, scene};
  }
  std::string text() const {
    std::string text;
    for (const auto& [what, entry] : entries_) {
      char line[160];
      std::snprintf(line, sizeof line, "%-20s %.2e, %.3f of the tolerance: %s\n", what.c_str(), entry.error,
                    entry.share, entry.scene.c_str());
      text += line;
    }
    return text;
  }

 private:
  struct Entry {
    double error = 0, share = 0;
    std::string scene;
  };
  std::map<std::string, Entry> entries_;
};

/// Renders a scene twice and compares image and gradients for a random derivative of the image.
void check_scene(const Device& device, const std::string& name, const Scene& scene, Worst& worst) {
  CAPTURE(name);
  const reference::Scene twin = to_reference(scene);
  const Delicate delicate = delicate_pixels(twin);
  const auto pixels = static_cast<double>(delicate.kink.size());
  CHECK(static_cast<double>(std::ranges::count(delicate.kink, true)) <= 0.02 * pixels);

  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  const double slack = slack_of(scene.smoothing);
  const ImageError image = image_error(renderer.image(), reference::render(twin), delicate);
  CHECK(image.largest < k_image_largest * slack);
  CHECK(image.mean < k_image_mean * slack);
  worst.add("image, largest", name, image.largest, k_image_largest * slack);
  worst.add("image, mean", name, image.mean, k_image_mean * slack);

  const Image grad_image = smooth_grad_image(scene, delicate);
  const SceneGradient found = renderer.backward(std::span(&grad_image, 1));
  for (const Block& block : blocks_of(found, reference::gradient(twin, to_reference(grad_image)))) {
    CAPTURE(block.name);
    const double tolerance = tolerance_of(block, scene.smoothing);
    const double error = block_error(block, tolerance);
    CAPTURE(norm(block.expected));
    CHECK(error < tolerance);
    worst.add(block.name, name, error, tolerance);
  }
}

using NamedScene = std::pair<std::string, Scene>;

void check_scenes(const std::vector<NamedScene>& scenes) {
  const Device device = open_device();
  Worst worst;
  for (const auto& [name, scene] : scenes) check_scene(device, name, scene, worst);
  MESSAGE("worst of " << scenes.size() << " scenes:\n" << worst.text());
}

Scene with_composition(Scene scene, Composition composition) {
  scene.smoothing.composition = composition;
  return scene;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("reference: shapes, soups, degenerate and huge triangles, two meshes") {
    const int size = reduced(20, 9);
    std::vector<NamedScene> scenes{{"cube", cube_scene(size, size)},
                                   {"odd triangles", odd_scene(size, size)}};
    if (reduced(1, 0) == 1) {
      scenes.emplace_back("icosphere", scene_of(make_icosphere(2, 1.4F), size, size));
      scenes.emplace_back("torus", scene_of(make_torus(1.1F, 0.45F, 17, 9), size, size));
      scenes.emplace_back("soup", scene_of(random_soup(60, 3), size, size));
      Scene two = scene_of(make_cube(), size, size);
      two.meshes[0].transform = placed(50.0F, 0.8F, {-0.4F, 0.2F, 0.1F});
      two.meshes.push_back({make_icosphere(1), placed(-31.0F, 0.7F, {0.6F, -0.1F, 0.3F})});
      scenes.emplace_back("two meshes", two);
    }
    const std::size_t shapes = scenes.size();
    for (std::size_t i = 0; i < shapes; ++i) {
      scenes.emplace_back(scenes[i].first + ", joint",
                          with_composition(scenes[i].second, Composition::joint));
    }
    check_scenes(scenes);
  }

  TEST_CASE("reference: image sizes, views partly outside the image, intrinsics") {
    std::vector<NamedScene> scenes;
    const std::vector<std::pair<int, int>> sizes =
        reduced(1, 0) == 1 ? std::vector<std::pair<int, int>>{{37, 53}, {53, 19}, {8, 8}, {1, 1}, {65, 3}}
                           : std::vector<std::pair<int, int>>{{9, 5}};
    for (const auto& [width, height] : sizes) {
      const std::string name = std::to_string(width) + "x" + std::to_string(height);
      scenes.emplace_back(name, cube_scene(width, height));
      Scene& outside = scenes.emplace_back(name + ", partly outside", cube_scene(width, height)).second;
      outside.camera.view[3] += glm::vec4(1.3F, -0.9F, 1.1F, 0.0F);
      outside.smoothing.composition = Composition::joint;
      Scene& intrinsics = scenes.emplace_back(name + ", intrinsics", cube_scene(width, height)).second;
      const auto side = static_cast<float>(std::min(width, height));
      intrinsics.camera.intrinsics = {1.27F * side, 1.13F * side, 0.61F * static_cast<float>(width),
                                      0.42F * static_cast<float>(height)};
    }
    check_scenes(scenes);
  }

  TEST_CASE("reference: lenses that distort, and orthographic cameras") {
    const int width = reduced(37, 9), height = reduced(29, 7);
    std::vector<NamedScene> scenes;
    const auto add = [&](const std::string& name, Scene scene) -> Scene& {
      return scenes.emplace_back(name, std::move(scene)).second;
    };
    const Distortion barrel{-0.31F, 0.12F, 0.01F, -0.02F, 0.03F}, pincushion{0.2F, 0.0F, -0.01F, 0.0F, 0.0F};
    Scene& cube = add("barrel", cube_scene(width, height));
    cube.camera.fov_y_degrees = 35;
    cube.camera.distortion = barrel;
    const auto side = static_cast<float>(std::min(width, height));
    Scene& sphere =
        add("pincushion, intrinsics, lights", scene_of(make_icosphere(reduced(1, 0), 1.3F), width, height));
    sphere.camera.intrinsics = {1.27F * side, 1.13F * side, 0.61F * static_cast<float>(width),
                                0.42F * static_cast<float>(height)};
    sphere.camera.distortion = pincushion;
    sphere.lights = two_lights(Shading::phong);
    sphere.gradients.lights = true;
    Scene& near = add("fisheye, lights", sphere);
    near.camera.distortion = fisheye(0.12F, -0.07F, 0.03F, -0.01F);
    Scene& orthographic = add("orthographic, joint", cube_scene(width, height));
    orthographic.camera.orthographic_height = 4.3F;
    orthographic.smoothing.composition = Composition::joint;
    for (const Shading shading : {Shading::phong, Shading::blinn, Shading::gouraud, Shading::microfacet}) {
      Scene& lit = add("orthographic, lit " + std::to_string(static_cast<int>(shading)),
                       scene_of(make_icosphere(reduced(1, 0), 1.3F), width, height));
      lit.camera.orthographic_height = 3.6F;
      lit.lights = every_light(shading);
      lit.meshes[0].mesh.materials = materials_for(shading);
      lit.gradients.lights = true;
    }
    Scene textured =
        textured_scene(make_cube(), random_texture(5, 3, Wrap::repeat, Filter::bilinear), width, height);
    textured.camera.orthographic_height = 4.3F;
    add("orthographic, texture", textured);
    Scene cut = scene_cut_open(make_cube(), width, height);
    cut.camera.orthographic_height = 3.1F;
    add("orthographic, near plane", cut);
    textured.camera = cut.camera;
    add("orthographic, near plane, texture", textured);
    for (auto& [name, scene] : scenes) scene.gradients.distortion = true;
    check_scenes(scenes);
  }

  TEST_CASE("reference: what the near plane leaves of a face is distorted") {
    const int size = reduced(31, 7);
    Scene cut = scene_cut_open(make_cube(), size, size);
    cut.camera.distortion = Distortion{-0.2F, 0.05F, 0.01F, -0.02F, 0.0F};
    cut.gradients.distortion = true;
    Scene fish = cut;
    fish.camera.distortion = fisheye(0.1F, -0.05F, 0.02F, -0.01F);
    check_scenes({{"barrel, near plane", cut}, {"fisheye, near plane", fish}});
  }

  TEST_CASE("reference: lights, metrics, interpolation, coloured faces, the preset gaussian") {
    const int size = reduced(30, 7);
    std::vector<NamedScene> scenes;
    for (const Shading shading : k_every_shading) {
      const std::string name = "shading " + std::to_string(static_cast<int>(shading));
      Scene& cube = scenes.emplace_back(name + ", cube", cube_scene(size, size)).second;
      cube.lights = every_light(shading);
      cube.meshes[0].mesh.materials = materials_for(shading);
      cube.gradients.lights = true;
      if (reduced(1, 0) == 0) continue;
      Scene& sphere =
          scenes.emplace_back(name + ", icosphere", scene_of(make_icosphere(1, 1.3F), size, size)).second;
      sphere.lights = two_lights(shading);
      sphere.meshes[0].mesh.materials = materials_for(shading);
      sphere.gradients.lights = true;
      sphere.smoothing.composition = Composition::joint;
    }
    Scene& euclidean = scenes.emplace_back("euclidean", cube_scene(size, size)).second;
    euclidean.smoothing.distance = DistanceMetric::euclidean;
    euclidean.smoothing.sigma = 0.03F;
    Scene& affine =
        scenes.emplace_back("not perspective correct", scene_of(make_torus(1.1F, 0.45F, 9, 7), size, size))
            .second;
    affine.perspective_correct = false;
    Scene& black =
        scenes.emplace_back("the preset gaussian, black background", cube_scene(size, size)).second;
    black.smoothing = smoothing_preset("gaussian");
    black.background = glm::vec3(0);
    Scene& alpha = scenes.emplace_back("alpha 0.4", cube_scene(size, size)).second;
    alpha.smoothing.alpha = 0.4F;
    Scene& white = scenes.emplace_back("no colours", cube_scene(size, size)).second;
    white.meshes[0].mesh.face_colors.clear();
    white.meshes[0].mesh.vertex_colors.clear();
    Scene& faces = scenes.emplace_back("face colours", scene_of(make_icosphere(1, 1.2F), size, size)).second;
    Mesh& mesh = faces.meshes[0].mesh;
    mesh.vertex_colors.clear();
    Random random(4);
    while (mesh.face_colors.size() < mesh.faces.size()) mesh.face_colors.push_back(random.vector(0.0F, 1.0F));
    check_scenes(scenes);
  }

  TEST_CASE("reference: textures of every wrap mode, filter and size, unlit and lit") {
    const int size = reduced(24, 7);
    std::vector<NamedScene> scenes;
    for (const Wrap wrap : {Wrap::repeat, Wrap::mirror, Wrap::clamp}) {
      for (const Filter filter : {Filter::nearest, Filter::bilinear}) {
        const std::string name = "wrap " + std::to_string(static_cast<int>(wrap)) + ", filter " +
                                 std::to_string(static_cast<int>(filter));
        scenes.emplace_back(name,
                            textured_scene(make_cube(), random_texture(5, 3, wrap, filter), size, size));
        if (reduced(1, 0) == 0) break;
        scenes.emplace_back(name + ", 1x1",
                            textured_scene(make_cube(), random_texture(1, 1, wrap, filter), size, size));
        scenes.emplace_back(name + ", 1x4", textured_scene(make_torus(1.1F, 0.45F, 9, 7),
                                                           random_texture(1, 4, wrap, filter), size, size));
      }
    }
    for (const Shading shading : k_every_shading) {
      Scene& lit =
          scenes
              .emplace_back("lit " + std::to_string(static_cast<int>(shading)),
                            textured_scene(make_cube(), random_texture(6, 5, Wrap::mirror, Filter::bilinear),
                                           size, size))
              .second;
      lit.lights = every_light(shading);
      lit.meshes[0].mesh.materials = materials_for(shading);
      lit.gradients.lights = true;
      lit.smoothing.composition = Composition::joint;
    }
    check_scenes(scenes);
  }

  TEST_CASE("reference: several textures, faces without one, and a mesh without any beside") {
    const int size = reduced(24, 7);
    std::vector<NamedScene> scenes;
    for (const bool is_lit : {false, true}) {
      Scene scene =
          textured_scene(make_cube(), random_texture(4, 4, Wrap::repeat, Filter::bilinear), size, size);
      Mesh& cube = scene.meshes[0].mesh;
      cube.textures.push_back(random_texture(3, 7, Wrap::clamp, Filter::bilinear, 9));
      for (std::uint32_t face = 0; face < cube.faces.size(); ++face)
        cube.face_textures.push_back(face % 3 == 2 ? k_no_texture : face % 3);
      scene.meshes[0].transform = placed(50.0F, 0.8F, {-0.4F, 0.2F, 0.1F});
      scene.meshes.push_back({make_icosphere(1), placed(-31.0F, 0.7F, {0.6F, -0.1F, 0.3F})});
      scene.meshes.push_back({textured(make_cube(), random_texture(2, 2, Wrap::mirror, Filter::nearest, 10)),
                              placed(11.0F, 0.4F, {0.1F, 0.9F, 0.2F})});
      if (is_lit) scene.lights = two_lights(Shading::phong);
      scene.gradients.lights = is_lit;
      scenes.emplace_back(is_lit ? "several, lit" : "several", scene);
    }
    check_scenes(scenes);
  }

  TEST_CASE("reference: every occupancy prior with every depth prior in both compositions") {
    const int size = reduced(16, 6);
    std::vector<NamedScene> scenes;
    for (const Prior occupancy : choices<Prior>()) {
      for (const Prior depth : dpr::test::k_sampled_priors) {
        if (reduced(1, 0) == 0 && occupancy != depth) continue;
        for (const Composition composition : {Composition::barrier, Composition::joint}) {
          Scene scene = scene_of(random_soup(14, 6), size, size);
          scene.smoothing.occupancy_prior = occupancy;
          scene.smoothing.depth_prior = depth;
          scene.smoothing.composition = composition;
          if (occupancy == Prior::cauchy) scene.smoothing.sigma = 3e-4F;
          if (occupancy == Prior::uniform) scene.smoothing.sigma = 2e-2F;
          scenes.emplace_back(std::string(to_string(occupancy)) + "/" + std::string(to_string(depth)) + " " +
                                  std::string(to_string(composition)),
                              scene);
        }
      }
    }
    check_scenes(scenes);
  }

  TEST_CASE("reference: faces that cross the near plane, from within, cut open, down to the horizon") {
    const int size = reduced(24, 7);
    std::vector<NamedScene> scenes{{"room", scene_within(make_cube(), size, size)},
                                   {"cube cut open", scene_cut_open(make_cube(), size, size)},
                                   {"floor", floor_scene(size, size)}};
    scenes.emplace_back("sphere from within", scene_within(make_icosphere(1, 1.3F), size, size));
    scenes.emplace_back("soup", scene_cut_open(random_soup(30, 3), size, size));
    const std::size_t shapes = scenes.size();
    for (std::size_t i = 0; i < shapes; ++i) {
      scenes.emplace_back(scenes[i].first + ", joint",
                          with_composition(scenes[i].second, Composition::joint));
    }
    for (const Shading shading : {Shading::flat, Shading::phong, Shading::gouraud}) {
      Scene& lit = scenes
                       .emplace_back("shading " + std::to_string(static_cast<int>(shading)),
                                     scene_cut_open(make_icosphere(1, 1.2F), size, size))
                       .second;
      lit.lights = two_lights(shading);
      lit.gradients.lights = true;
    }
    Scene& euclidean = scenes.emplace_back("euclidean", scene_cut_open(make_cube(), size, size)).second;
    euclidean.smoothing.distance = DistanceMetric::euclidean;
    euclidean.smoothing.sigma = 0.03F;
    Scene& affine = scenes.emplace_back("not perspective correct", floor_scene(size, size)).second;
    affine.perspective_correct = false;
    Scene& intrinsics = scenes.emplace_back("intrinsics", floor_scene(size, size)).second;
    const auto side = static_cast<float>(size);
    intrinsics.camera.intrinsics = {0.77F * side, 0.83F * side, 0.61F * side, 0.42F * side};
    Scene& textured =
        scenes
            .emplace_back(
                "texture",
                textured_scene(make_cube(), random_texture(5, 3, Wrap::repeat, Filter::bilinear), size, size))
            .second;
    textured.camera = scene_cut_open(make_cube(), size, size).camera;
    check_scenes(scenes);
  }

  TEST_CASE("reference: losses and their gradients") {
    const int size = reduced(25, 7);
    const Device device = open_device();
    Worst worst;
    for (const Composition composition : {Composition::barrier, Composition::joint}) {
      const Scene scene = with_composition(cube_scene(size, size), composition);
      const reference::Scene twin = to_reference(scene);
      REQUIRE(std::ranges::count(delicate_pixels(twin).kink, true) == 0);
      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.forward();
      const Image target = random_image(size, size, 0.0F, 1.0F, 9);
      for (const std::string_view kind : loss_names()) {
        if (kind == to_string(LossKind::ssim)) continue;  // ssim_test has images that hold its windows
        const std::string name = std::string(kind) + " " + std::string(to_string(composition));
        CAPTURE(name);
        ImageLoss loss(device, LossWeights::only(parse_loss(kind, "kind")), std::span(&target, 1));
        const reference::LossResult expected =
            reference::evaluate_loss(kind, reference::render(twin), to_reference(target));
        const double error = std::fabs(loss.evaluate(renderer) / expected.value - 1);
        CHECK(error < 1e-5);
        worst.add("loss", name, error, 1e-5);
        for (const Block& block :
             blocks_of(renderer.backward(loss), reference::gradient(twin, expected.grad_image))) {
          CAPTURE(block.name);
          const double tolerance = tolerance_of(block, scene.smoothing);
          CHECK(block_error(block, tolerance) < tolerance);
          worst.add(block.name, name, block_error(block, tolerance), tolerance);
        }
      }
    }
    MESSAGE("worst of 8 losses:\n" << worst.text());
  }

  TEST_CASE("reference: another scene is told apart, in the image and in every block") {
    const int size = reduced(24, 7);
    Scene scene = cube_scene(size, size);
    scene.lights = two_lights(Shading::phong);
    scene.gradients.lights = true;
    Scene other = scene;
    other.meshes[0].transform = placed(24.0F);
    other.smoothing.gamma *= 1.1F;
    other.smoothing.sigma *= 1.1F;
    Renderer renderer(open_device());
    renderer.set_scene(other);
    renderer.forward();
    const reference::Scene twin = to_reference(scene);
    const ImageError error = image_error(renderer.image(), reference::render(twin), delicate_pixels(twin));
    CHECK(error.largest > k_image_largest);
    CHECK(error.mean > k_image_mean);
    const Image grad_image = random_image(size, size, -1.0F, 1.0F);
    const SceneGradient found = renderer.backward(std::span(&grad_image, 1));
    for (Block& block : blocks_of(found, reference::gradient(twin, to_reference(grad_image)))) {
      // There are none: zero in both.
      if (block.name == "intrinsics" || block.name == "orthographic height" || block.name == "distortion")
        continue;
      CAPTURE(block.name);
      CHECK(block_error(block, tolerance_of(block, scene.smoothing)) > tolerance_of(block, scene.smoothing));
      block.found[0] = std::nan("");
      CHECK(block_error(block, 1.0) == INFINITY);
    }
    Image nan = renderer.image();
    nan.pixels[0].x = std::nanf("");
    CHECK_FALSE(image_error(nan, reference::render(twin), delicate_pixels(twin)).largest < k_image_largest);
  }

  TEST_CASE("reference: pixels at the blur radius and on edges are found") {
    // A triangle whose upper edge runs through the centres of row 2 of 8x8 pixels, its left edge a blur
    // radius to the right of column 1.
    Scene scene;
    scene.smoothing = smoothing_preset("gaussian");
    scene.width = scene.height = 8;
    const float distance = 2.0F, per_ndc = distance * std::tan(glm::radians(30.0F));
    const auto place = [&](float x, float y) { return glm::vec3(per_ndc * x, per_ndc * y, -distance); };
    const float radius = 0.05F;
    Mesh mesh;
    mesh.positions = {place(-0.625F + radius, -0.71F), place(0.8F, 0.375F), place(-0.625F + radius, 0.375F)};
    mesh.faces = {{0, 1, 2}};
    scene.meshes.push_back({mesh, glm::mat4(1.0F)});
    scene.smoothing.blur_radius = radius * radius;
    const Delicate delicate = delicate_pixels(to_reference(scene));
    CHECK(delicate.jump[8 * 4 + 1]);
    CHECK(delicate.kink[8 * 4 + 1]);
    CHECK(delicate.kink[8 * 2 + 3]);
    CHECK_FALSE(delicate.jump[8 * 2 + 3]);
    CHECK_FALSE(delicate.kink[8 * 3 + 3]);
    CHECK_FALSE(delicate.kink[8 * 7 + 7]);
  }
}

}  // namespace reference_render_test
