// The transform stage against the reference: vertices of several meshes and views, and the gradients of
// positions, poses and projections.
#include <doctest/doctest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <utility>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "reference/transform.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/aggregate_errors.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"
#include "support/worst.hpp"

namespace transform_test {

namespace {

namespace ref = dpr::reference;
using dpr::test::number;
using dpr::test::poison;
using dpr::test::RandomFloat;
using dpr::test::Worst;

constexpr int k_width = 22, k_height = 13;

ref::Mat4d to_reference(const glm::mat4& m) {
  ref::Mat4d r;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      r[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] = number(m[column][row]);
    }
  }
  return r;
}

ref::Vec3d to_reference(const glm::vec3& v) { return {number(v.x), number(v.y), number(v.z)}; }
ref::Vec3d to_reference(const cl_float4& v) { return {number(v.s[0]), number(v.s[1]), number(v.s[2])}; }

/// The projection in single precision, as the kernel gets it: the test is of the kernel, not of the camera.
ref::Projection to_reference(const dpr::Projection& p, const dpr::Camera& camera) {
  ref::Projection projection{{number(p.scale.x), number(p.scale.y)},
                             {number(p.offset.x), number(p.offset.y)},
                             camera.orthographic_height.has_value(),
                             {}};
  if (camera.distortion) projection.distortion = dpr::check::to_reference(*camera.distortion);
  return projection;
}

glm::mat4 random_pose(RandomFloat& random) {
  const glm::vec3 axis = glm::normalize(glm::vec3(random(-1, 1), random(-1, 1), random(-1, 1)));
  const glm::mat4 turned = glm::rotate(glm::mat4(1.0F), random(0, 3), axis);
  return glm::scale(turned, glm::vec3(random(0.5F, 1.5F), random(0.5F, 1.5F), random(0.5F, 1.5F)));
}

enum class Lens { perfect, distorting, fisheye, orthographic };

/// Two meshes in three views: one camera with intrinsics off the centre. Two of the lenses may distort.
class TwoMeshes {
 public:
  explicit TwoMeshes(Lens lens) : renderer(dpr::test::test_device()) {
    RandomFloat random(5);
    scene.width = k_width;
    scene.height = k_height;
    scene.meshes = {{dpr::make_cube(), glm::mat4(1.0F)},
                    {dpr::make_icosphere(dpr::test::is_reduced() ? 0 : 2), glm::mat4(1.0F)}};
    for (int v = 0; v < 3; ++v) {
      dpr::View view{dpr::orbit_camera(6.0F, 20.0F * static_cast<float>(v), 50.0F), {}};
      if (lens == Lens::orthographic) {
        view.camera.orthographic_height = 5.0F + static_cast<float>(v);
      } else if (v == 1) {
        view.camera.intrinsics = dpr::Intrinsics{20, 24, 12, 5};
      }
      if (lens == Lens::distorting && v > 0)
        view.camera.distortion = dpr::Distortion{-0.31F, 0.12F, 0.02F, -0.03F, 0.05F};
      if (lens == Lens::fisheye && v > 0) view.camera.distortion = dpr::fisheye(0.21F, -0.08F, 0.05F, -0.02F);
      for (int m = 0; m < 2; ++m) {
        glm::mat4 pose = random_pose(random);
        pose[3] = glm::vec4(random(-1, 1), random(-1, 1), random(-1, 1), 1);
        view.transforms.push_back(pose);
      }
      views.push_back(view);
    }
    renderer.set_scene(scene);
    renderer.set_views(views);
    for (std::size_t m = 0; m < 2; ++m) {
      for (const glm::vec3& position : scene.meshes[m].mesh.positions) {
        positions.push_back(position);
        mesh.push_back(m);
      }
    }
  }

  dpr::Renderer::Impl& impl() { return impl_of(renderer); }
  ref::Mat4d model(std::size_t view, std::size_t vertex) const {
    return to_reference(views[view].transforms[mesh[vertex]]);
  }
  std::size_t vertices_of(std::size_t of) const { return scene.meshes[of].mesh.positions.size(); }
  std::size_t first_of(std::size_t of) const { return of == 0 ? 0 : vertices_of(0); }
  ref::Mat4d camera(std::size_t view) const { return to_reference(views[view].camera.view); }
  ref::Projection projection(std::size_t view) const {
    const dpr::Camera& of = views[view].camera;
    return to_reference(dpr::projection(of, k_width, k_height), of);
  }

