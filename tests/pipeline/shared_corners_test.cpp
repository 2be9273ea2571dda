// Gradients of what very many corners share: the sums of those that each corner would have alone.
#include <doctest/doctest.h>

#include <numeric>
#include <vector>

#include "pipeline/reference_comparison.hpp"
#include "pipeline/scenes.hpp"
#include "support/reduced.hpp"

namespace shared_corners_test {

using namespace dpr;
using namespace dpr::test;
using namespace dpr::test::pipeline;

namespace {

/// A lit, textured ball, all of whose corners have the same normal and texture coordinates: one of each, or one a corner.
Scene ball(bool shares) {
  Mesh mesh = make_icosphere(test::reduced(3, 2));
  const std::size_t elements = shares ? 1 : 3 * mesh.faces.size();
  mesh.normals.assign(elements, glm::normalize(glm::vec3(0.2F, 0.3F, 1)));
  mesh.texcoords.assign(elements, glm::vec2(0.3F, 0.6F));
  mesh.textures = {random_texture(8, 8, Wrap::repeat, Filter::trilinear)};
  for (unsigned face = 0; face < mesh.faces.size(); ++face)
    mesh.face_normals.push_back(shares ? glm::uvec3(0) : 3 * face + glm::uvec3(0, 1, 2));
  mesh.face_texcoords = mesh.face_normals;
  Scene scene = lit(scene_of(std::move(mesh), 40, 32));
  scene.gradients.normals = scene.gradients.texcoords = true;
  return scene;
}

MeshGradient gradient_of(const Scene& scene) {
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  View moved = renderer.views().front();
  moved.camera.view[3].x += 0.1F;
  renderer.set_views(std::vector{renderer.views().front(), moved});
  renderer.forward();
  Image weights(scene.width, scene.height);
  for (std::size_t i = 0; i < weights.pixels.size(); ++i)
    weights.pixels[i] = glm::vec4(0.5F, 1, -0.3F, 0.2F) * (1 + 0.1F * static_cast<float>(i % 7));
  return renderer.backward(std::vector(2, weights)).meshes.front();
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("gradients of a normal and of coordinates that all corners share are sums of those of each") {
    const MeshGradient one = gradient_of(ball(true)), each = gradient_of(ball(false));
    const glm::vec3 normal = std::reduce(each.normals.begin(), each.normals.end(), glm::vec3(0));
    const glm::vec2 texcoord = std::reduce(each.texcoords.begin(), each.texcoords.end(), glm::vec2(0));
    REQUIRE(one.normals.size() == 1);
    REQUIRE(one.texcoords.size() == 1);
    REQUIRE(glm::length(normal) > 0.1F);
    REQUIRE(glm::length(texcoord) > 0.1F);
    CHECK(glm::distance(one.normals[0], normal) < 1e-4F * glm::length(normal));
    CHECK(glm::distance(one.texcoords[0], texcoord) < 1e-4F * glm::length(texcoord));
  }
}

}  // namespace shared_corners_test
