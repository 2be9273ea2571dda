// How surfaces answer light: materials of faces and normals that meshes give. Images against the reference in
// double precision, gradients against its finite differences, and creases under noise of the pixel.
#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/directions.hpp"
#include "pipeline/scenes.hpp"
#include "renderer/renderer_impl.hpp"
#include "scene/gradient_table.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/several_devices.hpp"

namespace surface_light_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

/// Every corner's own, of lengths other than one, about where the mesh has it from its middle.
Mesh with_normals(Mesh mesh) {
  Random random(31);
  for (const glm::uvec3& face : mesh.faces) {
    const auto first = static_cast<unsigned>(mesh.normals.size());
    mesh.face_normals.emplace_back(first, first + 1, first + 2);
    for (int corner = 0; corner < 3; ++corner) {
      const glm::vec3 out = glm::normalize(mesh.positions[face[corner]]) + random.vector(-0.4F, 0.4F);
      mesh.normals.push_back(random(0.5F, 2.0F) * out);
    }
  }
  return mesh;
}

Mesh with_materials(Mesh mesh) {
  mesh.materials = {
      {{0.9F, 0.4F, 0.6F}, 3.0F}, {{0.2F, 1.3F, 0.7F}, std::nullopt}, {{0.7F, 0.5F, 1.1F}, 9.0F}};
  for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) mesh.face_materials.push_back(f % 3);
  return mesh;
}

/// Beside a mesh that has neither, under a transform that neither keeps angles nor sides.
Scene surface_scene(Shading shading, int size) {
  Scene scene = scene_of(with_materials(with_normals(make_cube())), size, size);
  glm::mat4& transform = scene.meshes[0].transform;
  transform = transform * glm::scale(glm::mat4(1), glm::vec3(-0.9F, 1.1F, 0.7F));
  scene.meshes.push_back({make_icosphere(0), placed(-31.0F, 0.5F, {0.6F, -0.1F, 0.9F})});
  scene.lights = every_light(shading);
  scene.gradients.lights = scene.gradients.normals = scene.gradients.materials = true;
  return scene;
}

SceneGradient gradient_of(const Scene& scene, const Image& weights) {
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  renderer.forward();
  return renderer.backward(std::span(&weights, 1));
}

double largest_difference(const Image& image, const reference::Image& expected) {
  double largest = 0;
  for (std::size_t i = 0; i < expected.rgba.size(); ++i) {
    const auto found = static_cast<double>(image.pixels[i / 4][static_cast<int>(i % 4)]);
    largest = std::max(largest, std::abs(found - expected.rgba[i]));
  }
  return largest;
}

void move_all(std::vector<reference::Vec3d>& values, const std::vector<double>& by) {
  for (std::size_t i = 0; i < by.size(); ++i) values[i / 3][i % 3] += by[i];
}

/// A rotation vector applied on the left of the linear part.
void rotate(reference::Mat4d& m, const std::vector<double>& r) {
  for (std::size_t column = 0; column < 3; ++column) {
    const reference::Vec3d v{m[0][column], m[1][column], m[2][column]};
    const reference::Vec3d moved = cross(reference::Vec3d{r[0], r[1], r[2]}, v);
    for (std::size_t row = 0; row < 3; ++row) m[row][column] += moved[row];
  }
}

std::vector<Direction> directions(const SceneGradient& g) {
  const MeshGradient& mesh = g.meshes[0];
  using By = const std::vector<double>&;
  return {
      {"normals", flat(mesh.normals), [](reference::Scene& s, By by) { move_all(s.meshes[0].normals, by); }},
      {"specular", flat(mesh.specular),
       [](reference::Scene& s, By by) {
         for (std::size_t i = 0; i < by.size(); ++i) s.meshes[0].materials[i / 3].specular[i % 3] += by[i];
       }},
      {"shininess", mesh.shininess,
       [](reference::Scene& s, By by) {
         for (std::size_t i = 0; i < by.size(); ++i) {
           double& shininess = s.meshes[0].materials[i].shininess;
           shininess = (shininess > 0 ? shininess : s.lights->shininess) + by[i];
         }
       }},
      {"positions", flat(mesh.positions),
       [](reference::Scene& s, By by) { move_all(s.meshes[0].positions, by); }},
      {"colors", flat(mesh.colors),
       [](reference::Scene& s, By by) { move_all(s.meshes[0].face_colors, by); }},
      {"rotation", flat<glm::dvec3>({g.views[0].transforms[0].rotation}),
       [](reference::Scene& s, By by) { rotate(s.meshes[0].transform, by); }},
      {"lights", light_numbers(g), [](reference::Scene& s, By by) { *s.lights = displaced(*s.lights, by); }}};
}

