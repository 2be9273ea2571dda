// Misuse of the library, and input at the limits: every mistake is an error that names the argument and
// changes nothing; what cannot be seen gives the background and zero gradients; no smoothing gives a NaN.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace api_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

constexpr float k_nan = std::numeric_limits<float>::quiet_NaN();
constexpr float k_infinity = std::numeric_limits<float>::infinity();

bool is_finite(const Image& image) {
  for (const glm::vec4& p : image.pixels) {
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z) || !std::isfinite(p.w))
      return false;
  }
  return true;
}

bool is_finite(const SceneGradient& gradient) {
  for (const Block& block : blocks_of(gradient)) {
    for (const double v : block.found) {
      if (!std::isfinite(v)) return false;
    }
  }
  return true;
}

bool has_background(const Image& image, const glm::vec3& background, float rounding = 0) {
  return std::ranges::all_of(image.pixels, [&](const glm::vec4& p) {
    return glm::all(glm::lessThanEqual(glm::abs(p - glm::vec4(background, 0.0F)), glm::vec4(rounding)));
  });
}

/// Every block but that of the background colour.
bool is_zero(const SceneGradient& gradient, double rounding = 0) {
  for (const Block& block : blocks_of(gradient)) {
    if (block.name != "background" && norm(block.found) > rounding) return false;
  }
  return true;
}

struct Result {
  Image image;
  SceneGradient gradient;
};

Result render(Renderer& renderer, const Scene& scene) {
  renderer.set_scene(scene);
  renderer.forward();
  const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
  return {renderer.image(), renderer.backward(std::span(&grad, 1))};
}

Scene small_scene() {
  const int size = reduced(16, 5);
  return cube_scene(size, size);
}

/// A change that makes a scene wrong, and what the error must name.
struct Mistake {
  std::string named;
  std::function<void(Scene&)> make;
};

std::vector<Mistake> scene_mistakes() {
  return {
      {"width", [](Scene& s) { s.width = 0; }},
      {"height", [](Scene& s) { s.height = -3; }},
      {"width", [](Scene& s) { s.width = 1 << 30; }},
      {"meshes", [](Scene& s) { s.meshes.clear(); }},
      {"faces", [](Scene& s) { s.meshes[0].mesh = Mesh{}; }},
      {"faces[3]", [](Scene& s) { s.meshes[0].mesh.faces[3].y = 24; }},
      {"positions[5]", [](Scene& s) { s.meshes[0].mesh.positions[5].x = k_nan; }},
      {"colors", [](Scene& s) { s.meshes[0].mesh.face_colors.resize(2); }},
      {"transform", [](Scene& s) { s.meshes[0].transform[1] = s.meshes[0].transform[0]; }},
      {"transform", [](Scene& s) { s.meshes[0].transform[3].x = k_infinity; }},
      {"view", [](Scene& s) { s.camera.view = glm::mat4(0.0F); }},
      {"view", [](Scene& s) { s.camera.view[0][3] = 0.5F; }},
      {"fov_y_degrees", [](Scene& s) { s.camera.fov_y_degrees = 180.0F; }},
      {"fx",
       [](Scene& s) {
         s.camera.intrinsics = Intrinsics{0, 1, 0, 0};
       }},
      {"znear", [](Scene& s) { s.camera.znear = 0.0F; }},
      {"zfar", [](Scene& s) { s.camera.zfar = s.camera.znear; }},
      {"background", [](Scene& s) { s.background.y = k_nan; }},
      {"shininess",
       [](Scene& s) {
         s.lights = Lights{};
         s.lights->shininess = 0.5F;
       }},
      {"position",
       [](Scene& s) {
         s.lights = Lights{};
         s.lights->point.push_back({glm::vec3(k_nan)});
       }},
  };
}

struct SmoothingMistake {
  std::string named;
  std::function<void(Smoothing&)> make;
};

