// Noise of the pixel against its reference in double precision: the image, and every kind of gradient against
// finite differences of the reference.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "reference/pixel_noise.hpp"
#include "support/reduced.hpp"

namespace pixel_noise_reference_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

constexpr int k_width = 20, k_height = 16;

/// With 4x4 samples a pixel, what lies between the raster and the reference is a sixteenth of what one would
/// leave.
Scene blurred(Scene scene, double pixels, float gamma) {
  scene.smoothing = smoothing_preset("pixel", scene.width, scene.height);
  scene.smoothing.supersampling = 4;
  scene.smoothing.gamma = gamma;
  const double ndc = 2 * pixels / std::min(scene.width, scene.height);
  scene.smoothing.sigma = static_cast<float>(ndc * ndc);
  return scene;
}

Scene whole_cube() { return scene_of(welded_cube(), reduced(k_width, 8), reduced(k_height, 6)); }

/// In front of a smaller one that is opaque: sides are seen through sides.
Scene glass_cube(bool is_smooth) {
  Scene scene = whole_cube();
  Mesh& glass = scene.meshes[0].mesh;
  if (is_smooth) {
    for (std::size_t i = 0; i < glass.positions.size(); ++i)
      glass.vertex_opacities.push_back(0.3F + 0.05F * static_cast<float>(i));
  } else {  // the sides are told apart by their opacities alone
    std::ranges::fill(glass.face_colors, glass.face_colors[0]);
    for (std::size_t i = 0; i < glass.faces.size(); ++i)
      glass.face_opacities.push_back(0.25F + 0.1F * static_cast<float>(i / 2));
  }
  Mesh core = welded_cube();
  std::ranges::fill(core.face_colors, glm::vec3(0.1F, 0.8F, 0.3F));
  scene.meshes.push_back({core, placed(20, 0.4F)});
  scene.gradients.opacities = true;
  return scene;
}

/// The near plane cuts it open, in sight.
Scene cut_cube() { return scene_cut_open(welded_cube(), reduced(k_width, 8), reduced(k_height, 6)); }

/// A triangle in the camera's space, whose near plane is at 1.
Scene cut_triangle(const std::vector<glm::vec3>& corners, float zfar = 20.0F) {
  Mesh mesh;
  mesh.positions = corners;
  mesh.faces = {{0, 1, 2}};
  mesh.face_colors = {{0.9F, 0.4F, 0.2F}};
  Scene scene = scene_of(mesh, reduced(k_width, 8), reduced(k_height, 6));
  scene.meshes[0].transform = glm::mat4(1.0F);
  scene.camera.view = glm::mat4(1.0F);
  scene.camera.zfar = zfar;
  return scene;
}

/// Triangles of which the near plane leaves a quadrilateral, and a triangle; and the far plane.
std::vector<Scene> cut_triangles() {
  return {cut_triangle({{-0.8F, -0.5F, -3.0F}, {0.9F, -0.6F, -3.5F}, {0.15F, 0.6F, 0.4F}}),
          cut_triangle({{-0.4F, -0.3F, 0.2F}, {1.9F, 1.1F, -4.5F}, {-0.2F, 0.5F, 0.5F}}),
          cut_triangle({{-0.8F, -0.5F, -2.6F}, {0.9F, -0.6F, -3.0F}, {0.3F, 2.0F, -7.0F}}, 5.0F),
          cut_triangle({{-2.8F, -1.0F, -7.0F}, {0.9F, 0.9F, -2.5F}, {1.5F, -2.8F, -8.0F}}, 5.0F)};
}

reference::Scene twin_of(const Scene& scene, bool is_opaque) {
  reference::Scene twin = to_reference(scene);
  if (is_opaque) twin.smoothing.gamma = 0;
  return twin;
}

/// A derivative of the image that changes over some pixels.
reference::Image smooth_weights(int width, int height) {
  reference::Image image = reference::make_image(width, height);
  for (std::size_t i = 0; i < image.rgba.size(); ++i) {
    const double x = static_cast<double>(i / 4 % static_cast<std::size_t>(width)) / width;
    const double y = static_cast<double>(i / 4 / static_cast<std::size_t>(width)) / height;
    image.rgba[i] =
        std::cos(5 * x + static_cast<double>(i % 4)) + std::sin(6 * y - 0.7 * static_cast<double>(i % 4));
  }
  return image;
}

Image to_library(const reference::Image& image) {
  Image result(image.width, image.height);
  for (std::size_t i = 0; i < image.rgba.size(); ++i)
    result.pixels[i / 4][static_cast<int>(i % 4)] = static_cast<float>(image.rgba[i]);
  return result;
}

/// A way to move the reference's scene, and what the library says of it.
struct Direction {
  std::string name;
  double found, size;  ///< derivative along it; norm of the block times that of the direction
  double step;
  std::function<void(reference::Scene&, double)> move;
};

reference::Vec3d axis(int i) { return {i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, i == 2 ? 1.0 : 0.0}; }

