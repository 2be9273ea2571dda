// Normals beside colours: the image that they would have as colours of a frame of their own, and its tangents; and
// colours as if nothing were beside them.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "pipeline/scenes.hpp"
#include "renderer/frame.hpp"
#include "solve/pose_light.hpp"
#include "support/reduced.hpp"
#include "support/worst.hpp"

namespace shown_normals_test {

using namespace dpr;
using namespace dpr::test;
using namespace dpr::test::pipeline;

namespace {

/// A ball before a box, a mirrored box that stands beside it, and a pane that gives no normals.
Scene solids(Mesh ball, Mesh box) {
  Scene scene = scene_of(std::move(ball), 40, 32);
  scene.background = glm::vec3(0);
  scene.meshes.push_back({std::move(box), glm::mat4(1.0F)});
  const auto placed = [&](glm::vec3 scale, glm::vec3 at) {
    glm::mat4 to_world = scene.meshes[0].transform;
    for (int k = 0; k < 3; ++k) to_world[k] *= scale[k];
    to_world[3] += glm::vec4(at, 0);
    return to_world;
  };
  scene.meshes[1].transform = placed({0.6F, 0.4F, 0.5F}, {0.5F, 0.4F, -0.3F});
  scene.meshes.push_back({{}, placed({-0.5F, 0.4F, 0.6F}, {-0.7F, -0.3F, 0.2F}), 1});
  return scene;
}

/// The ball with a texture that jumps at the edges of every third face, where its normals do not.
Scene textured(Scene scene) {
  Mesh& ball = scene.meshes[0].mesh;
  ball.textures = {random_texture(8, 8, Wrap::repeat, Filter::trilinear)};
  for (const float shift : {0.5F, 0.8F})
    for (const glm::vec3& p : ball.positions) ball.texcoords.emplace_back(p.x + shift, 0.7F * p.y + shift);
  ball.face_texcoords = ball.faces;
  for (std::size_t f = 0; f < ball.faces.size(); f += 3)
    ball.face_texcoords[f] += static_cast<unsigned>(ball.positions.size());
  return scene;
}

/// The mesh in the colours of its normals: those of faces where it has colours of faces, which are flat.
Mesh normals_as_colors(const Mesh& mesh) {
  Mesh result;
  result.positions = mesh.positions;
  result.faces = mesh.faces;
  if (mesh.face_colors.empty()) result.vertex_colors.resize(mesh.positions.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const glm::uvec3& normals = mesh.face_normals[f];
    if (!mesh.face_colors.empty()) result.face_colors.push_back(mesh.normals[normals.x]);
    for (int k = 0; mesh.face_colors.empty() && k < 3; ++k)
      result.vertex_colors[mesh.faces[f][k]] = mesh.normals[normals[k]];
  }
  return result;
}

struct Frames {
  std::vector<cl_float4> image, tangents;
};

std::vector<SceneTangent> directions_of(const Renderer& renderer, std::size_t count) {
  Random random(9);
  std::vector<SceneTangent> directions(count);
  for (SceneTangent& direction : directions) {
    for (std::size_t v = 0; v < renderer.views().size(); ++v) {
      ViewGradient view;
      for (std::size_t m = 0; m < renderer.scene().meshes.size(); ++m)
        view.transforms.push_back(
            {glm::dvec3(random.vector(-1.0F, 1.0F)), glm::dvec3(random.vector(-1.0F, 1.0F))});
      direction.views.push_back(view);
    }
  }
  return directions;
}

void check_same(const Frames& found, const Frames& expected) {
  const auto compare = [&](const std::vector<cl_float4>& a, const std::vector<cl_float4>& b) {
    constexpr double k_tolerance = 1e-6;
    REQUIRE(a.size() == b.size());
    double largest = 0;
    for (const cl_float4& pixel : b)
      for (const float value : pixel.s) largest = std::max(largest, std::abs(static_cast<double>(value)));
    REQUIRE(largest > 0.1);
    Worst worst;
    for (std::size_t i = 0; i < a.size(); ++i) {
      for (int c = 0; c < 4; ++c)
        worst.add(std::abs(static_cast<double>(a[i].s[c]) - static_cast<double>(b[i].s[c])), "value", i, c);
    }
    DPR_CHECK_WORST(worst, k_tolerance * largest);
  };
  compare(found.image, expected.image);
  compare(found.tangents, expected.tangents);
}

/// Frames of a scene with normals beside colours, with normals as colours, and without. More than 16 directions take
/// several passes.
void check_beside(const Scene& scene, std::size_t directions) {
  const auto frames_of = [&](const Scene& of, bool beside) {
    Renderer renderer(open_device());
    renderer.set_scene(of);
    if (beside) show_normals(renderer);
    renderer.forward();
    Frames colors, normals;
    for (int again = 0; again < 2; ++again) {  // the second frame is enqueued whole
      renderer.forward();
      const std::vector<SceneTangent> moved = directions_of(renderer, directions);
      colors.tangents = last_tangents(renderer, moved, "test").download();
      colors.image = last_frame(renderer, "test").image.download();
      if (!beside) continue;
      normals = {last_normals(renderer, "test").download(), last_normal_tangents(renderer).download()};
    }
    return std::pair(colors, normals);
  };
  const auto [colors, normals] = frames_of(scene, true);
  Scene by_normals = scene;
  for (Instance& entry : by_normals.meshes)
    if (!entry.instance_of) entry.mesh = normals_as_colors(entry.mesh);
  check_same(normals, frames_of(by_normals, false).first);
  check_same(colors, frames_of(scene, false).first);
}

}  // namespace

TEST_SUITE("tangents") {
  TEST_CASE("normals beside colours are what they would be as colours") {
    // Edges too short for corners (kernels/contour.cl): those of a silhouette take account of seams that end there.
    Mesh ball = make_icosphere(2), box = make_cube();
    box.face_colors.assign(box.faces.size(), glm::vec3(0.3F, 0.5F, 0.8F));  // jump nowhere
    give_normals(ball, glm::dmat3(1), CornerNormals::smooth);
    give_normals(box, glm::dmat3(1), CornerNormals::parted);
    const Scene scene = solids(std::move(ball), std::move(box));
    for (const char* preset : {"pixel", "joint_gaussian"}) {
      CAPTURE(preset);
      for (const bool is_textured : {false, true}) {
        CAPTURE(is_textured);
        if (is_reduced() && !is_textured) continue;
        Scene smoothed = is_textured ? textured(scene) : scene;
        smoothed.smoothing = smoothing_preset(preset);
        check_beside(smoothed, 3);
        if (!is_textured) check_beside(smoothed, 18);
      }
    }
  }
}

}  // namespace shown_normals_test