/// Gradients of materials and normals, requested alone, in three views, and by several devices.
void check_alone(Shading shading) {
  CAPTURE(static_cast<int>(shading));
  const int size = reduced(20, 5);
  const Scene scene = surface_scene(shading, size);
  const Image weights = random_image(size, size, -1, 1);
  const SceneGradient all = gradient_of(scene, weights);
  for (bool GradientRequest::*const wanted : {&GradientRequest::normals, &GradientRequest::materials}) {
    Scene alone = scene;
    alone.gradients = no_gradients();
    alone.gradients.*wanted = true;
    const MeshGradient found = gradient_of(alone, weights).meshes[0];
    const bool normals = wanted == &GradientRequest::normals;
    CHECK(found.normals == (normals ? all.meshes[0].normals : std::vector<glm::vec3>()));
    CHECK(found.specular == (normals ? std::vector<glm::vec3>() : all.meshes[0].specular));
    CHECK(found.shininess == (normals ? std::vector<double>() : all.meshes[0].shininess));
    CHECK(found.positions.empty());
  }
  Scene unlit = scene;
  unlit.lights.reset();
  const MeshGradient of_unlit = gradient_of(unlit, weights).meshes[0];
  CHECK(of_unlit.normals.empty());
  CHECK(of_unlit.specular.empty());
  const std::vector<View> views(3,
                                View{scene.camera, {scene.meshes[0].transform, scene.meshes[1].transform}});
  const std::vector<Image> of_views(views.size(), weights);
  Renderer one(open_device());
  one.set_scene(scene);
  one.set_views(views);
  one.forward();
  const SceneGradient three_times = one.backward(of_views);
  const std::vector<double> single = flat(all.meshes[0].normals), sum = flat(three_times.meshes[0].normals);
  for (std::size_t i = 0; i < sum.size(); ++i) CHECK(sum[i] == doctest::Approx(3 * single[i]).epsilon(1e-4));
  CHECK(three_times.meshes[0].shininess[0] == doctest::Approx(3 * all.meshes[0].shininess[0]).epsilon(1e-4));
  for (const ViewGradient& view : three_times.views)
    CHECK(view.transforms[0].rotation == three_times.views[0].transforms[0].rotation);
  MultiDeviceRenderer several(dpr::test::several_devices(2));
  several.set_scene(scene);
  several.set_views(views);
  const SceneGradient of_several = several.gradient(of_views);
  const std::vector<double> parts = flat(of_several.meshes[0].normals);
  for (std::size_t i = 0; i < sum.size(); ++i) CHECK(parts[i] == doctest::Approx(sum[i]).epsilon(1e-4));
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("materials and given normals: images are the reference's") {
    const int size = reduced(24, 7);
    for (const Shading shading : k_every_shading) {
      CAPTURE(static_cast<int>(shading));
      const Scene scene = surface_scene(shading, size);
      CHECK(largest_difference(rendered(scene), reference::render(to_reference(scene))) < 1e-4);
      Scene plain = scene;
      plain.meshes[0].mesh.materials.clear();
      plain.meshes[0].mesh.face_materials.clear();
      CHECK(largest_difference(rendered(plain), reference::render(to_reference(scene))) > 5e-3);
      if (shading == Shading::flat) continue;
      plain = scene;
      plain.meshes[0].mesh.face_normals.clear();
      CHECK(largest_difference(rendered(plain), reference::render(to_reference(scene))) > 5e-3);
    }
  }

  TEST_CASE("materials and given normals: gradients are the reference's finite differences") {
    const int size = reduced(16, 5);
    const Image weights = random_image(size, size, -1, 1);
    for (const Shading shading : k_every_shading) {
      const Scene scene = surface_scene(shading, size);
      const SceneGradient gradient = gradient_of(scene, weights);
      CHECK(gradient.meshes[1].specular.empty());
      CHECK(gradient.meshes[1].normals.empty());
      for (const Direction& block : directions(gradient)) {
        CAPTURE(static_cast<int>(shading));
        CAPTURE(block.name);
        if (shading == Shading::flat && block.name == "normals") {
          CHECK(norm(block.found) == 0);
          continue;
        }
        REQUIRE(norm(block.found) > 1e-4);
        for (unsigned seed = 1; seed <= (dpr::test::is_reduced() ? 1 : 3); ++seed)
          CHECK(error_along(scene, block, weights, seed) < 1e-3);
      }
    }
  }

  TEST_CASE("materials and given normals: alone they have the same gradients, on several devices too") {
    for (const Shading shading : {Shading::phong, Shading::microfacet}) check_alone(shading);
  }

  /// A square of two triangles whose diagonal moves: what jumps at it is seen by noise of the pixel.
  TEST_CASE("materials and given normals: new ones are those of a new scene") {
    const int size = reduced(24, 7);
    Scene scene = surface_scene(Shading::phong, size);
    const Image weights = random_image(size, size, -1, 1);
    Renderer renderer(open_device());
    MultiDeviceRenderer several(dpr::test::several_devices(2));
    renderer.set_scene(scene);
    several.set_scene(scene);
    renderer.forward();
    several.render();
    const Image before = renderer.image();
    Mesh& mesh = scene.meshes[0].mesh;
    for (glm::vec3& normal : mesh.normals) normal = 1.5F * normal + glm::vec3(0.3F, -0.2F, 0.1F);
    renderer.set_normals(0, mesh.normals);
    several.set_normals(0, mesh.normals);
    renderer.forward();
    const Image turned = renderer.image();
    CHECK(turned.pixels != before.pixels);
    CHECK(turned.pixels == rendered(scene).pixels);
    CHECK(several.render()[0].pixels == turned.pixels);
    for (Material& material : mesh.materials) {
      material.specular = 0.4F * material.specular + glm::vec3(0.1F, 0.3F, 0.2F);
      material.shininess = material.shininess ? std::nullopt : std::optional(3.5F);
    }
    renderer.set_materials(0, mesh.materials);
    several.set_materials(0, mesh.materials);
    renderer.forward();
    CHECK(renderer.image().pixels != turned.pixels);
    CHECK(renderer.image().pixels == rendered(scene).pixels);
    CHECK(several.render()[0].pixels == renderer.image().pixels);
    CHECK(renderer.scene().meshes[0].mesh.normals == mesh.normals);
    CHECK(renderer.scene().meshes[0].mesh.materials == mesh.materials);
    const MeshGradient found = renderer.backward(std::span(&weights, 1)).meshes[0],
                       expected = gradient_of(scene, weights).meshes[0];
    CHECK(found.normals == expected.normals);
    CHECK(found.specular == expected.specular);
    CHECK(found.shininess == expected.shininess);
  }

  TEST_CASE("materials and given normals: where they jump an edge is a crease") {
    const int size = reduced(48, 9);
    Mesh square;
    square.positions = {{-1.0F, -1.05F, 0}, {1.02F, -1.0F, 0}, {1.0F, 1.03F, 0}, {-1.04F, 1.0F, 0}};
    square.faces = {{0, 1, 2}, {0, 2, 3}};
    Scene scene = scene_of(square, size, size);
    scene.smoothing = smoothing_preset("pixel");
    Lights lights;
    lights.point = {{{0.5F, 0.3F, 3.0F}, glm::vec3(0.6F), glm::vec3(0.5F)}};
    lights.shininess = 2;
    scene.lights = lights;
    scene.meshes[0].transform = glm::mat4(1);
    scene.camera = orbit_camera(3.5F, 5.0F, 4.0F);
    const auto contours = [&](const Scene& of) {
      Renderer renderer(open_device());
      renderer.set_scene(of);
      renderer.forward();
      impl_of(renderer).require_forward("test");
      return impl_of(renderer).pixel_noise->contour.pairs;
    };
    const std::size_t smooth = contours(scene);
    Scene two = scene, turned = scene, same = scene;
    two.meshes[0].mesh.materials = {{glm::vec3(1), 1.0F}, {glm::vec3(0.1F), 1.0F}};
    two.meshes[0].mesh.face_materials = {0, 1};
    turned.meshes[0].mesh.normals = {{0, 0, 1}, {0.6F, 0, 0.8F}};
    turned.meshes[0].mesh.face_normals = {{0, 0, 0}, {1, 1, 1}};
    same.meshes[0].mesh.normals = {{0, 0, 1}, {0, 0, 1}};
    same.meshes[0].mesh.face_normals = turned.meshes[0].mesh.face_normals;
    CHECK(contours(two) > smooth);
    CHECK(contours(turned) > smooth);
    CHECK(contours(same) == smooth);
    Renderer flattened(open_device());
    flattened.set_scene(turned);
    flattened.forward();
    flattened.set_normals(0, same.meshes[0].mesh.normals);
    flattened.forward();
    impl_of(flattened).require_forward("test");
    CHECK(impl_of(flattened).pixel_noise->contour.pairs == smooth);
    two.lights.reset();
    CHECK(contours(two) == smooth);
    if (dpr::test::is_reduced()) return;
    two.lights = lights;
    const Image weights = random_image(size, size, 0.5F, 1);
    for (Scene* const jumping : {&two, &turned}) {
      // Both ends of the diagonal and no other edge's sides: finite differences of the blurred image itself.
      const SceneGradient g = gradient_of(*jumping, weights);
      Scene above = *jumping, below = *jumping;
      constexpr float k_step = 0.02F;
      const glm::vec3 way(0.3F, -0.3F, 0);
      above.meshes[0].mesh.positions[0] += k_step * way;
      below.meshes[0].mesh.positions[0] -= k_step * way;
      const double expected = (weighted(to_reference(rendered(above)), weights) -
                               weighted(to_reference(rendered(below)), weights)) /
                              (2 * static_cast<double>(k_step));
      const double found = glm::dot(glm::dvec3(g.meshes[0].positions[0]), glm::dvec3(way));
      CHECK(found == doctest::Approx(expected).epsilon(0.05));
    }
  }

  TEST_CASE("materials and given normals: wrong ones are refused by name") {
    const Scene good = surface_scene(Shading::phong, 8);
    const auto message_with = [&](const std::function<void(Mesh&)>& spoil, const std::string& expected) {
      Scene scene = good;
      spoil(scene.meshes[0].mesh);
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(scene), expected);
    };
    message_with([](Mesh& m) { m.normals[2].x = NAN; }, "normals[2]");
    message_with([](Mesh& m) { m.face_normals.pop_back(); }, "face_normals");
    message_with([](Mesh& m) { m.face_normals[1].y = 99; }, "normal 99");
    message_with([](Mesh& m) { m.materials[1].shininess = 0.5F; }, "shininess of materials[1]");
    message_with([](Mesh& m) { m.materials[0].specular.y = INFINITY; }, "specular of materials[0]");
    message_with([](Mesh& m) { m.face_materials[3] = 3; }, "material 3");
    message_with([](Mesh& m) { m.face_materials.pop_back(); }, "face_materials");
    Renderer renderer(open_device());
    const Mesh& mesh = good.meshes[0].mesh;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_normals(0, mesh.normals), "no scene");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_materials(0, mesh.materials), "no scene");
    renderer.set_scene(good);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_normals(2, mesh.normals), "below 2");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_normals(1, mesh.normals), "without normals");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_materials(1, mesh.materials), "without materials");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_normals(0, std::span(mesh.normals).first(2)),
                          "normals: got 2 vectors");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_materials(0, std::span(mesh.materials).first(1)),
                          "materials: got 1, expected");
    std::vector<glm::vec3> normals = mesh.normals;
    normals[1].z = NAN;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_normals(0, normals), "normals[1]");
    std::vector<Material> materials = mesh.materials;
    materials[1].shininess = 0.5F;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_materials(0, materials), "shininess of materials[1]");
  }
}

}  // namespace surface_light_test
