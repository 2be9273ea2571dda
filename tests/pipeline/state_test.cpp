// Earlier renders leave no trace: every scene has the bits of a fresh renderer after
// every other, by whatever way its shape comes; and what is held is told.
#include <doctest/doctest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "dpr/opencl_handles.hpp"
#include "pipeline/determinism.hpp"
#include "pipeline/device_buffers.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/caller.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace state_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::Caller;
using dpr::test::is_reduced;
using dpr::test::reduced;

namespace {

struct Named {
  std::string name;
  Scene scene;
};

int size() { return reduced(20, 9); }

/// The mesh with vertices of every face's own.
Mesh unshared(const Mesh& mesh) {
  Mesh soup;
  for (const glm::uvec3& face : mesh.faces) {
    const auto first = static_cast<unsigned>(soup.positions.size());
    for (int corner = 0; corner < 3; ++corner) {
      soup.positions.push_back(mesh.positions[face[corner]]);
      soup.vertex_colors.push_back(0.5F + 0.3F * soup.positions.back());
    }
    soup.faces.emplace_back(first, first + 1, first + 2);
  }
  return soup;
}

/// No two vertices in one place.
Mesh perturbed(Mesh mesh, float by) {
  Random random(23);
  for (glm::vec3& p : mesh.positions) p += random.vector(-by, by);
  return mesh;
}

Scene soup_scene() { return scene_of(unshared(make_icosphere(1, 1.2F)), size(), size()); }

/// Scenes of unlike topologies, sizes and stages.
std::vector<Named> representative_scenes() {
  std::vector<Named> all{
      {"cube", cube_scene(size(), size() - 3)},
      {"soup", soup_scene()},
      {"parted soup", scene_of(perturbed(unshared(make_icosphere(1, 1.2F)), 0.1F), size(), size())},
      {"sphere", scene_of(make_icosphere(1), size() + 5, size())},
      {"within", scene_within(make_icosphere(1), size(), size())},
      {"textured",
       textured_scene(make_cube(), random_texture(4, 3, Wrap::repeat, Filter::trilinear), size(), size())},
      {"lit", cube_scene(size(), size())},
      {"instances", scene_of(make_icosphere(0), size(), size())},
      {"collapsed", scene_of(make_icosphere(0), size(), size())},
      {"triangles", cube_scene(size(), size())},
      {"joint", cube_scene(size(), size())}};
  const auto named = [&](const std::string& name) -> Scene& {
    return std::ranges::find(all, name, &Named::name)->scene;
  };
  for (Named& each : all) each.scene.smoothing = smoothing_preset("pixel");
  named("lit").lights = two_lights(Shading::phong);
  named("textured").gradients.texture = named("textured").gradients.texcoords = true;
  named("instances").meshes.push_back({{}, placed(40.0F, 0.6F, {-0.8F, 0.1F, 0.3F}), 0});
  for (glm::vec3& p : named("collapsed").meshes[0].mesh.positions) p = glm::vec3(0.1F);
  named("triangles").smoothing = smoothing_preset("gaussian");
  named("joint").smoothing = smoothing_preset("joint_gaussian");
  return all;
}

std::vector<glm::vec3> positions_of(const Scene& scene) { return scene.meshes[0].mesh.positions; }

/// Both shapes to render by one topology, of a scene with either.
std::vector<std::vector<glm::vec3>> shapes_of_soup() {
  const Mesh soup = unshared(make_icosphere(1, 1.2F));
  return {soup.positions, perturbed(soup, 0.2F).positions, perturbed(soup, 1e-6F).positions};
}

Scene with_shape(Scene scene, const std::vector<glm::vec3>& shape) {
  scene.meshes[0].mesh.positions = shape;
  return scene;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("state: every scene has the bits of a fresh renderer after every other") {
    const std::vector<Named> all = representative_scenes();
    const Device device = open_device();
    std::vector<Result> fresh;
    for (const Named& each : all) fresh.push_back(render(device, each.scene));
    Renderer renderer(device);
    for (std::size_t before = 0; before < all.size(); ++before) {
      for (std::size_t now = 0; now < all.size(); ++now) {
        if (is_reduced() && now != (before + 1) % all.size()) continue;
        CAPTURE(all[before].name);
        CAPTURE(all[now].name);
        renderer.set_scene(all[before].scene);
        renderer.forward();
        renderer.set_scene(all[now].scene);
        CHECK(same_bits(render(renderer), fresh[now]));
      }
    }
  }

  TEST_CASE("state: a shape has the bits of a fresh renderer after every other of its topology") {
    const Scene scene = soup_scene();
    const std::vector<std::vector<glm::vec3>> shapes = shapes_of_soup();
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    std::vector<Result> fresh;
    for (const auto& shape : shapes) fresh.push_back(render(device, with_shape(scene, shape)));
    CHECK_FALSE(same_bits(fresh[0].image, fresh[2].image));  // parted by next to nothing, each is alone
    for (const auto& before : shapes) {
      for (std::size_t now = 0; now < shapes.size(); ++now) {
        if (is_reduced() && &before != &shapes[(now + 1) % shapes.size()]) continue;
        CAPTURE(now);
        Renderer renderer(device);
        renderer.set_scene(with_shape(scene, before));
        renderer.forward();
        renderer.set_positions(0, shapes[now]);
        CHECK(same_bits(render(renderer), fresh[now]));
        set_positions(renderer, 0, {caller.buffer(packed(std::span(before)))()});
        renderer.forward();
        set_positions(renderer, 0, {caller.buffer(packed(std::span(shapes[now])))()});
        const Result by_buffer = render(renderer);
        renderer.set_positions(0, before);
        renderer.forward();
        renderer.set_positions(0, shapes[now]);
        CHECK(same_bits(render(renderer), fresh[now]));
        Renderer other(device);
        other.set_scene(with_shape(scene, shapes[now]));
        set_positions(other, 0, {caller.buffer(packed(std::span(shapes[now])))()});
        CHECK(same_bits(render(other), by_buffer));
      }
    }
  }

  TEST_CASE("state: views with shapes of their own show what each would alone") {
    const Scene scene = soup_scene();
    const std::vector<std::vector<glm::vec3>> shapes = shapes_of_soup();
    const Device device = open_device();
    const auto images_of = [&](Renderer& renderer, const std::vector<std::size_t>& order) {
      std::vector<glm::vec3> joined;
      for (const std::size_t s : order) joined.insert(joined.end(), shapes[s].begin(), shapes[s].end());
      renderer.set_views(std::vector<View>(order.size(), renderer.views()[0]));
      renderer.set_shapes(joined, {});
      renderer.forward();
    };
    std::vector<Image> alone;
    for (std::size_t s = 0; s < shapes.size(); ++s) {
      Renderer renderer(device);
      renderer.set_scene(scene);
      images_of(renderer, {s});
      alone.push_back(renderer.image());
    }
    Renderer renderer(device);
    renderer.set_scene(scene);
    const std::vector<std::vector<std::size_t>> orders{{0, 1, 2}, {1, 0}, {2, 0, 1}, {0}, {2}, {1, 2, 0}};
    for (const std::vector<std::size_t>& order : orders) {
      images_of(renderer, order);
      for (std::size_t view = 0; view < order.size(); ++view)
        CHECK(same_bits(renderer.image(view), alone[order[view]]));
    }
    renderer.set_views(std::vector<View>(1, renderer.views()[0]));  // with the scene's shape again
    CHECK(same_bits(render(renderer), render(device, scene)));
  }

  TEST_CASE("state: faces on vertices of their own are one surface where these coincide") {
    const Scene soup = soup_scene();
    Scene shared = scene_of(make_icosphere(1, 1.2F), size(), size());
    shared.meshes[0].mesh.vertex_colors.clear();
    for (const glm::vec3& p : positions_of(shared))
      shared.meshes[0].mesh.vertex_colors.push_back(0.5F + 0.3F * p);
    const Result one = render(open_device(), shared), other = render(open_device(), soup);
    float largest = 0;
    for (std::size_t i = 0; i < one.image.pixels.size(); ++i) {
      const glm::vec4 off = glm::abs(one.image.pixels[i] - other.image.pixels[i]);
      largest = std::max({largest, off.x, off.y, off.z, off.w});
    }
    CHECK(largest < 1e-5F);
  }

  TEST_CASE("state: large arrays, which the device takes as they are, are checked and set like small ones") {
    if (is_reduced()) return;
    constexpr std::size_t k_bad = 150'000;
    Scene scene = scene_of(make_icosphere(7), size(), size());
    scene.smoothing = smoothing_preset("pixel");
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const Result before = render(renderer);
    Mesh& mesh = scene.meshes[0].mesh;
    std::vector<glm::vec3> wrong = mesh.positions;
    wrong[k_bad].y = std::numeric_limits<float>::quiet_NaN();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_positions(0, wrong), "positions[150000]");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_colors(0, wrong), "colors[150000]");
    wrong.pop_back();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_positions(0, wrong), "163841 vectors");
    CHECK(renderer.scene().meshes[0].mesh.positions == mesh.positions);
    CHECK(render(renderer).image.pixels == before.image.pixels);
    for (int step = 0; step < 3; ++step) {
      for (glm::vec3& p : mesh.positions) p *= glm::vec3(0.9F, 0.95F, 1);
      for (glm::vec3& color : mesh.vertex_colors) color *= 0.9F;
      renderer.set_positions(0, mesh.positions);
      renderer.set_colors(0, mesh.vertex_colors);
      const Result moved = render(renderer), expected = render(open_device(), scene);
      CHECK(renderer.scene().meshes[0].mesh.positions == mesh.positions);
      CHECK(moved.image.pixels == expected.image.pixels);
      CHECK(moved.gradient.meshes[0].positions == expected.gradient.meshes[0].positions);
      CHECK(moved.gradient.meshes[0].colors == expected.gradient.meshes[0].colors);
    }
  }

  TEST_CASE("state: what the renderer says it holds is what the device has allocated") {
    if (is_reduced()) return;
    std::vector<Named> all = representative_scenes();
    for (const char* preset : {"softras", "paper_gaussian", "joint_gaussian"})
      all.push_back({preset, cube_scene(size(), size())}),
          all.back().scene.smoothing = smoothing_preset(preset);
    all.push_back({"sampled", cube_scene(size(), size())});
    all.back().scene.smoothing = smoothing_preset("pixel");
    all.back().scene.smoothing.occupancy_estimator = Estimator::monte_carlo;
    for (const Named& each : all) {
      CAPTURE(each.name);
      const Device device = open_device();
      Renderer renderer(device);
      const auto is_told = [&] { return renderer.statistics().device_bytes == device.allocated_bytes(); };
      renderer.set_scene(each.scene);
      renderer.forward();
      CHECK(is_told());
      render(renderer);
      CHECK(is_told());
      renderer.forward();
      auxiliary_outputs(renderer);
      CHECK(is_told());
      renderer.set_positions(0, positions_of(each.scene));
      renderer.set_views(std::vector<View>(2, renderer.views()[0]));
      renderer.forward();
      CHECK(is_told());
      auxiliary_outputs(renderer);
      CHECK(is_told());
    }
  }
}

}  // namespace state_test
