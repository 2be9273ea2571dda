// Numbers of vertices at samples: a textured mesh that the caller shades, and derivatives.
#include "dpr/interpolate.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "check/scenes.hpp"
#include "dpr/texture_map.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace interpolate_test {

using namespace dpr;
using namespace dpr::test;

namespace {

constexpr float k_near = 2.2F;  // cuts the mesh

std::vector<float> drawn(std::size_t count, unsigned seed) {
  check::Random random(seed);
  std::vector<float> numbers(count);
  for (float& number : numbers) number = random(-1, 1);
  return numbers;
}

double dot(std::span<const float> a, std::span<const float> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0, std::plus<>(),
                            [](float x, float y) { return static_cast<double>(x) * static_cast<double>(y); });
}

std::span<const float> numbers_of(const std::vector<glm::vec2>& vectors) {
  return {reinterpret_cast<const float*>(vectors.data()), 2 * vectors.size()};
}
std::span<const float> numbers_of(const std::vector<glm::vec3>& vectors) {
  return {reinterpret_cast<const float*>(vectors.data()), 3 * vectors.size()};
}

/// The largest difference over the largest number.
double error_of(std::span<const float> found, std::span<const float> wanted) {
  REQUIRE(found.size() == wanted.size());
  double most = 0, worst = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    most = std::max(most, std::abs(static_cast<double>(wanted[i])));
    worst = std::max(worst, std::abs(static_cast<double>(found[i]) - static_cast<double>(wanted[i])));
  }
  REQUIRE(most > 0);
  return worst / most;
}

/// A torus with a texture that goes on over its edges, in two views, white and without lights.
Scene textured_torus(Filter filter) {
  Mesh mesh = make_torus(1.0F, 0.45F, 16, 10);
  mesh.vertex_colors.clear();
  mesh.face_colors.clear();
  for (const glm::vec3& position : mesh.positions)
    mesh.texcoords.emplace_back(0.7F * position.x + 0.2F * position.z, 0.6F * position.y + 0.3F * position.z);
  mesh.face_texcoords = mesh.faces;
  mesh.textures.push_back(check::random_texture(6, 5, Wrap::mirror, filter));
  Scene scene = check::scene_of(std::move(mesh), reduced(48, 16), reduced(40, 12));
  scene.lights.reset();
  scene.background = glm::vec3(0);
  scene.smoothing = smoothing_preset("pixel");
  scene.smoothing.sigma = 1e-3F;
  scene.smoothing.supersampling = 2;
  scene.gradients = {.positions = true, .texture = true, .texcoords = true};
  return scene;
}

