// Instances of a mesh: a scene that has them shows, and changes, as one that has a copy of the mesh for each.
#include <doctest/doctest.h>

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "dpr/opencl_handles.hpp"
#include "pipeline/determinism.hpp"
#include "pipeline/scenes.hpp"
#include "reference/finite_difference.hpp"
#include "support/caller.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/several_devices.hpp"

namespace dpr::test::pipeline::instances_test {
namespace {

/// A mesh with a texture, materials and normals of its own, one with colours of its vertices, and three
/// instances, one of which mirrors.
Scene instanced_scene(int width, int height) {
  Scene scene =
      textured_scene(make_cube(), random_texture(5, 3, Wrap::repeat, Filter::trilinear), width, height);
  Mesh& first = scene.meshes[0].mesh;
  first.materials = {{{0.9F, 0.4F, 0.6F}, 3.0F}, {{0.2F, 1.3F, 0.7F}, std::nullopt}};
  for (std::uint32_t f = 0; f < first.faces.size(); ++f) first.face_materials.push_back(f % 2);
  first.face_normals = first.faces;
  for (const glm::vec3& p : first.positions) first.normals.push_back(p + glm::vec3(0.1F, 0.2F, -0.1F));
  scene.meshes[0].transform = placed(23.0F, 0.5F, {-0.6F, 0.3F, 0.1F});
  scene.meshes.push_back({{}, placed(-50.0F, 0.4F, {0.7F, 0.5F, -0.3F}), 0});
  scene.meshes.push_back({make_icosphere(0), placed(11.0F, 0.5F, {0.4F, -0.6F, 0.5F})});
  scene.meshes.push_back({{}, placed(70.0F, 0.3F, {-0.5F, -0.6F, 0.2F}), 2});
  scene.meshes.push_back({{}, placed(5.0F, 0.3F, {0.1F, 0.0F, 1.0F}), 0});
  scene.meshes[4].transform = scene.meshes[4].transform * glm::scale(glm::mat4(1), glm::vec3(-1, 1, 1.2F));
  scene.lights = every_light(Shading::phong);
  scene.gradients.lights = scene.gradients.normals = scene.gradients.materials = true;
  scene.gradients.texture = scene.gradients.texcoords = true;
  return scene;
}

/// The same with a copy of the mesh in the place of every instance.
Scene with_copies(Scene scene) {
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    scene.meshes[m].mesh = Mesh(mesh_of(scene, m));
    scene.meshes[m].instance_of.reset();
  }
  return scene;
}

/// The gradient of a scene with copies as that of one with instances: the copies' added to the mesh's.
SceneGradient joined(SceneGradient gradient, const Scene& instanced) {
  for (std::size_t m = 0; m < instanced.meshes.size(); ++m) {
    const auto source = instanced.meshes[m].instance_of;
    if (!source) continue;
    MeshGradient &to = gradient.meshes[*source], &from = gradient.meshes[m];
    const auto add_list = [](auto& sum, const auto& more) {
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += more.at(i);
    };
    add_list(to.positions, from.positions);
    add_list(to.colors, from.colors);
    add_list(to.texcoords, from.texcoords);
    add_list(to.normals, from.normals);
    add_list(to.specular, from.specular);
    add_list(to.shininess, from.shininess);
    for (std::size_t t = 0; t < to.textures.size(); ++t) add_list(to.textures[t], from.textures.at(t));
    from = {};
  }
  return gradient;
}

/// The numbers of blocks that differ by more than rounding.
void check_same(const SceneGradient& found, const SceneGradient& expected) {
  constexpr double k_tolerance = 2e-5;
  std::vector<Block> blocks = blocks_of(found);
  const std::vector<Block> wanted = blocks_of(expected);
  REQUIRE(blocks.size() == wanted.size());
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    CAPTURE(blocks[i].name);
    CAPTURE(i);
    blocks[i].expected = wanted[i].found;
    CHECK(block_error(blocks[i], k_tolerance) < k_tolerance);
  }
  for (std::size_t m = 0; m < expected.meshes.size(); ++m) {  // which blocks leave out
    const MeshGradient &a = found.meshes[m], &b = expected.meshes[m];
    for (const auto& [name, x, y] : {std::tuple("normals", flat(a.normals), flat(b.normals)),
                                     std::tuple("specular", flat(a.specular), flat(b.specular)),
                                     std::tuple("shininess", a.shininess, b.shininess)}) {
      CAPTURE(name);
      CHECK(block_error({name, x, y}, k_tolerance) < k_tolerance);
    }
  }
}

Image weights_of(const Scene& scene) { return random_image(scene.width, scene.height, -1.0F, 1.0F); }

void check_as_copies(Renderer& renderer, Renderer& of_copies, const Scene& scene) {
  renderer.forward();
  of_copies.forward();
  CHECK(same_bits(renderer.image(), of_copies.image()));
  const Image weights = weights_of(scene);
  check_same(renderer.backward(std::span(&weights, 1)),
             joined(of_copies.backward(std::span(&weights, 1)), scene));
}

