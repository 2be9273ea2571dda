// The far sides of solids: left out where nothing can see them, and only there.
#include <doctest/doctest.h>

#include <algorithm>

#include "pipeline/determinism.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/reduced.hpp"

namespace back_faces_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::is_reduced;
using dpr::test::reduced;

namespace {

constexpr float k_opaque = 1e-8F;  // gamma

Scene scene_with(const Mesh& mesh, float gamma = k_opaque) {
  Scene scene = scene_of(mesh, reduced(48, 14), reduced(40, 12));
  scene.smoothing = smoothing_preset("pixel");
  scene.smoothing.sigma = 1e-3F;
  scene.smoothing.gamma = gamma;
  return scene;
}

/// With a triangle far beside the image, so that the mesh is not closed.
Mesh opened(Mesh mesh) {
  const auto first = static_cast<unsigned>(mesh.positions.size());
  for (const glm::vec3& p : {glm::vec3(90, 90, 0), glm::vec3(91, 90, 0), glm::vec3(90, 91, 0)}) {
    mesh.positions.push_back(p);
    if (!mesh.vertex_colors.empty()) mesh.vertex_colors.emplace_back(1.0F);
  }
  mesh.faces.emplace_back(first, first + 1, first + 2);
  if (!mesh.face_colors.empty()) mesh.face_colors.emplace_back(1.0F);
  return mesh;
}

Mesh inside_out(Mesh mesh) {
  for (glm::uvec3& face : mesh.faces) std::swap(face.y, face.z);
  return mesh;
}

std::ptrdiff_t kept_faces(const Renderer& renderer) {
  return std::ranges::count(impl_of(renderer).setup.kept.download(), 1U);
}

struct Seen {
  std::ptrdiff_t kept;
  Image image;
  SceneGradient gradient;
};

Seen see(Renderer& renderer) {
  renderer.forward();
  const Image image = renderer.image();
  const Image grad = random_image(image.width, image.height, -1.0F, 1.0F);
  return {kept_faces(renderer), image, renderer.backward(std::span(&grad, 1))};
}

Seen see(const Scene& scene) {
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  return see(renderer);
}

void check_same(const Seen& a, const Seen& b) {
  float largest = 0;
  for (std::size_t i = 0; i < a.image.pixels.size(); ++i) {
    const glm::vec4 apart = glm::abs(a.image.pixels[i] - b.image.pixels[i]);
    largest = std::max({largest, apart.x, apart.y, apart.z, apart.w});
  }
  CHECK(largest < 1e-5F);
  const std::vector<glm::vec3>&p = a.gradient.meshes[0].positions, &q = b.gradient.meshes[0].positions;
  double error = 0, size = 0;
  for (std::size_t i = 0; i < std::min(p.size(), q.size()); ++i) {
    error += static_cast<double>(glm::dot(p[i] - q[i], p[i] - q[i]));
    size += static_cast<double>(glm::dot(p[i], p[i]));
  }
  CHECK(size > 0);
  CHECK(error < 1e-8 * size);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("back faces: solids look the same without theirs, inside out and mirrored too") {
    const glm::mat4 mirror = glm::scale(glm::mat4(1.0F), glm::vec3(-1, 1, 1));
    for (const Mesh& mesh : {welded_cube(), make_cube(), make_icosphere(reduced(3, 1))}) {
      for (const bool turned : {false, true}) {
        for (const bool mirrored : {false, true}) {
          Scene scene = scene_with(turned ? inside_out(mesh) : mesh);
          if (mirrored) scene.meshes[0].transform = scene.meshes[0].transform * mirror;
          Scene whole = scene;
          whole.meshes[0].mesh = opened(scene.meshes[0].mesh);
          const Seen found = see(scene), expected = see(whole);
          CHECK(found.kept < expected.kept);
          check_same(found, expected);
        }
      }
    }
  }

  TEST_CASE("back faces: kept where the near plane opens the solid, and where depths mix") {
    Scene near = scene_with(make_icosphere(2));
    near.camera.znear = 3.8F;
    Scene open_near = near;
    open_near.meshes[0].mesh = opened(near.meshes[0].mesh);
    CHECK(see(near).kept == see(open_near).kept);
    const Mesh ball = make_icosphere(2);
    CHECK(see(scene_with(ball, 1e-1F)).kept > see(scene_with(ball)).kept);
  }

  TEST_CASE("back faces: of what has been pulled apart or turned inside out by moving it") {
    Scene scene = scene_with(make_cube());
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const Seen whole = see(renderer);
    std::vector<glm::vec3> positions = scene.meshes[0].mesh.positions;
    for (std::size_t v = 0; v < positions.size(); ++v) positions[v] *= v < 4 ? 1.2F : 1.0F;
    renderer.set_positions(0, positions);
    const Seen parted = see(renderer);
    CHECK(parted.kept > whole.kept);
    scene.meshes[0].mesh.positions = positions;
    check_same(parted, see(scene));

    scene = scene_with(make_icosphere(2));
    renderer.set_scene(scene);
    static_cast<void>(see(renderer));
    for (glm::vec3& p : scene.meshes[0].mesh.positions) p = -p;
    renderer.set_positions(0, scene.meshes[0].mesh.positions);
    const Seen turned = see(renderer);
    check_same(turned, see(scene));
    CHECK(turned.image.pixels == see(scene).image.pixels);
  }

  TEST_CASE("back faces: of large solids, which the device measures, inside out, mirrored and moved") {
    if (is_reduced()) return;
    const Mesh ball = make_icosphere(6);
    Renderer renderer(open_device());
    for (const bool turned : {false, true}) {
      for (const float side : {1.0F, -1.0F}) {
        Scene scene = scene_with(turned ? inside_out(ball) : ball);
        scene.meshes[0].transform = glm::scale(scene.meshes[0].transform, glm::vec3(side, 1, 1));
        Scene whole = scene;
        whole.meshes[0].mesh = opened(scene.meshes[0].mesh);
        renderer.set_scene(scene);
        const Seen found = see(renderer), expected = see(whole);
        CHECK(found.kept < expected.kept);
        check_same(found, expected);
        for (glm::vec3& p : scene.meshes[0].mesh.positions) p = -p;
        renderer.set_positions(0, scene.meshes[0].mesh.positions);
        const Seen moved = see(renderer);
        CHECK(moved.kept < expected.kept);
        CHECK(moved.image.pixels == see(scene).image.pixels);
      }
    }
  }

  TEST_CASE("back faces: a large flat solid has no sides, and one beside a small one has its own") {
    if (is_reduced()) return;
    Mesh flat = make_icosphere(6);
    for (glm::vec3& p : flat.positions) p.x = 0.5F * p.z;
    Scene scene = scene_with(flat), whole = scene;
    whole.meshes[0].mesh = opened(flat);
    CHECK(see(scene).kept == see(whole).kept);
    scene = scene_with(make_cube());
    const auto ball = scene.meshes[0];
    scene.meshes.push_back({inside_out(make_icosphere(6)), ball.transform});
    scene.meshes.push_back({{}, glm::translate(ball.transform, glm::vec3(0.5F)), 1});
    whole = scene;
    whole.meshes[1].mesh = opened(scene.meshes[1].mesh);
    const Seen found = see(scene), expected = see(whole);
    CHECK(found.kept < expected.kept);
    check_same(found, expected);
  }

  TEST_CASE("back faces: a mesh that moves as a whole looks as it does in a new scene") {
    Scene scene = scene_with(make_cube());
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const Seen before = see(renderer);
    renderer.set_positions(0, scene.meshes[0].mesh.positions);
    check_same(see(renderer), before);
    for (glm::vec3& p : scene.meshes[0].mesh.positions) p = 1.1F * p + glm::vec3(0.1F, 0, 0);
    renderer.set_positions(0, scene.meshes[0].mesh.positions);
    const Seen moved = see(renderer);
    check_same(moved, see(scene));
    CHECK(moved.kept == before.kept);
  }

  TEST_CASE("back faces: with noise of the triangles all are kept") {
    Scene scene = scene_with(make_icosphere(2));
    const std::ptrdiff_t kept = see(scene).kept;
    scene.smoothing = smoothing_preset("gaussian");
    CHECK(see(scene).kept > kept);
  }
}

}  // namespace back_faces_test
