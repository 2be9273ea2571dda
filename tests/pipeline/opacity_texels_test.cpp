// Opacity of texels: images and gradients against the reference and against its differences, tangents against
// gradients, setters, files, and what is refused.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>
#include <tuple>
#include <vector>

#include "check/adjoint.hpp"
#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "dpr/multi_device.hpp"
#include "pipeline/directions.hpp"
#include "pipeline/reference_comparison.hpp"
#include "pipeline/scenes.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/temp_dir.hpp"

namespace opacity_texels_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

Texture leaf(int width, int height, Wrap wrap, Filter filter) {
  Texture texture = random_texture(width, height, wrap, filter);
  Random random(31);
  for (std::size_t i = 0; i < texture.texels.size(); ++i) texture.opacities.push_back(random(0.15F, 0.9F));
  return texture;
}

/// A tilted sheet with such a texture, and opacities of its vertices, in front of a sphere; the sheet's second face is
/// without texture, or its second texture without opacities.
Scene leaf_and_sphere(Composition composition, Wrap wrap, Filter filter) {
  const int size = reduced(24, 9);
  Mesh mesh;
  mesh.positions = {{-1.4F, -1.3F, 0.1F}, {1.5F, -1.2F, -0.2F}, {1.3F, 1.4F, 0.2F}, {-1.2F, 1.5F, -0.1F}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}};
  mesh.vertex_colors = {{0.9F, 0.4F, 0.3F}, {0.3F, 0.8F, 0.5F}, {0.7F, 0.6F, 0.9F}, {0.5F, 0.9F, 0.8F}};
  mesh.vertex_opacities = {0.9F, 0.6F, 0.95F, 0.7F};
  mesh.texcoords = {{-0.3F, -0.2F}, {1.3F, 0.1F}, {1.6F, 1.2F}, {0.1F, 1.4F}};
  mesh.face_texcoords = mesh.faces;
  mesh.textures = {leaf(11, 7, wrap, filter), random_texture(3, 2, wrap, Filter::bilinear)};
  mesh.face_textures = {0, 0, wrap == Wrap::mirror ? k_no_texture : 1};
  Scene scene = scene_of(make_icosphere(reduced(1, 0)), size, size);
  scene.smoothing.composition = composition;
  scene.meshes.push_back({mesh, placed(29.0F, 1.0F, {0.5F, 0.9F, 1.1F})});
  scene.gradients.texture = scene.gradients.texcoords = scene.gradients.opacities = true;
  scene.gradients.texel_opacities = true;
  return scene;
}

/// Of the mesh in front, by the numbers that the reference's gradient lacks under trilinear filtering.
std::vector<Direction> directions(const SceneGradient& g) {
  const MeshGradient& mesh = g.meshes[1];
  const std::vector<float>& opacities = mesh.texel_opacities[0];
  return {{"positions", flat(mesh.positions),
           [](reference::Scene& s, const std::vector<double>& d) {
             for (std::size_t i = 0; i < d.size(); ++i) s.meshes[1].positions[i / 3][i % 3] += d[i];
           }},
          {"texcoords", flat(mesh.texcoords),
           [](reference::Scene& s, const std::vector<double>& d) {
             for (std::size_t i = 0; i < d.size(); ++i)
               (i % 2 == 0 ? s.meshes[1].texcoords[i / 2].x : s.meshes[1].texcoords[i / 2].y) += d[i];
           }},
          {"texel opacities",
           {opacities.begin(), opacities.end()},
           [](reference::Scene& s, const std::vector<double>& d) {
             for (std::size_t i = 0; i < d.size(); ++i) {
               reference::Vec3d& texel = s.meshes[1].opacity_textures[0].texels[i];
               texel += reference::Vec3d{d[i], d[i], d[i]};
             }
           }}};
}

}  // namespace