  dpr::Scene scene;
  dpr::Renderer renderer;
  std::vector<dpr::View> views;
  std::vector<glm::vec3> positions;
  std::vector<std::size_t> mesh;  // of every vertex
};

void add_error(Worst& worst, const ref::Vec3d& found, const ref::Vec3d& wanted, double scale, std::size_t i) {
  for (std::size_t k = 0; k < 3; ++k) {
    worst.add(std::abs(found[k] - wanted[k]) / scale, "vertex", i, "axis", k, "found", found[k], "wanted",
              wanted[k]);
  }
}

/// Twice the errors measured: world 2.1e-7, NDC and depth 4.0e-7, gradients, some summed over eleven
/// vertices, 1.8e-7 of the largest of their kind.
constexpr double k_world = 4.2e-7, k_ndc = 8e-7, k_gradient = 3.6e-7,
                 k_clipped_gradient = 6e-7,  // of several sums more
    k_distortion = 6e-7;                     // of products of up to seven tangents

struct TransformErrors {
  Worst world, positions, model, camera, projection, distortion;
};

/// Terms of a vertex in the sums of every channel. `flip` is 1, or -1 for a wrong sign of two of them.
std::vector<double> channels_of(const ref::TransformGradient& g, double flip) {
  std::vector<double> channels;
  const auto add = [&](const ref::Vec3d& v, double sign) {
    for (std::size_t k = 0; k < 3; ++k) channels.push_back(sign * v[k]);
  };
  add(g.model_rotation, 1);
  add(g.model_translation, 1);
  add(g.view_rotation, flip);
  add(g.view_translation, 1);
  for (const double value :
       {g.projection.scale.x, g.projection.scale.y, g.projection.offset.x, g.projection.offset.y})
    channels.push_back(value);
  for (const double value : g.distortion) channels.push_back(flip * value);
  return channels;
}

/// Runs the backward kernels on random gradients. Unlit, what the world gradients hold before does not count.
/// `clips`: with gradients of clipped faces. `flip` is 1, or -1 to show that a wrong sign is noticed.
TransformErrors backward_errors(Lens lens, bool lit, bool clips, double flip) {
  TwoMeshes t(lens);
  dpr::Renderer::Impl& m = t.impl();
  m.transform.forward(m.frame, m.device_views, *m.geometry, false);
  const std::size_t vertices = t.positions.size(), count = vertices * t.views.size();
  RandomFloat random(6);
  std::vector<cl_float4> grad_ndc, grad_clip, grad_world;
  for (std::size_t i = 0; i < count; ++i) {
    const bool used = i % 5 != 0;  // no kept triangle uses the others
    grad_ndc.push_back(used ? cl_float4{{random(-1, 1), random(-1, 1), random(-1, 1), 0}} : cl_float4{});
    const bool clipped = clips && i % 3 == 0;  // a clipped triangle uses these
    grad_clip.push_back(clipped ? cl_float4{{random(-1, 1), random(-1, 1), random(-1, 1), 0}} : cl_float4{});
    grad_world.push_back(lit ? cl_float4{{random(-1, 1), random(-1, 1), random(-1, 1), 0}}
                             : cl_float4{{NAN, NAN, NAN, NAN}});
  }
  dpr::Buffer<cl_float4> grad(impl_of(m.device), std::span<const cl_float4>(grad_ndc));
  const dpr::Buffer<cl_float4> clip_buffer(impl_of(m.device), std::span<const cl_float4>(grad_clip));
  const dpr::Buffer<cl_float4> world_buffer(impl_of(m.device), std::span<const cl_float4>(grad_world));
  const bool distorts = lens == Lens::distorting || lens == Lens::fisheye;
  const std::size_t channel_count = distorts ? DPR_LENS_CHANNELS : DPR_POSE_CHANNELS;
  const std::size_t segments = 2 * t.views.size(), slots = dpr::slots_of_segments(vertices / 2);
  poison(m.transform.partial_sums, channel_count * segments * 2 * slots);
  poison(m.transform.grad_positions, vertices, cl_float4{{NAN, NAN, NAN, NAN}});
  m.frame.clips = clips ? 1 : 0;
  m.transform.backward(m.frame, m.device_views, lit, clip_buffer, world_buffer, grad);
  m.transform.backward_positions(m.frame, m.device_views, *m.geometry, grad);
  const std::vector<cl_float4> found_world = grad.download(),
                               found_positions = m.transform.grad_positions.download();
  const std::vector<float> partial = m.transform.partial_sums.download();
  CHECK(partial.size() == channel_count * segments * 2 * slots);

  TransformErrors errors;
  std::vector<ref::Vec3d> positions(vertices);
  std::vector<double> sums(channel_count * segments * slots);  // [channel][view][mesh][slot]
  constexpr double k_size = 5;                                 // of the largest gradients
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t view = i / vertices, vertex = i % vertices;
    const ref::TransformGradient g =
        ref::transform_backward(to_reference(t.positions[vertex]), t.model(view, vertex), t.camera(view),
                                t.projection(view), to_reference(grad_ndc[i]),
                                lit ? to_reference(grad_world[i]) : ref::Vec3d{}, to_reference(grad_clip[i]));
    add_error(errors.world, to_reference(found_world[i]), g.model_translation, k_size, i);
    positions[vertex] += g.position;
    const std::size_t run = (t.vertices_of(t.mesh[vertex]) + slots - 1) / slots;
    const std::size_t slot = (vertex - t.first_of(t.mesh[vertex])) / run;
    const std::vector<double> channels = channels_of(g, flip);
    for (std::size_t c = 0; c < channel_count; ++c)
      sums[(c * segments + 2 * view + t.mesh[vertex]) * slots + slot] += channels[c];
  }
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const std::size_t c = i / slots / segments, place = i / slots * 2 * slots + i % slots;
    Worst& worst = c < DPR_CHANNEL_VIEW         ? errors.model
                   : c < DPR_CHANNEL_PROJECTION ? errors.camera
                   : c < DPR_CHANNEL_DISTORTION ? errors.projection
                                                : errors.distortion;
    const double found = number(partial[place]) + number(partial[place + slots]);
    worst.add(std::abs(found - sums[i]) / k_size, "channel", c, "found", found, "wanted", sums[i]);
  }
  for (std::size_t v = 0; v < vertices; ++v) {
    add_error(errors.positions, to_reference(found_positions[v]), positions[v], k_size, v);
  }
  return errors;
}

