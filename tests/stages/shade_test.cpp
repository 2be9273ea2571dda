// Shading against the reference, every model: the fragments' colours, and the gradients of colours,
// barycentrics, world positions, the eye and the lights.
#include <doctest/doctest.h>

#include <array>
#include <map>

#include "check/comparison.hpp"
#include "check/scenes.hpp"
#include "dpr/dpr.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/aggregate_errors.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"
#include "support/worst.hpp"

namespace shade_test {

namespace {

namespace ref = dpr::reference;
using dpr::Buffer;
using dpr::Shading;
using dpr::test::number;
using dpr::test::poison;
using dpr::test::RandomFloat;
using dpr::test::Worst;

ref::Vec3d to_reference(const cl_float4& v) { return {number(v.s[0]), number(v.s[1]), number(v.s[2])}; }

struct Model {
  std::string_view name;
  std::optional<Shading> shading;
  bool has_every_light = false;
};
/// With point lights alone, as most scenes are, and with lights of every kind.
constexpr std::array<Model, 11> k_models{{{"unlit", std::nullopt},
                                          {"flat", Shading::flat},
                                          {"phong", Shading::phong},
                                          {"gouraud", Shading::gouraud},
                                          {"blinn", Shading::blinn},
                                          {"microfacet", Shading::microfacet},
                                          {"flat, every light", Shading::flat, true},
                                          {"phong, every light", Shading::phong, true},
                                          {"gouraud, every light", Shading::gouraud, true},
                                          {"blinn, every light", Shading::blinn, true},
                                          {"microfacet, every light", Shading::microfacet, true}}};

/// Tolerances, about twice the errors measured, relative to the largest of their kind. Colours 2.5e-6
/// (Phong's power); gradients: colours 1.1e-7, barycentrics 1.1e-6, positions 3.3e-6 (flat), eye 2.1e-6,
/// lights 6.8e-7; the angles of a cone, between whose cosines there is little, 4.7e-5, on Intel's
/// runtime 1.0e-4.
constexpr double k_color = 5e-6, k_gradient = 6.5e-6, k_angle = 2e-4;

/// Microfacet gradients of barycentrics, positions and lights: 3.6e-5. Surfaces seen from behind, in light that falls
/// along them, have a quotient of two cosines near 0.
constexpr double k_facet_gradient = 7e-5;

dpr::Lights make_lights(const Model& model) {
  dpr::Lights lights;
  lights.shading = *model.shading;
  lights.ambient = glm::vec3(0.4F, 0.5F, 0.3F);
  lights.shininess = 12;
  lights.point = {{glm::vec3(1, 3, 4), glm::vec3(0.5F, 0.3F, 0.4F), glm::vec3(0.6F, 0.5F, 0.4F)},
                  {glm::vec3(-4, 1, 2), glm::vec3(0.2F, 0.4F, 0.3F), glm::vec3(0.3F, 0.2F, 0.5F)},
                  {glm::vec3(0, -1, -9), glm::vec3(0.5F), glm::vec3(0.5F)}};  // from behind
  if (!model.has_every_light) return lights;
  lights.directional = {{glm::vec3(-0.4F, -0.7F, -0.9F), glm::vec3(0.3F, 0.2F, 0.4F), glm::vec3(0.2F)},
                        {glm::vec3(2, -0.5F, 0.3F), glm::vec3(0.2F, 0.5F, 0.1F), glm::vec3(0.4F)}};
  lights.spot = {
      {glm::vec3(2, 2, 3), glm::vec3(-1.7F, -2.1F, -3), 25, 5, glm::vec3(0.4F), glm::vec3(0.3F)},
      {glm::vec3(-3.1F, 2.2F, -1.3F), glm::vec3(3, -2, 1.5F), 120, 0, glm::vec3(0.3F), glm::vec3(0.2F)}};
  RandomFloat random(4);
  for (std::size_t k = 0; k < dpr::k_harmonics; ++k) lights.harmonics.push_back(random.color() - 0.5F);
  return lights;
}

/// A smooth mesh with vertex colours and one with face colours, in two views.
dpr::Scene make_scene(const Model& model) {
  dpr::Scene scene;
  scene.smoothing = dpr::smoothing_preset("gaussian");
  scene.width = dpr::test::reduced(26, 5);
  scene.height = dpr::test::reduced(19, 5);
  scene.camera = dpr::orbit_camera(5, 20, 30);
  dpr::Mesh sphere = dpr::make_icosphere(dpr::test::is_reduced() ? 0 : 1);
  RandomFloat random(3);
  for (glm::vec3& color : sphere.vertex_colors) color = random.color();
  dpr::Mesh cube = dpr::make_cube();
  cube.vertex_colors.clear();
  cube.face_colors.clear();
  for (std::size_t i = 0; i < cube.faces.size(); ++i) cube.face_colors.push_back(random.color());
  glm::mat4 aside(1.0F);
  aside[3] = glm::vec4(1.2F, 0.5F, -0.8F, 1);
  if (model.shading) sphere.materials = cube.materials = dpr::check::materials_for(*model.shading);
  scene.meshes = {{sphere, glm::mat4(1.0F)}, {cube, aside}};
  if (model.shading) scene.lights = make_lights(model);
  scene.smoothing.blur_radius = 0.02F;
  return scene;
}

/// The stages up to shading, and the same scene for the reference, from the very positions and barycentrics
/// the stage gets.
class Shaded {
 public:
  explicit Shaded(const Model& model) : renderer_(dpr::test::test_device()), scene_(make_scene(model)) {
    renderer_.set_scene(scene_);
    std::vector<dpr::View> views;
    for (const float azimuth : {30.0F, 140.0F}) {
      dpr::View view{scene_.camera, {scene_.meshes[0].transform, scene_.meshes[1].transform}};
      view.camera.view = dpr::orbit_camera(5, 20, azimuth).view;
      views.push_back(view);
    }
    renderer_.set_views(views);
    renderer_.forward();
    dpr::Renderer::Impl& m = impl();
    bary1 = m.rasterize.plane(m.frame, DPR_PLANE_BARY);
    bary2 = m.rasterize.plane(m.frame, DPR_PLANE_BARY + 1);
    dpr::test::set_planes(m.rasterize.values, m.frame.fragments,
                          {{DPR_PLANE_BARY, bary1}, {DPR_PLANE_BARY + 1, bary2}});
    m.shade.forward(inputs());
    read();
  }

