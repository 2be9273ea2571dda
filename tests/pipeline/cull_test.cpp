// Faces left out by their facing: the scene without them.
#include <doctest/doctest.h>

#include <algorithm>
#include <vector>

#include "pipeline/determinism.hpp"
#include "renderer/renderer_impl.hpp"

namespace cull_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

/// True if a face winds clockwise in the image: what of it lies beyond the near plane does.
bool is_back(const reference::PreparedScene& prepared, std::size_t face) {
  const std::vector<reference::Vec3d> corners = reference::visible_corners(prepared, face);
  double area = 0;
  for (std::size_t k = 1; k + 1 < corners.size(); ++k)
    area += reference::double_area({corners[0], corners[k], corners[k + 1]});
  return area < 0;
}

/// The scene without the faces that are culled.
Scene without_culled(Scene scene) {
  const reference::PreparedScene prepared = reference::prepare(to_reference(scene));
  Mesh& mesh = scene.meshes[0].mesh;
  const Mesh whole = mesh;
  mesh.faces.clear();
  mesh.face_colors.clear();
  for (std::size_t f = 0; f < whole.faces.size(); ++f) {
    if (is_back(prepared, f) == (scene.cull == Cull::back)) continue;
    mesh.faces.push_back(whole.faces[f]);
    if (!whole.face_colors.empty()) mesh.face_colors.push_back(whole.face_colors[f]);
  }
  scene.cull = Cull::none;
  return scene;
}

Scene with_noise(Scene scene, bool of_pixel) {
  if (!of_pixel) return scene;
  scene.smoothing = smoothing_preset("pixel", scene.width, scene.height);
  scene.smoothing.sigma = 1e-3F;
  return scene;
}

float largest_difference(const Image& a, const Image& b) {
  float largest = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const glm::vec4 apart = glm::abs(a.pixels[i] - b.pixels[i]);
    largest = std::max({largest, apart.x, apart.y, apart.z, apart.w});
  }
  return largest;
}

/// Whole, mirrored, and cut open by the near plane.
std::vector<Scene> scenes() {
  const int width = reduced(36, 11), height = reduced(30, 10);
  std::vector<Scene> list{scene_of(welded_cube(), width, height), scene_of(welded_cube(), width, height),
                          scene_cut_open(welded_cube(), width, height)};
  list[1].meshes[0].transform =
      list[1].meshes[0].transform * glm::scale(glm::mat4(1.0F), glm::vec3(-1, 1, 1));
  return list;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("cull: images and gradients are those of the scene without the faces") {
    const Device device = open_device();
    for (const bool of_pixel : {false, true}) {
      for (std::size_t s = 0; s < scenes().size(); ++s) {
        Scene scene = with_noise(scenes()[s], of_pixel);
        CAPTURE(s);
        for (const Cull cull : {Cull::back, Cull::front}) {
          CAPTURE(cull == Cull::front);
          scene.cull = cull;
          const Scene rest = without_culled(scene);
          CHECK(rest.meshes[0].mesh.faces.size() < scene.meshes[0].mesh.faces.size());
          const Result found = render(device, scene), expected = render(device, rest);
          // The other scene's contours come in another order.
          if (!of_pixel) CHECK(same_bits(found.image, expected.image));
          CHECK(largest_difference(found.image, expected.image) < 1e-5F);
          const std::vector<double> positions = flat(found.gradient.meshes[0].positions);
          std::vector<double> difference = flat(expected.gradient.meshes[0].positions);
          for (std::size_t i = 0; i < positions.size(); ++i) difference[i] -= positions[i];
          CHECK(norm(positions) > 0);
          CHECK(norm(difference) <= (of_pixel ? 1e-5 : 0) * norm(positions));
        }
      }
    }
  }

  TEST_CASE("cull: set and taken back") {
    const Scene scene = test_scene();
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const Result whole = render(renderer);
    const std::size_t dropped = renderer.statistics().faces_dropped;
    renderer.set_cull(Cull::front);
    CHECK_THROWS_AS(static_cast<void>(renderer.image()), InvalidArgument);
    CHECK_FALSE(same_bits(render(renderer).image, whole.image));
    CHECK(renderer.statistics().faces_dropped > dropped);
    renderer.set_views(std::vector<View>{{scene.camera, {scene.meshes[0].transform}}});
    renderer.forward();
    CHECK(renderer.statistics().faces_dropped > dropped);
    renderer.set_cull(Cull::none);
    CHECK(same_bits(render(renderer), whole));
  }
}

}  // namespace cull_test
