// Opacity of surfaces: images and gradients against the reference, against the expectation over surfaces that chance
// leaves out, and against closed form; what opaque scenes keep, and what is refused.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "check/adjoint.hpp"
#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "dpr/multi_device.hpp"
#include "dpr/scene_batch.hpp"
#include "dpr/subdivision.hpp"
#include "mesh/cluster_vertices.hpp"
#include "pipeline/reference_comparison.hpp"
#include "pipeline/scenes.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/temp_dir.hpp"

namespace opacity_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::message_of;
using dpr::test::reduced;

namespace {

GradientRequest with_opacities() {
  GradientRequest request;
  request.opacities = true;
  return request;
}

/// Two triangles that fill [-side, side]^2 at z = 0.
Mesh sheet(float side, const glm::vec3& color) {
  Mesh mesh;
  mesh.positions = {{-side, -side, 0}, {side, -side, 0}, {side, side, 0}, {-side, side, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  mesh.vertex_colors.assign(4, color);
  return mesh;
}

/// A sheet in front of a sphere: the opacity of the sheet's vertices differs, the sphere's faces have some too.
Scene sheet_and_sphere(Composition composition) {
  const int size = reduced(24, 9);
  Scene scene = scene_of(make_icosphere(reduced(1, 0)), size, size);
  scene.smoothing.composition = composition;
  Mesh front = sheet(1.3F, {0.9F, 0.3F, 0.1F});
  front.vertex_opacities = {0.5F, 0.35F, 0.6F, 0.8F};
  scene.meshes.push_back({front, placed(29.0F, 1.0F, {0.5F, 0.9F, 1.1F})});
  scene.meshes[0].mesh.face_opacities.assign(scene.meshes[0].mesh.faces.size(), 1.0F);
  for (std::size_t i = 0; i < scene.meshes[0].mesh.faces.size(); i += 3)
    scene.meshes[0].mesh.face_opacities[i] = 0.7F;
  scene.gradients = with_opacities();
  return scene;
}

/// Two half-transparent sheets that cross within the noise of depths.
Scene crossing_sheets(Composition composition) {
  const int size = reduced(24, 9);
  Mesh first = sheet(1.2F, {0.9F, 0.2F, 0.1F});
  first.vertex_opacities.assign(4, 0.5F);
  Scene scene = scene_of(first, size, size);
  scene.smoothing.composition = composition;
  Mesh second = sheet(1.2F, {0.1F, 0.3F, 0.9F});
  second.face_opacities = {0.4F, 0.6F};
  scene.meshes.push_back({second, placed(80.0F)});
  scene.gradients = with_opacities();
  return scene;
}

double largest_difference(const Image& a, const Image& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const glm::vec4 difference = glm::abs(a.pixels[i] - b.pixels[i]);
    for (int c = 0; c < 4; ++c) largest = std::max(largest, double(difference[c]));
  }
  return largest;
}

}  // namespace

TEST_SUITE("opacity") {
  TEST_CASE("opacity: images and gradients are the reference's, lit or not, in both compositions") {
    for (const Composition composition : {Composition::joint, Composition::barrier}) {
      const std::string name = composition == Composition::joint ? "joint" : "barrier";
      check_opacities(name + ", sheet and sphere", sheet_and_sphere(composition), "opacities", 0.1);
      check_opacities(name + ", crossing sheets, lit", lit(crossing_sheets(composition)), "opacities", 0.1);
      if (dpr::test::is_reduced()) continue;
      check_opacities(name + ", sheet and sphere, lit", lit(sheet_and_sphere(composition)), "opacities", 0.1);
      check_opacities(name + ", crossing sheets", crossing_sheets(composition), "opacities", 0.1);
    }
  }

  TEST_CASE(
      "opacity: in the joint composition the image is the expectation over faces that chance leaves out") {
    if (dpr::test::is_reduced()) return;  // nothing is launched that other cases do not launch
    Scene scene = crossing_sheets(Composition::joint);
    scene.meshes[0].mesh.vertex_opacities.clear();
    scene.meshes[0].mesh.face_opacities = {0.3F, 0.7F};
    const Image image = rendered(scene);
    std::vector<glm::dvec4> expected(image.pixels.size(), glm::dvec4(0));
    for (unsigned there = 0; there < 16; ++there) {  // bits: the four faces
      Scene opaque = scene;
      opaque.meshes.clear();
      double probability = 1;
      for (std::size_t m = 0; m < 2; ++m) {
        Instance part = scene.meshes[m];
        part.mesh.faces.clear();
        for (std::size_t f = 0; f < 2; ++f) {
          const bool is_there = (there >> (2 * m + f) & 1U) != 0;
          const double opacity = part.mesh.face_opacities[f];
          probability *= is_there ? opacity : 1 - opacity;
          if (is_there) part.mesh.faces.push_back(scene.meshes[m].mesh.faces[f]);
        }
        part.mesh.face_opacities.clear();
        if (!part.mesh.faces.empty()) opaque.meshes.push_back(part);
      }
      const Image drawn = opaque.meshes.empty() ? Image(scene.width, scene.height) : rendered(opaque);
      for (std::size_t i = 0; i < expected.size(); ++i)
        expected[i] += probability * (opaque.meshes.empty() ? glm::dvec4(scene.background, 0)
                                                            : glm::dvec4(drawn.pixels[i]));
    }
    double largest = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const glm::dvec4 difference = glm::abs(glm::dvec4(image.pixels[i]) - expected[i]);
      for (int c = 0; c < 4; ++c) largest = std::max(largest, difference[c]);
    }
    MESSAGE("largest difference from the expectation: " << largest);
    CHECK(largest < 1e-5);
  }