  dpr::Renderer::Impl& impl() { return impl_of(renderer_); }
  dpr::ShadeInputs inputs() {
    dpr::Renderer::Impl& m = impl();
    return {m.frame,           m.device_views, *m.geometry, m.transform,
            m.setup.triangles, m.clip.faces,   m.bin,       m.rasterize};
  }

  ref::Vec3d barycentric(std::size_t fragment) const {
    const double c1 = number(bary1[fragment]), c2 = number(bary2[fragment]);
    return {1.0 - c1 - c2, c1, c2};
  }
  std::size_t view(std::size_t fragment) const { return pair_face[fragment_pair[fragment]] / faces; }
  std::size_t face(std::size_t fragment) const { return pair_face[fragment_pair[fragment]] % faces; }
  ref::CornerColors corners(std::size_t fragment) const {
    ref::CornerColors result;
    for (std::size_t k = 0; k < 3; ++k) result[k] = to_reference(colors[face_colors[face(fragment)].s[k]]);
    return result;
  }

  std::size_t faces = 0, vertices = 0;
  std::vector<ref::ShadeScene> reference;  // of every view
  std::vector<cl_uint> list, fragment_pair, pair_face;
  std::vector<float> bary1, bary2;
  std::vector<cl_uint4> face_colors;
  std::vector<cl_float4> colors;