void check_as_copies(const Scene& scene) {
  Renderer renderer(open_device()), of_copies(renderer.device());
  renderer.set_scene(scene);
  of_copies.set_scene(with_copies(scene));
  check_as_copies(renderer, of_copies, scene);
}

int side() { return reduced(32, 10); }

TEST_SUITE("pipeline") {
  TEST_CASE("instances look like copies, and their gradients are the copies', added up") {
    const Scene lit = instanced_scene(side(), side() - 3);
    SUBCASE("lit") { check_as_copies(lit); }
    SUBCASE("without lights, by colours of vertices alone") {
      Scene scene = lit;
      scene.lights.reset();
      scene.meshes = {lit.meshes[2], lit.meshes[3]};
      scene.meshes[1].instance_of = 0;
      check_as_copies(scene);
    }
    SUBCASE("noise of the pixel, which leaves out back faces") {
      Scene scene = lit;
      scene.smoothing = smoothing_preset("pixel");
      check_as_copies(scene);
    }
    SUBCASE("an instance across the near plane") {
      Scene scene = lit;
      scene.camera.znear = 4.2F;
      check_as_copies(scene);
    }
  }

  TEST_CASE("what is set of a mesh is its instances' too") {
    Scene scene = instanced_scene(side(), side());
    SUBCASE("noise of triangles") {}
    SUBCASE("noise of the pixel") { scene.smoothing = smoothing_preset("pixel"); }
    Renderer renderer(open_device()), of_copies(renderer.device());
    renderer.set_scene(scene);
    renderer.forward();
    Random random(2);
    Mesh &first = scene.meshes[0].mesh, &second = scene.meshes[2].mesh;
    for (glm::vec3& p : second.positions) p += random.vector(-0.1F, 0.1F);
    for (glm::vec3& c : second.vertex_colors) c = random.vector(0, 1);
    for (glm::vec3& texel : first.textures[0].texels) texel = random.vector(0, 1);
    for (glm::vec2& uv : first.texcoords) uv += glm::vec2(random.vector(-0.2F, 0.2F));
    for (glm::vec3& p : first.positions) p *= 1.1F;
    renderer.set_positions(2, second.positions);
    renderer.set_positions(0, first.positions);
    renderer.set_colors(2, second.vertex_colors);
    renderer.set_texels(0, 0, first.textures[0].texels);
    renderer.set_texcoords(0, first.texcoords);
    of_copies.set_scene(with_copies(scene));
    check_as_copies(renderer, of_copies, scene);
  }

  TEST_CASE("views with shapes of their own have them in every instance") {
    Scene scene = instanced_scene(side(), side());
    scene.gradients.colors = false;
    std::vector<glm::vec3> shapes, of_copies;
    Random random(4);
    std::vector<View> views;
    for (int v = 0; v < 2; ++v) {
      View view{orbit_camera(5.3F, 20.0F, 50.0F * static_cast<float>(v)), {}};
      const glm::vec3 shift = random.vector(-0.3F, 0.3F);
      for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
        view.transforms.push_back(scene.meshes[m].transform);
        for (const glm::vec3& p : mesh_of(scene, m).positions) of_copies.push_back(p + shift);
        for (const glm::vec3& p : scene.meshes[m].mesh.positions) shapes.push_back(p + shift);
      }
      views.push_back(view);
    }
    const std::vector<Image> weights(2, weights_of(scene));
    Renderer renderer(open_device()), with_own(renderer.device());
    renderer.set_scene(scene);
    with_own.set_scene(with_copies(scene));
    std::vector<ShapesGradient> found;
    for (const auto& [r, positions] : {std::pair(&renderer, &shapes), std::pair(&with_own, &of_copies)}) {
      r->set_views(views);
      r->set_shapes(*positions, {});
      r->forward();
      found.push_back(r->backward(weights).shapes);
    }
    CHECK(same_bits(renderer.image(1), with_own.image(1)));
    std::vector<glm::vec3> sums;
    std::size_t next = 0;
    for (int v = 0; v < 2; ++v) {
      std::vector<std::size_t> first(scene.meshes.size());
      for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
        const std::size_t source = scene.meshes[m].instance_of.value_or(m);
        if (source == m) first[m] = sums.size();
        sums.resize(sums.size() + scene.meshes[m].mesh.positions.size(), glm::vec3(0));
        for (std::size_t i = 0; i < mesh_of(scene, m).positions.size(); ++i)
          sums[first[source] + i] += found[1].positions[next++];
      }
    }
    CHECK(block_error({"shapes", flat(found[0].positions), flat(sums)}, 2e-5) < 2e-5);
  }

  TEST_CASE("attributes of instances are theirs, and fold to the mesh's gradients") {
    Scene scene = instanced_scene(side(), side());
    scene.meshes = {scene.meshes[0], scene.meshes[1], scene.meshes[4]};
    Renderer renderer(open_device()), of_copies(renderer.device());
    renderer.set_scene(scene);
    of_copies.set_scene(with_copies(scene));
    const Image weights = weights_of(scene);
    for (const Attribute attribute : {Attribute::depth, Attribute::normal, Attribute::texcoords}) {
      CAPTURE(to_string(attribute));
      std::vector<SceneGradient> gradients;
      std::vector<Image> images;
      for (Renderer* r : {&renderer, &of_copies}) {
        r->forward();
        AttributeImages attributes(r->device(), attribute);
        attributes.forward(*r);
        images.push_back(attributes.image());
        gradients.push_back(attributes.backward(std::span(&weights, 1)));
      }
      CHECK(same_bits(images[0], images[1]));
      check_same(gradients[0], joined(gradients[1], scene));
    }
  }

  TEST_CASE("several devices and buffers know instances") {
    const Scene scene = instanced_scene(side(), side());
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const Image weights = weights_of(scene);
    const SceneGradient expected = renderer.backward(std::span(&weights, 1));
    MultiDeviceRenderer several(several_devices(2));
    several.set_scene(scene);
    CHECK(same_bits(several.gradient(std::span(&weights, 1)), expected));

    const Caller caller;
    Renderer embedded(adopt_device(caller.context(), caller.queue()));
    embedded.set_scene(scene);
    forward_on_device(embedded);
    const cl::Buffer grad = caller.buffer(weights.pixels);
    backward_on_device(embedded, {grad()});
    CHECK(gradient_view(embedded, "meshes[2].positions").count == 12);
    CHECK(gradient_view(embedded, "views[0].meshes[3].rotation").count == 1);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(embedded, "meshes[3].positions"),
                          "\"meshes[3].positions\"");
  }

  TEST_CASE("instances are of an earlier mesh, and set there") {
    Scene scene = instanced_scene(8, 8);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_positions(1, scene.meshes[0].mesh.positions),
                          "1, an instance of mesh 0");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_texels(4, 0, {}), "instance of mesh 0");
    scene.meshes[1].instance_of = 7;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(scene),
                          "instance_of (meshes[1]): got 7, where there are 5 meshes");
    scene.meshes[1].instance_of = 2;  // comes later
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(scene), "got 2, a later mesh");
    scene.meshes[1].instance_of = 0;
    scene.meshes[3].instance_of = 1;  // an instance itself
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(scene),
                          "instance_of (meshes[3]): got 1, itself an instance of 0");
    scene.meshes[3].instance_of = 2;
    scene.meshes[3].mesh = make_cube();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(scene), "one of the two");
  }
}