  TEST_CASE(
      "opacity: without noise surfaces are composited front to back, whatever their order in the scene") {
    const glm::vec3 near_color(0.9F, 0.2F, 0.1F), far_color(0.1F, 0.3F, 0.9F);
    Mesh near = sheet(2, near_color), far = sheet(2, far_color);
    near.vertex_opacities.assign(4, 0.25F);
    far.face_opacities.assign(2, 0.6F);
    Scene scene = scene_of(far, 8, 8);
    scene.meshes = {{far, glm::mat4(1)}, {near, placed(0, 1, {0, 0, 1})}};
    scene.camera = orbit_camera(6, 0, 0);
    scene.camera.zfar = 20;
    scene.smoothing = smoothing_preset("rigid");
    const glm::vec4 expected(0.25F * near_color + 0.75F * 0.6F * far_color + 0.75F * 0.4F * scene.background,
                             1 - 0.75F * 0.4F);
    for (const bool swaps : {false, true}) {
      if (swaps) std::swap(scene.meshes[0], scene.meshes[1]);
      CHECK(glm::distance(rendered(scene).pixels[3 * 8 + 4], expected) < 1e-5F);
    }
  }

  TEST_CASE("opacity: <u, J v> = <J^T u, v>, and differences") {
    for (const auto& [composition, is_of_pixel] :
         {std::pair(Composition::joint, false), {Composition::barrier, false}, {Composition::joint, true}}) {
      Renderer renderer(open_device());
      Scene scene = lit(sheet_and_sphere(composition));
      if (is_of_pixel) scene.smoothing = smoothing_preset("pixel", scene.width, scene.height);
      renderer.set_scene(scene);
      renderer.forward();
      Random random(7);
      const std::vector<Image> weights = random_images(renderer, random);
      SceneGradient gradient = renderer.backward(weights);
      const std::vector<Way> ways = random_ways(gradient, /*by_sigma*/ !is_of_pixel, random);
      const std::vector<double> errors = errors_of(renderer, weights, ways);
      bool has_opacities = false;
      for (std::size_t k = 0; k < ways.size(); ++k) {
        CAPTURE(ways[k].name);
        has_opacities = has_opacities || ways[k].name == "meshes[].opacities";
        CHECK(errors[k] < (ways[k].name == "gamma" ? 2e-4 : 1e-5));
      }
      CHECK(has_opacities);

      // The image is of the first degree in each opacity of the joint composition.
      const float step = composition == Composition::joint ? 0.2F : 0.01F;
      const auto loss = [&](float opacity) {
        std::vector<float> opacities = scene.meshes[1].mesh.vertex_opacities;
        opacities[2] = opacity;
        renderer.set_opacities(1, opacities);
        renderer.forward();
        const Image image = renderer.image();
        double sum = 0;
        for (std::size_t i = 0; i < image.pixels.size(); ++i)
          sum += glm::dot(glm::dvec4(image.pixels[i]), glm::dvec4(weights[0].pixels[i]));
        return sum;
      };
      const double difference = (loss(0.6F + step) - loss(0.6F - step)) / (2.0 * step);
      CHECK(gradient.meshes[1].opacities[2] == doctest::Approx(difference).epsilon(5e-3));
    }
  }