std::vector<SmoothingMistake> smoothing_mistakes() {
  return {
      {"sigma", [](Smoothing& s) { s.sigma = 0; }},
      {"sigma", [](Smoothing& s) { s.sigma = k_nan; }},
      {"sigma", [](Smoothing& s) { s.sigma = k_infinity; }},
      {"gamma", [](Smoothing& s) { s.gamma = -1e-3F; }},
      {"alpha", [](Smoothing& s) { s.alpha = 0; }},
      {"samples", [](Smoothing& s) { s.samples = 0; }},
      {"samples", [](Smoothing& s) { s.samples = (1U << 20U) + 1; }},
      {"occupancy_threshold", [](Smoothing& s) { s.occupancy_threshold = 0.5F; }},
      {"blur_radius", [](Smoothing& s) { s.blur_radius = -1.0F; }},
      {"background_depth", [](Smoothing& s) { s.background_depth = k_nan; }},
      {"occupancy_width", [](Smoothing& s) { s.occupancy_width = OccupancyWidth::variable; }},
      {"occupancy_estimator",
       [](Smoothing& s) {
         s.occupancy_prior = Prior::uniform;
         s.occupancy_estimator = Estimator::monte_carlo;
       }},
      {"aggregation_estimator",
       [](Smoothing& s) {
         s.depth_prior = Prior::uniform;
         s.aggregation_estimator = Estimator::monte_carlo;
       }},
      {"aggregation_estimator",
       [](Smoothing& s) {
         s.composition = Composition::joint;
         s.aggregation_estimator = Estimator::monte_carlo;
       }},
  };
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("api: nothing works before set_scene, no image before forward") {
    const Device device = open_device();
    Renderer renderer(device);
    const View view{};
    const Image grad(4, 4);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.forward(), "set_scene");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_views(std::span(&view, 1)), "set_scene");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_smoothing({}), "set_scene");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_positions(0, {}), "set_scene");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_colors(0, {}), "set_scene");
    ImageLoss loss(device, LossWeights::only(LossKind::mse), std::span(&grad, 1));
    const auto check_no_image = [&] {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.image(), "forward");
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.statistics(), "forward");
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward(std::span(&grad, 1)), "forward");
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward(loss), "forward");
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, loss.evaluate(renderer), "forward");
    };
    check_no_image();
    const Scene scene = small_scene();
    renderer.set_scene(scene);
    check_no_image();
    renderer.forward();
    CHECK(is_finite(renderer.image()));
    // A change of the scene ends the last image.
    renderer.set_positions(0, scene.meshes[0].mesh.positions);
    check_no_image();
    renderer.forward();
    renderer.set_smoothing(scene.smoothing);
    check_no_image();
  }

  TEST_CASE("api: every mistake in a scene or smoothing is named, and the old scene still renders") {
    const Device device = open_device();
    Renderer renderer(device);
    const Scene scene = small_scene();
    const Result before = render(renderer, scene);
    for (const Mistake& mistake : scene_mistakes()) {
      Scene wrong = scene;
      mistake.make(wrong);
      CAPTURE(mistake.named);
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(wrong), mistake.named);
      CHECK(renderer.image().pixels == before.image.pixels);  // not even the image is lost
    }
    for (const SmoothingMistake& mistake : smoothing_mistakes()) {
      Smoothing wrong = scene.smoothing;
      mistake.make(wrong);
      CAPTURE(mistake.named);
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_smoothing(wrong), mistake.named);
      Scene wrong_scene = scene;
      wrong_scene.smoothing = wrong;
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(wrong_scene), mistake.named);
    }
    CHECK(renderer.scene().smoothing.sigma == scene.smoothing.sigma);
    renderer.forward();
    CHECK(renderer.image().pixels == before.image.pixels);
    // The scene itself is no mistake.
    CHECK_NOTHROW(renderer.set_scene(scene));
  }

  TEST_CASE("api: what no estimator exists for is refused before anything is built") {
    Renderer renderer(open_device());
    Scene scene = small_scene();
    const Result before = render(renderer, scene);
    Smoothing uniform_depth = scene.smoothing;
    uniform_depth.depth_prior = Prior::uniform;
    uniform_depth.aggregation_estimator = Estimator::monte_carlo;
    CHECK_THROWS_AS(renderer.set_smoothing(uniform_depth), InvalidArgument);
    REQUIRE(renderer.scene().smoothing.depth_prior == scene.smoothing.depth_prior);
    renderer.forward();
    CHECK(renderer.image().pixels == before.image.pixels);
  }

  TEST_CASE("api: wrong views, indices, counts and numbers, one by one") {
    const Device device = open_device();
    Renderer renderer(device);
    const Scene scene = small_scene();
    const Result before = render(renderer, scene);
    const std::vector<glm::vec3>& positions = scene.meshes[0].mesh.positions;
    const std::vector<glm::vec3>& colors = scene.meshes[0].mesh.vertex_colors.empty()
                                               ? scene.meshes[0].mesh.face_colors
                                               : scene.meshes[0].mesh.vertex_colors;
    REQUIRE_FALSE(colors.empty());

    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.image(1), "view");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_views({}), "views");
    View view{scene.camera, {}};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_views(std::span(&view, 1)), "views[0].transforms");
    view.transforms = {glm::mat4(0.0F)};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_views(std::span(&view, 1)), "views[0].transforms[0]");
    std::vector<View> views(2, View{scene.camera, {glm::mat4(1.0F)}});
    views[1].camera.view = glm::mat4(0.0F);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_views(views), "view");

    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_positions(1, positions), "mesh");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_positions(0, std::span(positions).first(5)),
                          "positions");
    std::vector<glm::vec3> wrong = positions;
    wrong[7].z = k_infinity;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_positions(0, wrong), "positions[7]");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_colors(1, colors), "mesh");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_colors(0, std::span(colors).first(1)), "colors");
    wrong = colors;
    wrong[2].x = k_nan;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_colors(0, wrong), "colors[2]");
    const std::vector<glm::vec2> pairs(positions.size());
    const std::span<const glm::vec2> of_two = pairs;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_array({ArrayId::positions}, of_two), "another type");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_array({static_cast<ArrayId>(8)}, of_two), "ArrayId");

    const Image grad(scene.width, scene.height, glm::vec4(1));
    const std::vector<Image> two(2, grad);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward(std::span<const Image>{}), "grad_images");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward(two), "grad_images");
    const Image other_size(scene.width + 1, scene.height);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward(std::span(&other_size, 1)), "grad_images");
    for (const float value : {k_nan, k_infinity}) {
      Image bad = grad;
      bad.at(2, 1).w = value;
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward(std::span(&bad, 1)), "grad_images");
    }

    CHECK(renderer.image().pixels == before.image.pixels);
    renderer.forward();
    CHECK(renderer.image().pixels == before.image.pixels);
  }

  TEST_CASE("api: finite values whose sum is not are finite values") {
    Renderer renderer(open_device());
    const Scene scene = small_scene();
    render(renderer, scene);
    Image large(scene.width, scene.height);
    large.at(0, 0) = glm::vec4(3e38F, 3e38F, 0.0F, 0.0F);
    CHECK_NOTHROW(renderer.backward(std::span(&large, 1)));
    CHECK_NOTHROW(ImageLoss(renderer.device(), LossWeights::only(LossKind::l1), std::span(&large, 1)));
  }

  TEST_CASE("api: an image whose pixels are not as many as its size says is refused") {
    Renderer renderer(open_device());
    const Scene scene = small_scene();
    render(renderer, scene);
    Image grad(scene.width, scene.height);
    grad.pixels.emplace_back();
    CHECK_THROWS_AS(renderer.backward(std::span(&grad, 1)), InvalidArgument);
    CHECK_THROWS_AS(ImageLoss(renderer.device(), LossWeights::only(LossKind::mse), std::span(&grad, 1)),
                    InvalidArgument);
  }

  TEST_CASE("api: colours of a white mesh: it has none to replace") {
    Renderer renderer(open_device());
    Scene scene = small_scene();
    scene.meshes[0].mesh.vertex_colors.clear();
    scene.meshes[0].mesh.face_colors.clear();
    const Result before = render(renderer, scene);
    CHECK(before.gradient.meshes[0].colors.empty());
    const std::vector<glm::vec3> colors(24, glm::vec3(0.5F));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_colors(0, colors), "colors");
    CHECK_NOTHROW(renderer.set_colors(0, {}));
    renderer.forward();
    CHECK(renderer.image().pixels == before.image.pixels);
  }

  TEST_CASE("api: losses") {
    const Device device = open_device();
    Renderer renderer(device);
    const Scene scene = small_scene();
    render(renderer, scene);
    const Image target(scene.width, scene.height, glm::vec4(0.5F));
    const auto make = [&](LossWeights weights, const std::vector<Image>& targets) {
      return ImageLoss(device, weights, targets);
    };
    const LossWeights mse = LossWeights::only(LossKind::mse);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make({}, {target}), "weights");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make({-1, 1, 0}, {target}), "weight");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make({k_nan, 1, 0}, {target}), "weight");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make(mse, {}), "targets");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make(mse, {Image{}}), "target");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make(mse, {target, Image(3, 3)}), "target");
    Image bad = target;
    bad.at(1, 1).x = k_nan;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, make(mse, {bad}), "target");

    ImageLoss two_targets = make(mse, {target, target});
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, two_targets.evaluate(renderer), "targets");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward(two_targets), "loss");
    ImageLoss small = make(mse, {Image(2, 2)});
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, small.evaluate(renderer), "target");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward(small), "loss");

    ImageLoss loss = make(mse, {target});
    CHECK(loss.evaluate(renderer) > 0);
    CHECK(is_finite(renderer.backward(loss)));
  }

  TEST_CASE("api: losses of finite targets that single precision does not hold are refused") {
    const Device device = open_device();
    Renderer renderer(device);
    const int size = reduced(16, 11);  // a window of ssim
    render(renderer, cube_scene(size, size));
    const Image huge(size, size, glm::vec4(1e38F)), large(size, size, glm::vec4(1e17F));
    for (const LossKind kind :
         {LossKind::mse, LossKind::l1, LossKind::silhouette, LossKind::robust, LossKind::ssim}) {
      CAPTURE(to_string(kind));
      const LossWeights weights = LossWeights::only(kind);
      ImageLoss of_large(device, weights, {&large, 1}), of_huge(device, weights, {&huge, 1});
      CHECK(std::isfinite(of_large.evaluate(renderer)));
      CHECK(is_finite(renderer.backward(of_large)));
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, of_huge.evaluate(renderer), "single precision");
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward(of_huge), "loss");
      if (kind == LossKind::silhouette || kind == LossKind::ssim) continue;  // attributes have neither
      const std::vector<AttributeTarget> depth{{Attribute::depth, weights, {&huge, 1}}};
      ImageLoss of_depth(device, LossOptions{.attributes = depth}, {&large, 1});
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, of_depth.evaluate(renderer), "single precision");
    }
  }

  TEST_CASE("api: a loss that was not evaluated on the last image has no gradient to give") {
    const Device device = open_device();
    Renderer renderer(device);
    const Scene scene = small_scene();
    render(renderer, scene);
    const Image target(scene.width, scene.height, glm::vec4(0.5F));
    ImageLoss loss(device, LossWeights::only(LossKind::mse), std::span(&target, 1));
    CHECK_THROWS_AS(renderer.backward(loss), InvalidArgument);
    loss.evaluate(renderer);
    CHECK(is_finite(renderer.backward(loss)));
    renderer.forward();
    CHECK_THROWS_AS(renderer.backward(loss), InvalidArgument);
    Renderer other(device);
    render(other, scene);
    loss.evaluate(other);
    CHECK_THROWS_AS(renderer.backward(loss), InvalidArgument);
    CHECK_NOTHROW(other.backward(loss));
  }

  TEST_CASE("api: a renderer that was moved works on, and takes many scenes of other sizes") {
    const Device device = open_device();
    const Scene scene = small_scene();
    Renderer first(device);
    const Result before = render(first, scene);
    Renderer second(std::move(first));
    CHECK(second.image().pixels == before.image.pixels);
    for (const int size : {1, reduced(70, 11), 3}) {
      const Scene other = scene_of(random_soup(5, 2), size, size + 2);
      CHECK(is_finite(render(second, other).image));
    }
    CHECK(render(second, scene).image.pixels == before.image.pixels);
  }

  TEST_CASE("api: nothing to see is the background, with zero gradients") {
    Renderer renderer(open_device());
    const auto check_by = [&](Renderer& by, const Scene& scene, std::size_t visible) {
      const Result result = render(by, scene);
      // The blur of one colour is that colour but for rounding.
      const bool is_blurred = scene.smoothing.noise == Noise::pixel;
      CHECK(has_background(result.image, scene.background, is_blurred ? 1e-6F : 0.0F));
      CHECK(is_finite(result.gradient));
      CHECK(is_zero(result.gradient, is_blurred ? 2e-5 : 0));
      CHECK(norm(flat<glm::dvec3>({result.gradient.background})) > 0);
      CHECK(by.statistics().faces - by.statistics().faces_dropped == visible);
      CHECK(by.statistics().fragments == 0);
    };
    const auto check = [&](const std::string& name, Scene scene, std::size_t visible) {
      CAPTURE(name);
      for (const Noise noise : {Noise::triangle, Noise::pixel}) {
        CAPTURE(noise);
        for (const Composition composition : {Composition::barrier, Composition::joint}) {
          scene.smoothing.noise = noise;
          scene.smoothing.composition = composition;
          Renderer fresh(renderer.device());  // whose buffers hold nothing of frames before
          check_by(fresh, scene, visible);
          check_by(renderer, scene, visible);
        }
      }
    };
    Scene scene = small_scene();
    scene.lights = two_lights(Shading::phong);
    scene.gradients.lights = true;
    Scene behind = scene;
    behind.meshes[0].transform = placed(0.0F, 1.0F, 2.5F * glm::vec3(glm::inverse(scene.camera.view)[3]));
    check("behind the camera", behind, 0);
    Scene outside = scene;
    outside.meshes[0].transform = placed(0.0F, 1.0F, {0.0F, 40.0F, 0.0F});
    check("outside the image", outside, 0);
    Scene beyond = scene;
    beyond.camera.zfar = 2.0F;
    check("beyond zfar", beyond, 0);
    Scene inside = scene;
    inside.camera.view = glm::mat4(1.0F);  // within znear of every wall
    inside.camera.znear = 3.0F;
    check("around the camera", inside, 0);
    Scene degenerate = scene;
    for (glm::uvec3& face : degenerate.meshes[0].mesh.faces) face.z = face.x;
    check("degenerate", degenerate, 0);
    Scene point = scene;
    for (glm::vec3& position : point.meshes[0].mesh.positions) position = glm::vec3(0.1F);
    check("all in one point", point, 0);
    Scene lone = scene;
    lone.meshes[0].mesh.faces = {glm::uvec3(3, 3, 3)};
    lone.meshes[0].mesh.face_colors.resize(1);
    check("one face of one vertex", lone, 0);
    // The checkers tell what is seen.
    const Result seen = render(renderer, scene);
    CHECK_FALSE(has_background(seen.image, scene.background));
    CHECK_FALSE(is_zero(seen.gradient));
    CHECK(renderer.statistics().fragments > 0);
  }

  TEST_CASE(
      "api: a camera inside the mesh, faces through the camera, slivers and huge coordinates stay finite") {
    Renderer renderer(open_device());
    const auto check = [&](const std::string& name, Scene scene) {
      for (const Composition composition : {Composition::barrier, Composition::joint}) {
        CAPTURE(name);
        scene.smoothing.composition = composition;
        const Result result = render(renderer, scene);
        CHECK(is_finite(result.image));
        CHECK(is_finite(result.gradient));
      }
    };
    Scene inside = scene_of(make_icosphere(2, 4.0F), reduced(16, 5), reduced(16, 5));
    inside.camera.view = glm::mat4(1.0F);
    inside.lights = two_lights(Shading::phong);
    inside.gradients.lights = true;
    check("inside a sphere", inside);
    CHECK(renderer.statistics().fragments > 0);
    Scene sliver = small_scene();
    Mesh& mesh = sliver.meshes[0].mesh;
    mesh = {};
    const glm::vec3 a(-0.41F, 0.53F, 0.3F), b(0.62F, -0.23F, 0.1F);
    mesh.positions = {a, b, 0.5F * (a + b), a + glm::vec3(0, 1e-6F, 0), b + glm::vec3(1e-5F, 0, 0)};
    mesh.faces = {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}};
    check("slivers", sliver);
    Scene huge = small_scene();
    for (glm::vec3& position : huge.meshes[0].mesh.positions) position *= 1e18F;
    check("coordinates of 1e18", huge);
    Scene tiny = small_scene();
    for (glm::vec3& position : tiny.meshes[0].mesh.positions) position *= 1e-18F;
    check("coordinates of 1e-18", tiny);
  }

  TEST_CASE("api: extreme smoothing gives no NaN and no infinity, in any composition, prior or estimator") {
    const Device device = open_device();
    Renderer renderer(device);
    Scene scene = scene_of(random_soup(10, 4), reduced(12, 4), reduced(12, 4));
    std::size_t count = 0;
    std::vector<float> scales{1e-7F, 1e-3F, 1e3F};
    if (reduced(1, 0) == 0) scales = {1e-7F, 1e3F};
    const auto check = [&](Smoothing smoothing) {
      for (const float sigma : scales) {
        for (const float gamma : scales) {
          for (const float alpha : {1.0F, 1e-3F}) {
            for (const bool is_wide : {false, true}) {
              if (reduced(1, 0) == 0 && (is_wide || alpha < 1)) continue;
              smoothing.sigma = sigma;
              smoothing.gamma = gamma;
              smoothing.alpha = alpha;
              smoothing.blur_radius.reset();
              if (is_wide) smoothing.blur_radius = 100.0F;  // the whole image
              CAPTURE(to_string(smoothing.occupancy_prior));
              CAPTURE(to_string(smoothing.depth_prior));
              CAPTURE(to_string(smoothing.composition));
              CAPTURE(to_string(smoothing.aggregation_estimator));
              CAPTURE(sigma);
              CAPTURE(gamma);
              CAPTURE(alpha);
              CAPTURE(is_wide);
              scene.smoothing = smoothing;
              const Result result = render(renderer, scene);
              CHECK(is_finite(result.image));
              CHECK(is_finite(result.gradient));
              ++count;
            }
          }
        }
      }
    };
    for (const Prior prior : dpr::test::k_sampled_priors) {
      if (reduced(1, 0) == 0 && prior != Prior::gaussian) continue;
      Smoothing smoothing = smoothing_preset("gaussian");
      smoothing.occupancy_prior = smoothing.depth_prior = prior;
      check(smoothing);
      smoothing.composition = Composition::joint;
      if (prior != Prior::cauchy) check(smoothing);
      smoothing.composition = Composition::barrier;
      smoothing.occupancy_estimator = smoothing.aggregation_estimator = Estimator::monte_carlo;
      check(smoothing);
    }
    Smoothing uniform = smoothing_preset("gaussian");
    uniform.occupancy_prior = Prior::uniform;
    uniform.distance = DistanceMetric::euclidean;
    check(uniform);
    CHECK(count > 0);
    Image bad(2, 2);
    bad.at(1, 1).w = k_nan;
    CHECK_FALSE(is_finite(bad));
    SceneGradient infinite;
    infinite.gamma = std::numeric_limits<double>::infinity();
    infinite.views.resize(1);
    CHECK_FALSE(is_finite(infinite));
    MESSAGE(count << " combinations");
  }
}

}  // namespace api_test