 private:
  void read() {
    dpr::Renderer::Impl& m = impl();
    faces = m.geometry->faces;
    vertices = m.geometry->vertices;
    list = m.rasterize.list.download();
    fragment_pair = m.rasterize.fragment_pair.download();
    pair_face = m.bin.pair_face.download();
    std::vector<cl_uint4> all_faces = m.geometry->face_vertices.download();
    face_colors.assign(all_faces.begin() + m.frame.color_faces, all_faces.end());
    all_faces.resize(faces);
    colors = m.geometry->color_values.download();
    const std::vector<cl_float4> world = m.transform.world.download();
    const std::vector<dpr::shared::ViewParams> cameras = m.device_views.cameras.download();
    std::vector<ref::Face> reference_faces;
    for (const cl_uint4& f : all_faces) reference_faces.push_back({f.s[0], f.s[1], f.s[2]});
    for (std::size_t v = 0; v < cameras.size(); ++v) {
      std::vector<ref::Vec3d> positions;
      for (std::size_t i = 0; i < vertices; ++i) positions.push_back(to_reference(world[v * vertices + i]));
      reference.push_back(
          ref::shade_prepare(positions, reference_faces, reference_lights(), to_reference(cameras[v].eye)));
    }
  }

  std::optional<ref::Lights> reference_lights() const {
    if (!scene_.lights) return std::nullopt;
    ref::Lights lights = dpr::check::to_reference(*scene_.lights);
    for (const dpr::Material& material : scene_.meshes[0].mesh.materials)
      lights.reflectance = dpr::check::to_reference(material.specular);
    return lights;
  }