  TEST_CASE("opacity: of 1 everywhere, scenes keep their bits") {
    for (const char* const preset : {"joint_gaussian", "gaussian", "softras", "rigid", "opendr", "pixel"}) {
      CAPTURE(preset);
      const int size = reduced(20, 8);
      Scene scene = cube_scene(size, size);
      scene.smoothing = smoothing_preset(preset, size, size);
      const Image grad = random_image(size, size, -1, 1);
      Renderer renderer(open_device());
      const auto run = [&] {
        renderer.set_scene(scene);
        renderer.forward();
        return std::pair(renderer.image().pixels, renderer.backward(std::span(&grad, 1)).meshes[0].positions);
      };
      const auto plain = run();
      scene.meshes[0].mesh.vertex_opacities.assign(scene.meshes[0].mesh.positions.size(), 1.0F);
      CHECK(run() == plain);
    }
  }

  TEST_CASE("opacity: of 0 a surface is not seen, and has its gradient") {
    for (const Composition composition : {Composition::joint, Composition::barrier}) {
      Scene scene = sheet_and_sphere(composition);
      scene.meshes[1].mesh.vertex_opacities.assign(4, 0.0F);
      Scene without = scene;
      without.meshes.pop_back();
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      const Image image = renderer.image();
      CHECK(largest_difference(image, rendered(without)) < 1e-4);
      Image grad(scene.width, scene.height);
      grad.pixels.assign(grad.pixels.size(), glm::vec4(1, 0.5F, -0.5F, 0.2F));
      const SceneGradient gradient = renderer.backward(std::span(&grad, 1));
      const auto& by_opacity = gradient.meshes[1].opacities;
      if (composition == Composition::barrier) continue;  // whose image is steep there
      renderer.set_opacities(1, std::vector<float>(4, 0.02F));
      renderer.forward();
      const Image more = renderer.image();
      double difference = 0;
      for (std::size_t i = 0; i < image.pixels.size(); ++i)
        difference += glm::dot(grad.pixels[i], more.pixels[i] - image.pixels[i]) / 0.02F;
      CHECK(std::accumulate(by_opacity.begin(), by_opacity.end(), 0.0) ==
            doctest::Approx(difference).epsilon(0.05));
    }
  }

  TEST_CASE("opacity: that of all surfaces moves the barrier's background, of sampled occupancies too") {
    for (const Estimator estimator : {Estimator::exact, Estimator::monte_carlo}) {
      Scene scene = crossing_sheets(Composition::barrier);
      scene.gradients = {};
      scene.smoothing.occupancy_estimator = estimator;
      scene.meshes[0].mesh.vertex_opacities.assign(4, 0.5F);
      scene.meshes[1].mesh.face_opacities.assign(2, 0.5F);
      Image grad = random_image(scene.width, scene.height, -1, 1);
      for (glm::vec4& pixel : grad.pixels) pixel.w = 0;
      const auto run = [&] {
        Renderer renderer(open_device());
        renderer.set_scene(scene);
        renderer.forward();
        return std::pair(renderer.image(), renderer.backward(std::span(&grad, 1)));
      };
      auto [image, gradient] = run();
      for (Instance& instance : scene.meshes)
        instance.mesh.vertex_opacities = instance.mesh.face_opacities = {};
      scene.smoothing.background_depth -= scene.smoothing.gamma * std::log(0.5F);
      auto [expected_image, expected] = run();
      for (std::size_t i = 0; i < image.pixels.size(); ++i)
        image.pixels[i].w = expected_image.pixels[i].w = 0;  // alpha is another
      CHECK(largest_difference(image, expected_image) < 1e-5);
      CHECK(gradient.sigma == doctest::Approx(expected.sigma).epsilon(1e-3));
      for (std::size_t m = 0; m < 2; ++m) {
        const Block block{"", flat(gradient.meshes[m].positions), flat(expected.meshes[m].positions)};
        CHECK(norm(block.expected) > 0.01);
        CHECK(block_error(block, 1e-3) < 1e-3);
      }
    }
  }