/// A row of the rotation exp([r]x) to first order is enough: the step's error is of its square.
reference::Mat4d turned(const reference::Mat4d& m, const reference::Vec3d& r) {
  reference::Mat4d result = m;
  for (std::size_t column = 0; column < 3; ++column) {
    const reference::Vec3d change = cross(r, {m[0][column], m[1][column], m[2][column]});
    for (std::size_t row = 0; row < 3; ++row) result[row][column] += change[row];
  }
  return result;
}

void add_positions(const SceneGradient& gradient, std::vector<Direction>& list) {
  const std::vector<glm::vec3>& positions = gradient.meshes[0].positions;
  const double size = norm(flat(positions));
  for (unsigned seed = 0; seed < 4; ++seed) {
    Random random(seed);
    std::vector<glm::vec3> direction;
    double found = 0, squares = 0;
    for (const glm::vec3& g : positions) {
      direction.push_back(random.vector(-1, 1));
      found += static_cast<double>(glm::dot(g, direction.back()));
      squares += static_cast<double>(glm::dot(direction.back(), direction.back()));
    }
    // The part of a random direction that lies along the gradient is its size over the root of the dimension.
    const double scale = std::sqrt(squares / static_cast<double>(3 * positions.size()));
    list.push_back({"positions", found, size * scale, 1e-3, [direction](reference::Scene& s, double t) {
                      for (std::size_t i = 0; i < direction.size(); ++i)
                        s.meshes[0].positions[i] += t * to_reference(direction[i]);
                    }});
  }
}

void add_opacities(const Scene& scene, const SceneGradient& gradient, std::vector<Direction>& list) {
  const std::vector<float>& opacities = gradient.meshes[0].opacities;
  if (opacities.empty()) return;
  Random random(9);
  std::vector<double> direction;
  double found = 0, squares = 0, size = 0;
  for (const float g : opacities) {
    direction.push_back(static_cast<double>(random(-1, 1)));
    found += direction.back() * static_cast<double>(g);
    squares += direction.back() * direction.back();
    size += static_cast<double>(g) * static_cast<double>(g);
  }
  const bool is_smooth = !scene.meshes[0].mesh.vertex_opacities.empty();
  const double scale = std::sqrt(size * squares / static_cast<double>(opacities.size()));
  list.push_back({"opacities", found, scale, 1e-3, [direction, is_smooth](reference::Scene& s, double t) {
                    auto& moved = is_smooth ? s.meshes[0].vertex_opacities : s.meshes[0].face_opacities;
                    for (std::size_t i = 0; i < direction.size(); ++i) moved[i] += t * direction[i];
                  }});
}

std::vector<Direction> directions(const Scene& scene, const SceneGradient& gradient) {
  std::vector<Direction> list;
  add_positions(gradient, list);
  add_opacities(scene, gradient, list);
  const PoseGradient& model = gradient.views[0].transforms[0];
  const CameraGradient& camera = gradient.views[0].camera;
  for (int i = 0; i < 3; ++i) {
    const reference::Vec3d e = axis(i);
    const auto k = static_cast<std::size_t>(i);
    list.push_back({"rotation", model.rotation[i], glm::length(model.rotation), 1e-3,
                    [e](reference::Scene& s, double t) {
                      s.meshes[0].transform = turned(s.meshes[0].transform, t * e);
                    }});
    list.push_back({"translation", model.translation[i], glm::length(model.translation), 1e-3,
                    [k](reference::Scene& s, double t) { s.meshes[0].transform[k][3] += t; }});
    list.push_back({"camera rotation", camera.view.rotation[i], glm::length(camera.view.rotation), 1e-3,
                    [e](reference::Scene& s, double t) { s.camera.view = turned(s.camera.view, t * e); }});
    list.push_back({"background", gradient.background[i], glm::length(gradient.background), 1e-2,
                    [k](reference::Scene& s, double t) { s.background[k] += t; }});
  }
  list.push_back({"fov", camera.fov_y_degrees, std::abs(camera.fov_y_degrees), 1e-2,
                  [](reference::Scene& s, double t) { s.camera.fov_y_degrees += t; }});
  list.push_back({"sigma", gradient.sigma, std::abs(gradient.sigma),
                  1e-3 * static_cast<double>(scene.smoothing.sigma),
                  [](reference::Scene& s, double t) { s.smoothing.sigma += t; }});
  return list;
}

/// Contours that meet take colours of the samples around with an error of second order in the samples'
/// distance: a share of the geometry's gradients that falls as the resolution grows, more where corners are
/// sharp, and most where the near plane cuts surfaces open that hide parts of each other. Contours that are seen
/// through others cross them, with an error of first order.
struct Tolerance {
  double geometry, others;  // times the squared width
};
constexpr Tolerance k_silhouette{0.4, 0.4}, k_triangle{1.6, 0.4}, k_creases{2, 0.4}, k_cut{16, 0.4},
    k_glass{16, 1};