  dpr::Renderer renderer_;
  dpr::Scene scene_;
};

/// Errors against the largest value of their kind.
struct Kind {
  std::vector<double> found, wanted;
  void add(double have, double want) {
    found.push_back(have);
    wanted.push_back(want);
  }
  void add(const ref::Vec3d& have, const ref::Vec3d& want) {
    for (std::size_t k = 0; k < 3; ++k) add(have[k], want[k]);
  }
  double largest() const {
    double size = 0;
    for (const double value : wanted) size = std::max(size, std::abs(value));
    return size;
  }
  Worst worst(double distortion = 1) const {
    Worst result;
    const double size = largest();
    for (std::size_t i = 0; i < found.size(); ++i) {
      result.add(std::abs(found[i] * distortion - wanted[i]) / std::max(size, 1e-30), "value", i, "found",
                 found[i], "wanted", wanted[i]);
    }
    return result;
  }
};

struct ShadeErrors {
  Kind color, corner_colors, bary, world, eye;
  std::map<std::string, Kind> lights;  // by key
};

/// Three planes of the fragments, from one on.
std::array<std::vector<float>, 3> planes_of(const dpr::Renderer::Impl& m, cl_uint first) {
  return {m.rasterize.plane(m.frame, first), m.rasterize.plane(m.frame, first + 1),
          m.rasterize.plane(m.frame, first + 2)};
}

ShadeErrors all_errors(const Model& model) {
  Shaded s(model);
  dpr::Renderer::Impl& m = s.impl();
  ShadeErrors errors;
  const auto color = [&, red = planes_of(m, DPR_PLANE_COLOR)](std::size_t i) {
    return ref::Vec3d{number(red[0][i]), number(red[1][i]), number(red[2][i])};
  };
  const std::size_t fragments = m.rasterize.fragments, views = s.reference.size();

  RandomFloat random(9);
  std::array<std::vector<float>, 3> grad;
  for (auto& plane : grad) plane.assign(fragments, dpr::test::k_poison);
  for (const cl_uint fragment : s.list) {
    for (auto& plane : grad) plane[fragment] = random(-1, 1);
  }
  dpr::test::set_planes(
      m.rasterize.grads, m.frame.grad_fragments,
      {{DPR_PLANE_COLOR, grad[0]}, {DPR_PLANE_COLOR + 1, grad[1]}, {DPR_PLANE_COLOR + 2, grad[2]}});
  poison(m.shade.grad_pairs, (DPR_PAIR_LIT(false) + DPR_PAIR_LIT_END) * m.bin.pairs);
  m.shade.backward(s.inputs());
  Buffer<cl_float4> grad_world;
  if (model.shading) m.shade.backward_world(s.inputs(), m.gather, grad_world);

  // The reference, fragment by fragment.
  std::vector<ref::ShadeGradient> totals;
  for (const ref::ShadeScene& scene : s.reference) totals.push_back(ref::make_shade_gradient(scene));
  const std::vector<float> grad_bary1 = m.rasterize.grad_plane(m.frame, DPR_PLANE_BARY),
                           grad_bary2 = m.rasterize.grad_plane(m.frame, DPR_PLANE_BARY + 1),
                           grad_pairs = m.shade.grad_pairs.download();
  std::vector<ref::CornerColors> pair_colors(m.bin.pairs);
  for (const cl_uint i : s.list) {
    const ref::ShadeScene& scene = s.reference[s.view(i)];
    const ref::Vec3d c = s.barycentric(i);
    errors.color.add(color(i), ref::shade_forward(scene, s.face(i), c, s.corners(i)));
    const ref::ShadeFragmentGradient g =
        ref::shade_backward(scene, s.face(i), c, s.corners(i),
                            {number(grad[0][i]), number(grad[1][i]), number(grad[2][i])}, totals[s.view(i)]);
    errors.bary.add(number(grad_bary1[i]), g.barycentric.y - g.barycentric.x);
    errors.bary.add(number(grad_bary2[i]), g.barycentric.z - g.barycentric.x);
    for (std::size_t k = 0; k < 3; ++k) pair_colors[s.fragment_pair[i]][k] += g.corners[k];
  }
  for (std::size_t v = 0; v < views; ++v) ref::shade_finish_backward(s.reference[v], totals[v]);
  for (std::size_t pair = 0; pair < m.bin.pairs; ++pair) {
    for (std::size_t k = 0; k < 9; ++k) {
      errors.corner_colors.add(number(grad_pairs[9 * pair + k]), pair_colors[pair][k / 3][k % 3]);
    }
  }
  const std::vector<cl_float4> world = grad_world.download();
  for (std::size_t i = 0; i < world.size(); ++i) {
    errors.world.add(to_reference(world[i]), totals[i / s.vertices].world[i % s.vertices]);
  }
  if (!model.shading) return errors;

  const std::span<const float> eye =
      std::span(grad_pairs).subspan((DPR_PAIR_LIT(false) + DPR_PAIR_EYE) * m.bin.pairs);
  std::vector<ref::Vec3d> eye_sums(views);
  for (std::size_t pair = 0; pair < m.bin.pairs; ++pair) {
    for (std::size_t k = 0; k < 3; ++k) {
      eye_sums[s.pair_face[pair] / s.faces][k] += number(eye[k * m.bin.pairs + pair]);
    }
  }
  for (std::size_t v = 0; v < views; ++v) errors.eye.add(eye_sums[v], totals[v].camera);
  poison(m.shade.light_channels, m.shade.light_channel_count() * m.bin.pairs);
  for (std::size_t l = 0; l < m.shade.lights(); ++l) m.shade.backward_light(s.inputs(), l);
  const std::vector<float> channels = m.shade.light_channels.download();
  std::vector<float> sums;
  for (std::size_t k = 0; k < m.shade.light_channel_count(); ++k) {
    double sum = 0;
    for (std::size_t pair = 0; pair < m.bin.pairs; ++pair) sum += number(channels[k * m.bin.pairs + pair]);
    sums.push_back(static_cast<float>(sum));
  }
  dpr::SceneGradient found;
  dpr::read_light_gradients(*m.scene.lights, sums, found);
  const std::vector<double> numbers = dpr::check::light_numbers(found);
  std::vector<double> wanted(numbers.size());
  for (const ref::ShadeGradient& total : totals) {
    std::size_t i = 0;
    for (const double value : numbers_of(total.lights)) wanted.at(i++) += value;
  }
  // Angles count degrees, the rest lengths and colours: each kind of number against the largest of its own.
  std::size_t i = 0;
  for_each_light_number(found, [&](std::string_view key, auto) {
    errors.lights[std::string(key)].add(numbers[i], wanted[i]);
    ++i;
  });
  return errors;
}

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("shade: colours and every gradient are the reference's, whatever the model") {
    for (const Model& model : k_models) {
      CAPTURE(std::string(model.name));
      const ShadeErrors errors = all_errors(model);
      const double of_light = model.shading == Shading::microfacet ? k_facet_gradient : k_gradient;
      REQUIRE(!errors.color.found.empty());
      DPR_CHECK_WORST(errors.color.worst(), k_color);
      DPR_CHECK_WORST(errors.corner_colors.worst(), k_gradient);
      DPR_CHECK_WORST(errors.bary.worst(), of_light);
      CHECK(errors.color.worst(1.001).error > k_color);
      CHECK(errors.corner_colors.worst(1.01).error > k_gradient);
      CHECK(errors.bary.worst(1.01).error > of_light);
      if (!model.shading) continue;
      DPR_CHECK_WORST(errors.world.worst(), of_light);
      DPR_CHECK_WORST(errors.eye.worst(), of_light);
      for (const auto& [key, kind] : errors.lights) {
        CAPTURE(key);
        const double tolerance = key.ends_with("degrees") ? k_angle : of_light;
        DPR_CHECK_WORST(kind.worst(), tolerance);
        CHECK(kind.worst(1.01).error > tolerance);
      }
      CHECK(errors.world.worst(1.01).error > of_light);
      CHECK(errors.eye.worst(1.01).error > of_light);
    }
  }
}

TEST_SUITE("unit") {
  TEST_CASE("shade: without point lights the ambient light alone colours") {
    Model model{"phong", Shading::phong};
    dpr::Scene scene = make_scene(model);
    scene.lights->point.clear();
    dpr::Renderer renderer(dpr::test::test_device());
    renderer.set_scene(scene);
    renderer.forward();
    const std::vector<float> lit = planes_of(impl_of(renderer), DPR_PLANE_COLOR)[0];
    scene.lights.reset();
    renderer.set_scene(scene);
    renderer.forward();
    const std::vector<float> unlit = planes_of(impl_of(renderer), DPR_PLANE_COLOR)[0];
    REQUIRE(lit.size() == unlit.size());
    Worst worst;
    for (std::size_t i = 0; i < lit.size(); ++i)
      worst.add(std::abs(number(lit[i]) - 0.4 * number(unlit[i])), i);
    DPR_CHECK_WORST(worst, 1e-6);
  }

  TEST_CASE("shade: a face without area, or a light on the surface, gives no NaN") {
    for (const Model& model : k_models) {
      if (!model.shading) continue;
      CAPTURE(std::string(model.name));
      dpr::Scene scene = make_scene(model);
      dpr::Mesh mesh;
      mesh.positions = {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, 1, 0}};
      mesh.faces = {
          {0, 1, 2}, {2, 3, 2}, {0, 2, 1}};  // the last turns the vertex normals of the first to zero
      scene.meshes = {{mesh, glm::mat4(1.0F)}};
      scene.lights->point[0].position = glm::vec3(0, 1, 0);
      dpr::Renderer renderer(dpr::test::test_device());
      renderer.set_scene(scene);
      renderer.forward();
      dpr::Image grad(scene.width, scene.height);
      for (glm::vec4& pixel : grad.pixels) pixel = glm::vec4(1.0F);
      const dpr::SceneGradient g = renderer.backward(std::span(&grad, 1));
      for (const glm::vec4& pixel : renderer.image().pixels)
        CHECK(!std::isnan(pixel.x + pixel.y + pixel.z + pixel.w));
      for (const glm::vec3& p : g.meshes[0].positions) CHECK(!std::isnan(p.x + p.y + p.z));
    }
  }
}

}  // namespace shade_test