std::vector<View> two_views(const Scene& scene) {
  Camera other = orbit_camera(3.4F, 70, 20);
  other.znear = k_near;
  return {{scene.camera, {glm::mat4(1)}}, {other, {glm::mat4(1)}}};
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("a texture by the caller: the library's own image and its gradients") {
    const Scene scene = textured_torus(Filter::bilinear);
    const Mesh& mesh = scene.meshes[0].mesh;
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.set_views(two_views(scene));
    renderer.forward();
    const Samples samples = renderer.samples();
    const std::vector<float> texcoords(numbers_of(mesh.texcoords).begin(), numbers_of(mesh.texcoords).end());
    const Attributes attributes{.faces = mesh.face_texcoords, .values = texcoords, .channels = 2};
    const TextureMap texture(mesh.textures[0]);

    const std::vector<float> uv = interpolate(samples, attributes);
    std::vector<float> colors = texture.values({.coordinates = uv});
    const auto without_background = [&](std::vector<float>& of_colors) {
      for (std::size_t i = 0; i < samples.faces.size(); ++i)
        if (samples.faces[i] < 0)
          std::fill_n(of_colors.begin() + static_cast<std::ptrdiff_t>(3 * i), 3, 0.0F);
    };
    without_background(colors);
    const std::vector<float> image = renderer.resolve(colors, 3);
    std::vector<glm::vec4> own_pixels(image.size() / 3);
    renderer.read_pixels(own_pixels);
    std::vector<float> own_image, weights = drawn(image.size(), 4);
    std::vector<glm::vec4> own_weights;
    for (std::size_t i = 0; i < own_pixels.size(); ++i) {
      for (int c = 0; c < 3; ++c) own_image.push_back(own_pixels[i][c]);
      own_weights.emplace_back(weights[3 * i], weights[3 * i + 1], weights[3 * i + 2], 0);
    }
    CHECK(error_of(image, own_image) < 1e-5);

    ResolveGradient by_contours = renderer.resolve_backward(colors, 3, weights);
    without_background(by_contours.samples);
    const TextureMapGradient by_texture = texture.backward({.coordinates = uv}, by_contours.samples);
    const InterpolateGradient inside = interpolate_backward(samples, attributes, by_texture.coordinates);
    const SceneGradient by_samples =
        renderer.samples_backward(inside.barycentrics, std::vector<float>(samples.depths.size()));
    const MeshGradient own = renderer.backward_pixels(own_weights).meshes[0];
    CHECK(error_of(by_texture.texels, numbers_of(own.textures[0])) < 1e-4);
    CHECK(error_of(inside.values, numbers_of(own.texcoords)) < 1e-4);
    std::vector<glm::vec3> positions = by_contours.scene.meshes[0].positions;
    for (std::size_t i = 0; i < positions.size(); ++i) positions[i] += by_samples.meshes[0].positions[i];
    CHECK(error_of(numbers_of(positions), numbers_of(own.positions)) < 1e-4);
  }

  TEST_CASE("steps of barycentrics are those to the neighbouring samples") {
    const Scene scene = textured_torus(Filter::bilinear);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.set_views(two_views(scene));  // of which one cuts faces
    renderer.forward();
    const Samples samples = renderer.samples(true);
    REQUIRE(samples.steps.size() == samples.faces.size());
    const auto width = static_cast<std::size_t>(samples.width);
    std::size_t compared = 0;
    double worst = 0;
    for (std::size_t i = width + 1; i + width + 1 < samples.faces.size(); ++i) {
      if (samples.faces[i] < 0) {
        CHECK(samples.steps[i] == vec4(0));
        continue;
      }
      for (const bool is_down : {false, true}) {
        const std::size_t step = is_down ? width : 1;
        if (samples.faces[i - step] != samples.faces[i] || samples.faces[i + step] != samples.faces[i])
          continue;
        // Over the depth they and 1 are linear on the screen.
        const auto over_depth = [&](std::size_t at) {
          return glm::dvec3(glm::vec3(samples.barycentrics[at], 1)) / static_cast<double>(samples.depths[at]);
        };
        const glm::dvec3 change = 0.5 * (over_depth(i + step) - over_depth(i - step));
        const glm::dvec2 expected = static_cast<double>(samples.depths[i]) *
                                    (glm::dvec2(change) - glm::dvec2(samples.barycentrics[i]) * change.z);
        const vec4& found = samples.steps[i];
        const glm::dvec2 of_found = is_down ? glm::dvec2(found.y, found.w) : glm::dvec2(found.x, found.z);
        worst = std::max(worst, glm::length(of_found - expected) / glm::length(expected));
        ++compared;
      }
    }
    CHECK(compared > (is_reduced() ? 10 : 2000));
    CHECK(worst < 2e-3);

    // Of a plane of attributes the steps are those of its plane: positions move by as much as the camera's rays part.
    const Mesh& mesh = scene.meshes[0].mesh;
    const std::vector<float> values(numbers_of(mesh.positions).begin(), numbers_of(mesh.positions).end());
    const std::vector<float> steps = interpolate_steps(samples, {mesh.faces, values, 3});
    const std::vector<float> places = interpolate(samples, {mesh.faces, values, 3});
    double largest = 0, error = 0;
    for (std::size_t i = 1; i + 1 < samples.faces.size(); ++i) {
      if (samples.faces[i] < 0 || samples.faces[i - 1] != samples.faces[i] ||
          samples.faces[i + 1] != samples.faces[i])
        continue;
      for (std::size_t c = 0; c < 3; ++c) {
        const double change = 0.5 * static_cast<double>(places[3 * (i + 1) + c] - places[3 * (i - 1) + c]);
        largest = std::max(largest, std::abs(change));
        error = std::max(error, std::abs(static_cast<double>(steps[6 * i + 2 * c]) - change));
      }
    }
    CHECK(error < 0.05 * largest);
  }

  TEST_CASE("backward and forward mode of interpolation, with attributes and faces of each view") {
    const Scene scene = textured_torus(Filter::bilinear);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.set_views(two_views(scene));
    renderer.set_layers(2);
    renderer.forward();
    const Samples samples = renderer.samples(true);
    std::vector<uvec3> faces = scene.meshes[0].mesh.faces;
    std::vector<uvec3> of_views = faces;
    std::ranges::reverse_copy(faces, std::back_inserter(of_views));
    const std::size_t rows = scene.meshes[0].mesh.positions.size();
    for (const bool is_by_view : {false, true}) {
      const std::vector<float> values = drawn((is_by_view ? 2 : 1) * 5 * rows, 1);
      const Attributes attributes{is_by_view ? of_views : faces, values, 5, is_by_view, is_by_view};
      const std::vector<float> found = interpolate(samples, attributes),
                               steps = interpolate_steps(samples, attributes);
      const std::vector<float> grad = drawn(found.size(), 2), grad_steps = drawn(steps.size(), 3),
                               moves = drawn(values.size(), 4);
      check::Random random(5);
      std::vector<vec2> barycentrics;
      for (std::size_t i = 0; i < samples.faces.size(); ++i)
        barycentrics.emplace_back(random(-1, 1), random(-1, 1));
      const InterpolateGradient inside = interpolate_backward(samples, attributes, grad);
      const std::vector<float> tangent = interpolate_tangent(samples, attributes, moves, barycentrics);
      const double forward = dot(grad, tangent),
                   backward = dot(inside.values, moves) +
                              dot(numbers_of(inside.barycentrics), numbers_of(barycentrics));
      CHECK(std::abs(forward - backward) < 1e-5 * std::sqrt(dot(grad, grad) * dot(tangent, tangent)));
      // Steps are linear in the attributes.
      const InterpolateGradient with_steps = interpolate_backward(samples, attributes, grad, grad_steps);
      const double by_steps = dot(with_steps.values, values) - dot(inside.values, values);
      CHECK(by_steps == doctest::Approx(dot(grad_steps, steps)).epsilon(1e-4));
      // And in the steps of barycentrics.
      double by_own_steps = 0;
      for (std::size_t i = 0; i < samples.steps.size(); ++i)
        by_own_steps += static_cast<double>(glm::dot(with_steps.steps[i], samples.steps[i]));
      CHECK(by_own_steps == doctest::Approx(dot(grad_steps, steps)).epsilon(1e-4));
      // Each view's own: the second view's attributes do not reach the first.
      if (!is_by_view) continue;
      std::vector<float> others = values;
      std::fill(others.begin() + static_cast<std::ptrdiff_t>(5 * rows), others.end(), 0.0F);
      const std::vector<float> changed = interpolate(samples, {of_views, others, 5, true, true});
      const auto of_view = static_cast<std::size_t>(5 * samples.width * samples.height);
      CHECK(std::equal(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(of_view), changed.begin()));
      CHECK(std::ranges::any_of(std::span(found).subspan(of_view, of_view), [](float v) { return v != 0; }));
      CHECK(
          std::ranges::all_of(std::span(changed).subspan(of_view, of_view), [](float v) { return v == 0; }));
    }
  }

  TEST_CASE("what interpolation refuses") {
    Samples samples;
    samples.width = samples.height = 1;
    samples.faces = {1};
    samples.barycentrics = {{0.2F, 0.3F}};
    const std::vector<uvec3> faces{{0, 1, 2}, {2, 1, 0}}, beyond{{0, 1, 2}, {2, 1, 3}};
    const std::vector<float> values{1, 2, 3}, bad{1, 2, NAN};
    CHECK(interpolate(samples, {faces, values, 1})[0] == doctest::Approx(0.5 * 3 + 0.2 * 2 + 0.3));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, interpolate(samples, {beyond, values, 1}),
                          "faces[1] (interpolate): got 3");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, interpolate(samples, {std::span(faces).first(1), values, 1}),
                          "expected more than 1");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, interpolate(samples, {faces, values, 2}),
                          "attributes (interpolate)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, interpolate(samples, {faces, values, 0}),
                          "channels (interpolate)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, interpolate(samples, {faces, bad, 1}), "attributes (interpolate)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, interpolate({}, {faces, values, 1}), "samples (interpolate)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, interpolate_steps(samples, {faces, values, 1}), "no steps");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, interpolate_backward(samples, {faces, values, 1}, {}),
                          "grad_values");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, interpolate_tangent(samples, {faces, values, 1}, bad, {}),
                          "value_tangents");
  }
}

}  // namespace interpolate_test
