// The orientation of faces that nothing can see, by the volumes of meshes that the device measures.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "dpr/dpr.hpp"
#include "stages/setup.hpp"

namespace volumes_test {

using namespace dpr;

TEST_SUITE("unit") {
  TEST_CASE(
      "setup: faces that wind the other way are hidden from the other side, and none without a volume") {
    const Device device = open_device();
    const Mesh ball = make_icosphere(2);
    Mesh turned = ball, flat = ball, broken = ball;
    for (glm::uvec3& face : turned.faces) std::swap(face.x, face.y);
    for (glm::vec3& p : flat.positions) p = {p.x, 2 * p.x + 3 * p.y, p.y};
    broken.positions[7].y = std::nanf("");
    Scene scene;
    for (const Mesh& mesh : {ball, turned, flat, broken, turned})
      scene.meshes.push_back({mesh, glm::mat4(1)});
    scene.meshes.push_back({{}, glm::mat4(1), 1});
    const Geometry geometry(impl_of(device), scene);
    Setup setup(impl_of(device));
    for (std::size_t mesh = 0; mesh < 4; ++mesh) setup.measure(geometry, scene, mesh);  // not the fifth
    shared::FrameParams p{};
    p.views = 2;
    p.meshes = static_cast<cl_uint>(scene.meshes.size());
    const std::vector<float> assumed{1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, 0};
    const Buffer<float> hidden(impl_of(device), assumed);
    CHECK(setup.hide(p, hidden).download() == std::vector<float>{1, -1, 0, 0, 1, -1, -1, 1, 0, 0, -1, 0});
    // Volumes belong to where the meshes are, not to where their origin is.
    Scene moved = scene;
    for (Instance& mesh : moved.meshes) {
      for (glm::vec3& position : mesh.mesh.positions) position += glm::vec3(3, -5, 2);
    }
    const Geometry there(impl_of(device), moved);
    setup.forget_volumes();
    for (const std::size_t mesh : {0U, 1U}) setup.measure(there, moved, mesh);
    CHECK(setup.hide(p, hidden).download() == std::vector<float>{1, -1, 1, 1, 1, -1, -1, 1, -1, -1, -1, 0});
  }
}

}  // namespace volumes_test