/// The reference has copies; a number of the mesh moves in all of them.
TEST_SUITE("gradient") {
  TEST_CASE("positions of a mesh with instances, against differences of the reference") {
    const int size = reduced(14, 6);
    Scene scene = scene_of(random_soup(2, 23), size, size);
    scene.meshes[0].transform = placed(20.0F, 0.7F, {-0.4F, 0.2F, 0});
    scene.meshes.push_back({{}, placed(-60.0F, 0.8F, {0.5F, -0.1F, 0.3F}), 0});
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const reference::Scene twin = to_reference(scene);
    Image weights = weights_of(scene);
    const Delicate delicate = delicate_pixels(twin, 1e-3);
    for (std::size_t i = 0; i < weights.pixels.size(); ++i) {
      if (delicate.kink[i]) weights.pixels[i] = glm::vec4(0);
    }
    const reference::Image wanted = to_reference(weights);
    const auto loss = [&](const std::vector<double>& at) {
      reference::Scene moved = twin;
      for (reference::Mesh& mesh : moved.meshes) {
        for (std::size_t i = 0; i < at.size(); ++i) mesh.positions[i / 3][i % 3] = at[i];
      }
      const reference::Image image = reference::render(moved);
      double sum = 0;
      for (std::size_t i = 0; i < image.rgba.size(); ++i) sum += image.rgba[i] * wanted.rgba[i];
      return sum;
    };
    const SceneGradient gradient = renderer.backward(std::span(&weights, 1));
    const auto check = [&](const std::vector<double>& found) {
      return reference::check_gradient(loss, flat(scene.meshes[0].mesh.positions), found, 1e-5, 2e-3);
    };
    const reference::GradientCheck result = check(flat(gradient.meshes[0].positions));
    CAPTURE(result.error);
    CHECK(result.passed);
    CHECK(gradient.meshes[1].positions.empty());

    Renderer without(renderer.device());  // one place alone does not pass
    scene.meshes.pop_back();
    without.set_scene(scene);
    without.forward();
    CHECK_FALSE(check(flat(without.backward(std::span(&weights, 1)).meshes[0].positions)).passed);
  }
}

}  // namespace
}  // namespace dpr::test::pipeline::instances_test