/// Points on a line through the axis, some beyond the radius where the image would fold over.
void check_held(const dpr::Distortion& lens) {
  dpr::Scene scene;
  scene.width = scene.height = 8;
  scene.camera.distortion = lens;
  const double radius = dpr::largest_radius(*scene.camera.distortion);
  const auto along = [&](double r) { return glm::vec3(0.6 * r, 0.8 * r, -1.0) * 2.0F; };
  dpr::Mesh mesh;
  mesh.positions = {along(radius), along(1.001 * radius), along(40 * radius), along(0.95 * radius)};
  mesh.faces = {{0, 1, 2}, {1, 2, 3}};
  scene.meshes = {{mesh, glm::mat4(1.0F)}};
  dpr::Renderer renderer(dpr::test::test_device());
  renderer.set_scene(scene);
  dpr::Renderer::Impl& m = impl_of(renderer);
  m.transform.forward(m.frame, m.device_views, *m.geometry, false);
  const std::vector<cl_float4> ndc = m.transform.ndc.download();
  const ref::Projection p = to_reference(dpr::projection(scene.camera, 8, 8), scene.camera);
  for (std::size_t i = 0; i < 4; ++i) {
    const ref::Vec3d wanted = ref::transform_forward(to_reference(along(i < 3 ? radius : 0.95 * radius)),
                                                     ref::k_identity, ref::k_identity, p)
                                  .ndc;
    CHECK(number(ndc[i].s[0]) == doctest::Approx(wanted.x).epsilon(1e-6));
    CHECK(number(ndc[i].s[1]) == doctest::Approx(wanted.y).epsilon(1e-6));
  }
  CHECK(ndc[3].s[0] < ndc[0].s[0] - 1e-4F);
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("transform: world, NDC and depth are the reference's") {
    for (const Lens lens : {Lens::perfect, Lens::distorting, Lens::fisheye, Lens::orthographic}) {
      TwoMeshes t(lens);
      dpr::Renderer::Impl& m = t.impl();
      const std::size_t vertices = t.positions.size(), count = vertices * t.views.size();
      poison(m.transform.world, count, cl_float4{{NAN, NAN, NAN, NAN}});
      poison(m.transform.ndc, count, cl_float4{{NAN, NAN, NAN, NAN}});
      m.transform.forward(m.frame, m.device_views, *m.geometry, false);
      const std::vector<cl_float4> world = m.transform.world.download(), ndc = m.transform.ndc.download();
      Worst world_error, ndc_error, shifted;
      for (std::size_t i = 0; i < count; ++i) {
        const std::size_t view = i / vertices, vertex = i % vertices;
        const ref::TransformedVertex v = ref::transform_forward(
            to_reference(t.positions[vertex]), t.model(view, vertex), t.camera(view), t.projection(view));
        add_error(world_error, to_reference(world[i]), v.world, 1, i);
        add_error(ndc_error, to_reference(ndc[i]), v.ndc, 1, i);
        add_error(shifted, to_reference(ndc[i]), v.ndc + ref::Vec3d{0, 1e-4, 0}, 1, i);
        CHECK(world[i].s[3] == 1.0F);
        CHECK(ndc[i].s[3] == 0.0F);
      }
      DPR_CHECK_WORST(world_error, k_world);
      DPR_CHECK_WORST(ndc_error, k_ndc);
      CHECK(shifted.error > k_ndc);
    }
  }

  TEST_CASE("transform: beyond the radius where the image would fold over points are held at it") {
    for (const dpr::Distortion& lens : {dpr::Distortion{-0.3F}, dpr::fisheye(-0.3F, 0, 0, 0)})
      check_held(lens);
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("transform: gradients of positions, poses and projections are the reference's") {
    for (const auto& [lens, lit] : {std::pair{Lens::perfect, true},
                                    {Lens::perfect, false},
                                    {Lens::distorting, true},
                                    {Lens::fisheye, true},
                                    {Lens::orthographic, true}}) {
      for (const bool clips : {false, true}) {
        CAPTURE(static_cast<int>(lens));
        CAPTURE(lit);
        const TransformErrors errors = backward_errors(lens, lit, clips, 1);
        const double tolerance = clips ? k_clipped_gradient : k_gradient;
        DPR_CHECK_WORST(errors.world, tolerance);
        DPR_CHECK_WORST(errors.positions, tolerance);
        DPR_CHECK_WORST(errors.model, tolerance);
        DPR_CHECK_WORST(errors.camera, tolerance);
        DPR_CHECK_WORST(errors.projection, tolerance);
        if (lens == Lens::distorting || lens == Lens::fisheye)
          DPR_CHECK_WORST(errors.distortion, k_distortion);
      }
    }
    for (const Lens lens : {Lens::distorting, Lens::fisheye}) {
      const TransformErrors flipped = backward_errors(lens, true, false, -1);
      CHECK(flipped.camera.error > k_gradient);
      CHECK(flipped.distortion.error > k_distortion);
    }
  }

  TEST_CASE(
      "transform: a vertex in the camera's plane that no triangle uses has a gradient of zero, not NaN") {
    dpr::Scene scene;
    scene.smoothing = dpr::smoothing_preset("gaussian");
    scene.width = scene.height = 8;
    dpr::Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.faces = {{0, 1, 2}};
    scene.meshes = {{mesh, glm::mat4(1.0F)}};  // the camera stands at the origin
    dpr::Renderer renderer(dpr::test::test_device());
    renderer.set_scene(scene);
    dpr::Renderer::Impl& m = impl_of(renderer);
    m.transform.forward(m.frame, m.device_views, *m.geometry, false);
    const std::vector<cl_float4> zeros(3, cl_float4{});
    const dpr::Buffer<cl_float4> grad_lit(impl_of(m.device), std::span<const cl_float4>(zeros));
    dpr::Buffer<cl_float4> grad(impl_of(m.device), std::span<const cl_float4>(zeros));
    m.transform.backward(m.frame, m.device_views, true, {}, grad_lit, grad);
    CHECK(m.transform.partial_sums.download() ==
          std::vector<float>(DPR_POSE_CHANNELS * 2 * m.transform.slots, 0.0F));
    for (const cl_float4& g : grad.download()) CHECK(g.s[0] == 0.0F);
  }
}

}  // namespace transform_test