TEST_SUITE("opacity") {
  TEST_CASE("texels' opacity: images and gradients are the reference's, lit or not, in both compositions") {
    for (const Composition composition : {Composition::joint, Composition::barrier}) {
      const std::string name = composition == Composition::joint ? "joint" : "barrier";
      CHECK(check_opacities(name + ", bilinear", leaf_and_sphere(composition, Wrap::repeat, Filter::bilinear),
                            "texel opacities", 0.05) == 1);
      CHECK(check_opacities(name + ", nearest, lit",
                            lit(leaf_and_sphere(composition, Wrap::mirror, Filter::nearest)),
                            "texel opacities", 0.05) == 1);
    }
  }

  TEST_CASE("texels' opacity: trilinear, images are the reference's, and gradients its differences") {
    for (const bool is_lit : {false, true}) {  // then with a part nearer than the near plane, too
      Scene scene = leaf_and_sphere(Composition::joint, Wrap::repeat, Filter::trilinear);
      scene.width = scene.height = reduced(14, 9);
      if (is_lit) {
        scene = lit(scene);
        scene.camera.znear = 4.2F;
      }
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      const reference::Scene twin = to_reference(scene);
      CHECK(image_error(renderer.image(), reference::render(twin), delicate_pixels(twin)).largest < 1e-4);
      const Image weights = random_image(scene.width, scene.height, -1, 1);
      for (const Direction& block : directions(renderer.backward(std::span(&weights, 1)))) {
        const double error = error_along(scene, block, weights, 0);
        CHECK_MESSAGE(error < 1e-3, block.name);
        Direction wrong = block;
        for (double& g : wrong.found) g *= 1.01;
        CHECK(error_along(scene, wrong, weights, 0) > error);
      }
    }
  }

  TEST_CASE("texels' opacity: <u, J v> = <J^T u, v>") {
    for (const Composition composition : {Composition::joint, Composition::barrier}) {
      for (const Filter filter : {Filter::bilinear, Filter::trilinear}) {
        if (dpr::test::is_reduced() && filter == Filter::bilinear) continue;
        Renderer renderer(open_device());
        Scene scene = leaf_and_sphere(composition, Wrap::repeat, filter);
        if (filter == Filter::trilinear) scene = lit(scene);
        renderer.set_scene(scene);
        renderer.forward();
        Random random(7);
        const std::vector<Image> weights = random_images(renderer, random);
        SceneGradient gradient = renderer.backward(weights);
        const std::vector<Way> ways = random_ways(gradient, /*by_sigma*/ true, random);
        const std::vector<double> errors = errors_of(renderer, weights, ways);
        for (std::size_t k = 0; k < ways.size(); ++k) {
          CAPTURE(ways[k].name);
          CHECK(errors[k] < (ways[k].name == "gamma" ? 2e-4 : 1e-5));
        }
        SceneTangent direction = gradient;
        DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.tangent(std::span(&direction, 1)), "are not known");
      }
    }
  }

  TEST_CASE("texels' opacity: sampled occupancies give the gradient that opacities of faces do") {
    Scene scene = leaf_and_sphere(Composition::barrier, Wrap::repeat, Filter::bilinear);
    scene.smoothing.occupancy_estimator = Estimator::monte_carlo;
    for (Instance& instance : scene.meshes)
      for (Texture& texture : instance.mesh.textures) texture.opacities.assign(texture.texels.size(), 0.5F);
    const Image grad = random_image(scene.width, scene.height, -1, 1);
    const auto run = [&] {
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      return renderer.backward(std::span(&grad, 1));
    };
    const SceneGradient found = run();
    for (Texture& texture : scene.meshes[1].mesh.textures) texture.opacities.clear();
    for (float& opacity : scene.meshes[1].mesh.vertex_opacities) opacity *= 0.5F;
    const SceneGradient expected = run();
    CHECK(found.sigma == doctest::Approx(expected.sigma).epsilon(1e-3));
    const Block positions{"", flat(found.meshes[1].positions), flat(expected.meshes[1].positions)};
    CHECK(norm(positions.expected) > 0.01);
    CHECK(block_error(positions, 1e-3) < 1e-3);
    const auto& by_vertex = expected.meshes[1].opacities;
    std::vector<double> halves;
    for (const float g : by_vertex) halves.push_back(0.5 * double(g));
    CHECK(block_error({"", {found.meshes[1].opacities.begin(), found.meshes[1].opacities.end()}, halves},
                      1e-3) < 1e-3);
  }

  TEST_CASE("texels' opacity: of 1 everywhere, scenes keep their bits") {
    if (dpr::test::is_reduced()) return;  // nothing is launched that other cases do not launch
    for (const char* const preset : {"joint_gaussian", "softras", "rigid", "pixel"}) {
      CAPTURE(preset);
      Scene scene = leaf_and_sphere(Composition::joint, Wrap::repeat, Filter::trilinear);
      scene.gradients = {};
      scene.gradients.texture = scene.gradients.texcoords = true;
      scene.smoothing = smoothing_preset(preset, scene.width, scene.height);
      Mesh& mesh = scene.meshes[1].mesh;
      mesh.vertex_opacities.clear();
      mesh.textures[0].opacities.clear();
      const Image grad = random_image(scene.width, scene.height, -1, 1);
      const auto run = [&] {
        Renderer renderer(open_device());
        renderer.set_scene(scene);
        renderer.forward();
        const SceneGradient g = renderer.backward(std::span(&grad, 1));
        return std::tuple(renderer.image().pixels, g.meshes[1].positions, g.meshes[1].textures);
      };
      const auto plain = run();
      mesh.textures[0].opacities.assign(mesh.textures[0].texels.size(), 1.0F);
      CHECK(run() == plain);
    }
  }

  TEST_CASE("texels' opacity: set anew, of instances, on several devices, and by scene files") {
    Scene scene = leaf_and_sphere(Composition::joint, Wrap::repeat, Filter::trilinear);
    scene.meshes.push_back({{}, placed(60.0F, 0.5F, {-0.6F, 0.9F, 1.2F}), 1});
    const std::vector<float> opacities = scene.meshes[1].mesh.textures[0].opacities;
    const Image image = rendered(scene);
    Scene other = scene;
    other.meshes[1].mesh.textures[0].opacities.assign(opacities.size(), 0.9F);
    Renderer renderer(open_device());
    renderer.set_scene(other);
    renderer.set_texel_opacities(1, 0, opacities);
    renderer.forward();
    CHECK(renderer.image().pixels == image.pixels);
    const Image grad = random_image(scene.width, scene.height, -1, 1);
    const SceneGradient expected = renderer.backward(std::span(&grad, 1));
    CHECK(expected.meshes[1].texel_opacities[1].empty());  // of a texture without
    Scene copied = scene;
    copied.meshes[2] = {scene.meshes[1].mesh, scene.meshes[2].transform};
    CHECK(rendered(copied).pixels == image.pixels);

    std::vector<Device> devices;
    devices.push_back(open_device());
    MultiDeviceRenderer several(std::move(devices));
    several.set_scene(other);
    several.set_texel_opacities(1, 0, opacities);
    CHECK(several.render()[0].pixels == image.pixels);
    CHECK(several.gradient(std::span(&grad, 1)).meshes[1].texel_opacities ==
          expected.meshes[1].texel_opacities);

    const dpr::test::TempDir folder;
    Texture file = leaf(3, 2, Wrap::repeat, Filter::bilinear);
    write_texture(folder / "leaf.exr", file);
    std::ofstream(folder / "scene.json")
        << R"({"meshes": [{"positions": [[0,0,0],[1,0,0],[0,1,0]], "faces": [[0,1,2]],
      "texcoords": [[0,0],[1,0],[0,1]], "face_texcoords": [[0,1,2]], "texture": {"file": "leaf.exr"}}],
      "smoothing": {"preset": "joint_gaussian"}, "gradients": ["texel_opacities"]})";
    const Scene read = read_scene(folder / "scene.json");
    CHECK(read.meshes[0].mesh.textures[0].opacities == file.opacities);
    CHECK(read.gradients.texel_opacities);
  }

  TEST_CASE("texels' opacity: refused is what has no place for it") {
    const Scene scene = leaf_and_sphere(Composition::joint, Wrap::repeat, Filter::bilinear);
    const auto with = [&](const auto& change) {
      Scene changed = scene;
      changed.meshes[1].mesh.vertex_opacities.clear();
      change(changed, changed.meshes[1].mesh.textures[0].opacities);
      return changed;
    };
    const auto refused = [](const Scene& bad, const char* part) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(bad), part);
    };
    refused(with([](Scene&, auto& opacities) { opacities[3] = 1.5F; }), "opacities[3]");
    refused(with([](Scene&, auto& opacities) { opacities[3] = NAN; }), "opacities[3]");
    refused(with([](Scene&, auto& opacities) { opacities.pop_back(); }), "one for each texel");
    const Scene leafy = with([](Scene&, auto&) {});
    Renderer renderer(open_device());
    renderer.set_scene(leafy);
    const std::vector<float> ones(77, 1.0F);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_texel_opacities(1, 0, std::span(ones).first(3)),
                          "expected 77");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_texel_opacities(1, 2, ones), "below 2");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_texel_opacities(0, 0, ones), "below 0");
    renderer.forward();
    Scene alone = leafy;
    alone.meshes.erase(alone.meshes.begin());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, PoseSolver(renderer.device(), alone, renderer.image()),
                          "opaque mesh");
    const dpr::test::TempDir folder;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, write_mesh(folder / "a.glb", leafy.meshes[1].mesh), "opaque mesh");
  }
}

}  // namespace opacity_texels_test