double tolerance_of(const Direction& d, const Tolerance& t) {
  const double width = reduced(k_width, 8);
  const bool is_of_geometry = d.name != "sigma" && d.name != "background" && d.name != "opacities";
  return (is_of_geometry ? t.geometry : t.others) / (width * width);
}

/// At the reduced size the blur is as wide as the corners that the near plane cuts off.
const int k_wide_corners = reduced(1, 3);

Tolerance at_cuts(const Tolerance& t) { return {k_wide_corners * t.geometry, k_wide_corners * t.others}; }

double largest_difference(const Image& found, const reference::Image& expected) {
  double largest = 0;
  for (std::size_t i = 0; i < expected.rgba.size(); ++i) {
    const double difference =
        std::abs(static_cast<double>(found.pixels[i / 4][static_cast<int>(i % 4)]) - expected.rgba[i]);
    if (!(difference <= largest)) largest = difference;
  }
  return largest;
}

void check_gradients(const Scene& scene, const Tolerance& tolerance) {
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  renderer.forward();
  const reference::Image weights = smooth_weights(scene.width, scene.height);
  const Image grad_image = to_library(weights);
  const SceneGradient gradient = renderer.backward(std::span(&grad_image, 1));
  for (const Direction& d : directions(scene, gradient)) {
    reference::Scene above = twin_of(scene, true), below = above;
    d.move(above, d.step);
    d.move(below, -d.step);
    const double expected = (reference::pixel_noise_objective(above, weights) -
                             reference::pixel_noise_objective(below, weights)) /
                            (2 * d.step);
    const double error = std::abs(d.found - expected) / d.size;
    CHECK(d.size > 0);
    CHECK_MESSAGE(error < tolerance_of(d, tolerance), d.name << ": " << error);
  }
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("pixel noise: the image is the reference's, opaque and mixed by depth") {
    for (const double pixels : {1.0, 2.0}) {
      for (const float gamma : {1e-8F, 3e-2F}) {
        const Scene scene = blurred(whole_cube(), pixels, gamma);
        Renderer renderer(open_device());
        renderer.set_scene(scene);
        renderer.forward();
        const reference::Scene twin = twin_of(scene, gamma < 1e-6F);
        CAPTURE(pixels);
        CAPTURE(gamma);
        const double error = largest_difference(renderer.image(), reference::render_pixel_noise(twin));
        // Surfaces that mix vary between samples. What is left falls with the square of the scale.
        const double at_one_pixel = gamma < 1e-6F && !test::is_reduced() ? 6e-4 : 4e-3;
        CHECK(error < at_one_pixel / (pixels * pixels));
      }
    }
  }

  TEST_CASE("pixel noise: surfaces are seen through as the reference has it, opaque ones behind them too") {
    for (const bool is_smooth : {false, true}) {
      for (const float gamma : {1e-8F, 3e-2F}) {
        const Scene scene = blurred(glass_cube(is_smooth), 2, gamma);
        Renderer renderer(open_device());
        renderer.set_scene(scene);
        renderer.forward();
        const reference::Scene twin = twin_of(scene, gamma < 1e-6F);
        CAPTURE(gamma);
        const double error = largest_difference(renderer.image(), reference::render_pixel_noise(twin));
        CHECK(error < 6e-4);
      }
    }
  }

  TEST_CASE("pixel noise: the image of what the near plane cuts is the reference's") {
    const auto check = [](const Scene& of, double tolerance) {
      const Scene scene = blurred(of, 2, 1e-8F);
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      const Image image = renderer.image();
      CHECK(largest_difference(image, reference::render_pixel_noise(twin_of(scene, true))) < tolerance);
    };
    for (const Scene& scene : cut_triangles()) check(scene, 1.5e-3);
    check(cut_cube(), k_wide_corners * 6e-3);
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("pixel noise: gradients against differences of the reference") {
    for (const bool has_creases : {false, true}) {
      Scene scene = blurred(whole_cube(), 2, 1e-8F);
      std::vector<glm::vec3>& colors = scene.meshes[0].mesh.face_colors;
      if (!has_creases) std::ranges::fill(colors, colors[0]);
      CAPTURE(has_creases);
      check_gradients(scene, has_creases ? k_creases : k_silhouette);
    }
  }

  TEST_CASE("pixel noise: gradients of what is seen through against differences of the reference") {
    for (const bool is_smooth : {false, true})
      check_gradients(blurred(glass_cube(is_smooth), 2, 1e-8F), at_cuts(k_glass));
  }

  TEST_CASE("pixel noise: gradients of what the near plane cuts against differences of the reference") {
    for (const Scene& scene : cut_triangles()) check_gradients(blurred(scene, 2, 1e-8F), at_cuts(k_triangle));
    check_gradients(blurred(cut_cube(), 2, 1e-8F), at_cuts(k_cut));
  }
}

}  // namespace pixel_noise_reference_test