  TEST_CASE(
      "opacity: set anew with noise on the pixel, an image does not depend on what was rendered before") {
    if (dpr::test::is_reduced()) return;  // nothing is launched that other cases do not launch
    for (const bool is_of_faces : {false, true}) {
      Scene scene = sheet_and_sphere(Composition::joint);
      scene.smoothing = smoothing_preset("pixel", scene.width, scene.height);
      if (is_of_faces) {
        scene.meshes[1].mesh.vertex_opacities.clear();
        scene.meshes[1].mesh.face_opacities = {0.3F, 0.8F};
      }
      std::vector<Image> images;
      const Image grad = random_image(scene.width, scene.height, -1, 1);
      std::vector<SceneGradient> gradients;
      for (const bool is_anew : {false, true}) {
        Renderer renderer(open_device());
        Scene first = scene;
        if (is_anew) {
          for (Instance& instance : first.meshes) {
            std::ranges::fill(instance.mesh.vertex_opacities, 1.0F);
            std::ranges::fill(instance.mesh.face_opacities, 1.0F);
          }
          first.gradients.opacities = false;
        }
        renderer.set_scene(first);
        renderer.forward();
        if (is_anew) {
          CHECK(largest_difference(renderer.image(), images[0]) > 0.05);
          renderer.set_gradients(scene.gradients);
          for (std::size_t m = 0; m < 2; ++m) {
            const Mesh& mesh = scene.meshes[m].mesh;
            renderer.set_opacities(
                m, mesh.vertex_opacities.empty() ? mesh.face_opacities : mesh.vertex_opacities);
          }
          renderer.forward();
        }
        images.push_back(renderer.image());
        gradients.push_back(renderer.backward(std::span(&grad, 1)));
      }
      CHECK(images[0].pixels == images[1].pixels);
      for (std::size_t m = 0; m < 2; ++m) {
        CHECK(gradients[0].meshes[m].opacities == gradients[1].meshes[m].opacities);
        CHECK(gradients[0].meshes[m].positions == gradients[1].meshes[m].positions);
        CHECK(std::ranges::any_of(gradients[0].meshes[m].opacities, [](float g) { return g != 0; }));
      }
    }
  }

  TEST_CASE("opacity: set anew, of instances, on several devices, in batches, and by scene files") {
    Scene scene = sheet_and_sphere(Composition::joint);
    scene.meshes.push_back({{}, placed(60.0F, 0.5F, {-0.6F, 0.9F, 1.2F}), 1});
    const Image image = rendered(scene);
    Scene other = scene;
    other.meshes[1].mesh.vertex_opacities.assign(4, 1.0F);
    Renderer renderer(open_device());
    renderer.set_scene(other);
    renderer.set_opacities(1, scene.meshes[1].mesh.vertex_opacities);
    renderer.forward();
    CHECK(renderer.image().pixels == image.pixels);
    Scene copied = scene;
    copied.meshes[2] = {scene.meshes[1].mesh, scene.meshes[2].transform};
    CHECK(rendered(copied).pixels == image.pixels);

    const Image grad = random_image(scene.width, scene.height, -1, 1);
    const std::vector<float> expected = renderer.backward(std::span(&grad, 1)).meshes[1].opacities;
    std::vector<Device> devices;
    devices.push_back(open_device());
    MultiDeviceRenderer several(std::move(devices));
    several.set_scene(other);
    several.set_opacities(1, scene.meshes[1].mesh.vertex_opacities);
    CHECK(several.render()[0].pixels == image.pixels);
    CHECK(several.gradient(std::span(&grad, 1)).meshes[1].opacities == expected);
    SceneBatch batch(open_device());
    batch.set_scenes(std::vector<Scene>{other, scene});
    batch.forward();
    CHECK(batch.image(1).pixels == image.pixels);
    CHECK(batch.backward(std::vector<Image>{grad, grad})[1].meshes[1].opacities == expected);

    const dpr::test::TempDir folder;
    const auto file = folder / "scene.json";
    std::ofstream(file) << R"({"meshes": [{"positions": [[0,0,0],[1,0,0],[0,1,0]], "faces": [[0,1,2]],
      "vertex_opacities": [0.5, 0.25, 1]}], "smoothing": {"preset": "joint_gaussian"}, "gradients": ["opacities"]})";
    const Scene read = read_scene(file);
    CHECK(read.meshes[0].mesh.vertex_opacities == std::vector<float>{0.5F, 0.25F, 1.0F});
    CHECK(read.gradients.opacities);
  }

  TEST_CASE("opacity: meshes that are cut or clustered carry it") {
    Mesh mesh = sheet(1, {1, 1, 1});
    mesh.vertex_opacities = {0.2F, 0.4F, 0.6F, 0.8F};
    CHECK(cluster_vertices(mesh, 0.1F).vertex_opacities == mesh.vertex_opacities);
    Mesh of_faces = sheet(1, {1, 1, 1});
    of_faces.face_opacities = {0.3F, 0.9F};
    CHECK(cluster_vertices(of_faces, 0.1F).face_opacities == of_faces.face_opacities);

    Scene scene = scene_of(mesh, 16, 16);
    scene.meshes.push_back({of_faces, placed(50.0F)});
    scene.smoothing = smoothing_preset("joint_gaussian");
    scene.camera.distortion = Distortion{-0.3F, 0.1F, 0, 0, 0};
    const SubdividedScene cut = subdivide_for_lens(scene, {.tolerance = 0.01F});
    SceneGradient gradient;
    for (std::size_t m = 0; m < 2; ++m) {
      const Mesh& pieces = cut.scene.meshes[m].mesh;
      REQUIRE(pieces.faces.size() > 2);
      MeshGradient& of_pieces = gradient.meshes.emplace_back();
      of_pieces.opacities.assign(pieces.vertex_opacities.size() + pieces.face_opacities.size(), 1.0F);
      const MeshGradient whole = pull_back(scene.meshes[m].mesh, cut.meshes[m], of_pieces);
      CHECK(std::accumulate(whole.opacities.begin(), whole.opacities.end(), 0.0) ==
            doctest::Approx(static_cast<double>(of_pieces.opacities.size())));
    }
    CHECK(cut.scene.meshes[0].mesh.vertex_opacities.size() == cut.scene.meshes[0].mesh.positions.size());
    CHECK(std::ranges::count(cut.scene.meshes[1].mesh.face_opacities, 0.9F) > 1);
  }

  TEST_CASE("opacity: refused is what has no place for it") {
    Scene scene = sheet_and_sphere(Composition::joint);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const auto refused = [](const Scene& bad, const char* part) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(bad), part);
    };
    const auto with = [&](const auto& change) {
      Scene changed = scene;
      change(changed);
      return changed;
    };
    refused(with([](Scene& s) { s.smoothing.aggregation_estimator = Estimator::monte_carlo; }),
            "monte_carlo");
    refused(with([](Scene& s) { s.meshes[1].mesh.vertex_opacities[2] = 1.5F; }), "vertex_opacities[2]");
    refused(with([](Scene& s) { s.meshes[1].mesh.vertex_opacities[2] = NAN; }), "vertex_opacities[2]");
    refused(with([](Scene& s) { s.meshes[1].mesh.vertex_opacities.pop_back(); }), "3 opacities");
    refused(with([](Scene& s) { s.meshes[1].mesh.face_opacities = {1, 1}; }), "at most one");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_opacities(1, std::vector<float>{1, 1, 1}),
                          "expected 4");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_opacities(1, std::vector<float>{1, 1, 2, 1}),
                          "opacities[2]");
    renderer.forward();
    AttributeImages depths(renderer.device(), Attribute::depth);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, depths.forward(renderer), "attribute images");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, PoseSolver(renderer.device(), scene, renderer.image()), "pose");
    const dpr::test::TempDir folder;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, write_mesh(folder / "a.ply", scene.meshes[1].mesh), "opacities");

    // Opaque scenes go with every smoothing, but not the gradient.
    Scene opaque = with([](Scene& s) {
      s.smoothing = smoothing_preset("pixel");
      s.smoothing.aggregation_estimator = Estimator::monte_carlo;
      s.meshes[0].mesh.face_opacities.clear();
      s.meshes[1].mesh.vertex_opacities.assign(4, 1.0F);
    });
    renderer.set_scene(opaque);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.forward(), "monte_carlo");
    renderer.set_gradients({});
    renderer.forward();
    const Image grad = renderer.image();
    renderer.set_gradients(with_opacities());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.backward(std::span(&grad, 1)), "monte_carlo");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_opacities(1, std::vector<float>{1, 1, 0.5F, 1}),
                          "monte_carlo");
    renderer.set_opacities(1, std::vector<float>(4, 1.0F));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_opacities(0, std::vector<float>{1}),
                          "without opacities");

    // What an opaque sheet hides has a gradient by the sheet's opacity all the same.
    opaque.smoothing = smoothing_preset("rigid");
    opaque.gradients = {};
    renderer.set_scene(opaque);
    renderer.forward();
    renderer.set_gradients(with_opacities());
    const SceneGradient late = renderer.backward(std::span(&grad, 1));
    opaque.gradients = with_opacities();
    opaque.meshes[1].mesh.vertex_opacities.assign(4, 0.9999999F);
    renderer.set_scene(opaque);
    renderer.forward();
    const SceneGradient expected = renderer.backward(std::span(&grad, 1));
    for (std::size_t i = 0; i < 4; ++i)
      CHECK(late.meshes[1].opacities[i] == doctest::Approx(expected.meshes[1].opacities[i]).epsilon(1e-3));
  }
}

}  // namespace opacity_test
