// Noise on the pixel: images that do not depend on the tessellation, and every gradient against finite
// differences of the renderer itself.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dpr/dpr.hpp"
#include "pipeline/determinism.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/messages.hpp"
#include "support/worst.hpp"

namespace pixel_noise_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

/// A sphere as its subdivision has it, which fills most of the image.
Scene sphere_scene(unsigned subdivisions, int size, float sigma) {
  Scene scene;
  scene.width = scene.height = size;
  scene.camera.view = glm::translate(glm::mat4(1.0F), glm::vec3(0.0F, 0.0F, -2.732F));
  scene.camera.fov_y_degrees = 60.0F;
  scene.background = {0.1F, 0.3F, 0.2F};
  scene.meshes.push_back({make_icosphere(subdivisions), placed(23.0F)});
  scene.smoothing = smoothing_preset("pixel");
  scene.smoothing.sigma = sigma;
  return scene;
}

/// The sigma whose noise has a scale of so many pixels.
float sigma_of_pixels(double pixels, int size) {
  const double scale = pixels * 2 / size;
  return static_cast<float>(scale * scale);
}

double cross_of(const glm::dvec2& o, const glm::dvec2& a, const glm::dvec2& b) {
  return (a.x - o.x) * (b.y - o.y) - (a.y - o.y) * (b.x - o.x);
}

/// The silhouette of a convex mesh, NDC: the convex hull of the projected vertices (Andrew's monotone chain),
/// counter-clockwise.
std::vector<glm::dvec2> silhouette(const Scene& scene, double radius) {
  const double focal = 1 / std::tan(glm::radians(static_cast<double>(scene.camera.fov_y_degrees)) / 2);
  const glm::dmat4 to_view = glm::dmat4(scene.camera.view) * glm::dmat4(scene.meshes[0].transform);
  std::vector<glm::dvec2> points, hull;
  for (const glm::vec3& p : scene.meshes[0].mesh.positions) {
    const glm::dvec4 v = to_view * glm::dvec4(radius * glm::dvec3(p), 1);
    points.emplace_back(focal * v.x / -v.z, focal * v.y / -v.z);
  }
  std::ranges::sort(points, [](const glm::dvec2& a, const glm::dvec2& b) {
    return a.x < b.x || (a.x == b.x && a.y < b.y);
  });
  for (const bool upper : {false, true}) {
    if (upper) std::ranges::reverse(points);
    std::vector<glm::dvec2> chain;
    for (const glm::dvec2& p : points) {
      while (chain.size() > 1 && cross_of(chain[chain.size() - 2], chain.back(), p) <= 0) chain.pop_back();
      chain.push_back(p);
    }
    hull.insert(hull.end(), chain.begin(), chain.end() - 1);
  }
  return hull;
}

/// Its area, NDC^2.
double silhouette_area(const Scene& scene, double radius) {
  const std::vector<glm::dvec2> hull = silhouette(scene, radius);
  double area = 0;
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const glm::dvec2 a = hull[i], b = hull[(i + 1) % hull.size()];
    area += (a.x * b.y - a.y * b.x) / 2;
  }
  return area;
}

/// How far a convex polygon reaches from the origin, which lies in it, in a direction.
double reach_of(const std::vector<glm::dvec2>& polygon, const glm::dvec2& direction) {
  double reach = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const glm::dvec2 a = polygon[i], along = polygon[(i + 1) % polygon.size()] - a, out(along.y, -along.x);
    if (glm::dot(out, direction) > 0) reach = std::min(reach, glm::dot(out, a) / glm::dot(out, direction));
  }
  return reach;
}

/// The largest distance of two silhouettes, NDC.
double largest_gap(const Scene& one, const Scene& other) {
  constexpr int k_directions = 2000;
  const std::vector<glm::dvec2> a = silhouette(one, 1), b = silhouette(other, 1);
  double gap = 0;
  for (int i = 0; i < k_directions; ++i) {
    const double angle = glm::radians(360.0) * i / k_directions;
    const glm::dvec2 direction(std::cos(angle), std::sin(angle));
    gap = std::max(gap, std::abs(reach_of(a, direction) - reach_of(b, direction)));
  }
  return gap;
}

double pixel_area(const Scene& scene) { return 4.0 / (scene.width * scene.height); }

double alpha_area(const Scene& scene, const Image& image) {
  double sum = 0;
  for (const glm::vec4& pixel : image.pixels) sum += static_cast<double>(pixel.w);
  return sum * pixel_area(scene);
}

/// d area of alpha / d radius.
double area_by_radius(Renderer& renderer) {
  const Scene& scene = renderer.scene();
  Image grad(scene.width, scene.height);
  for (glm::vec4& pixel : grad.pixels) pixel.w = static_cast<float>(pixel_area(scene));
  const SceneGradient gradient = renderer.backward(std::span(&grad, 1));
  double sum = 0;
  for (std::size_t i = 0; i < gradient.meshes[0].positions.size(); ++i) {
    sum +=
        glm::dot(glm::dvec3(gradient.meshes[0].positions[i]), glm::dvec3(scene.meshes[0].mesh.positions[i]));
  }
  return sum;
}

/// Two faces of different colours that share an edge, and its vertices, or have six of their own; the corners
/// of each face are then turned by 0 to 2, nine ways in all.
Mesh folded_quad(std::optional<unsigned> turns) {
  Mesh mesh;
  mesh.positions = {{-0.7F, -0.6F, 0.1F}, {0.6F, -0.8F, 0.0F}, {0.8F, 0.5F, -0.3F}, {-0.5F, 0.7F, 0.2F}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  mesh.face_colors = {{0.9F, 0.2F, 0.1F}, {0.1F, 0.3F, 0.8F}};
  if (!turns) return mesh;
  std::vector<glm::vec3> corners;
  for (unsigned face = 0; face < 2; ++face) {
    const int turn = static_cast<int>(face == 0 ? *turns % 3 : *turns / 3);
    for (int corner = 0; corner < 3; ++corner)
      corners.push_back(mesh.positions[mesh.faces[face][(corner + turn) % 3]]);
  }
  mesh.positions = corners;
  mesh.faces = {{0, 1, 2}, {3, 4, 5}};
  return mesh;
}

struct Shown {
  Image image;
  glm::vec3 by_translation;  // of the image's pixels times the square of their columns
};

Shown show(const Device& device, const Mesh& mesh) {
  Scene scene = sphere_scene(0, reduced(48, 16), 0);
  scene.smoothing.sigma = sigma_of_pixels(1, scene.width);
  scene.meshes[0].mesh = mesh;
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  Image grad(scene.width, scene.height);
  for (std::size_t i = 0; i < grad.pixels.size(); ++i) {
    const auto column = static_cast<float>(i % static_cast<std::size_t>(scene.width));
    grad.pixels[i] = glm::vec4(column * column);
  }
  const SceneGradient gradient = renderer.backward(std::span(&grad, 1));
  glm::vec3 sum(0);
  for (const glm::vec3& p : gradient.meshes[0].positions) sum += p;
  return {renderer.image(), sum};
}

Scene cube_of_eight(int size) {
  Scene scene = scene_of(welded_cube(), size, size - 3);
  scene.smoothing = smoothing_preset("pixel");
  scene.smoothing.sigma = sigma_of_pixels(1.5, size);
  return scene;
}

/// Smooth random numbers: what a loss' gradient looks like where its target is an image.
Image smooth_image(int width, int height) {
  Image image(width, height);
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const float x = static_cast<float>(column) / static_cast<float>(width),
                  y = static_cast<float>(row) / static_cast<float>(height);
      image.pixels[static_cast<std::size_t>(row * width + column)] = {
          std::sin(5 * x + 3 * y), std::cos(4 * x - 6 * y), std::sin(7 * x * y + 1), std::cos(5 * y + 2 * x)};
    }
  }
  return image;
}

double loss_of(Renderer& renderer, const Image& grad) {
  renderer.forward();
  const Image image = renderer.image();
  double sum = 0;
  for (std::size_t i = 0; i < grad.pixels.size(); ++i) {
    sum += glm::dot(glm::dvec4(grad.pixels[i]), glm::dvec4(image.pixels[i]));
  }
  return sum;
}

/// The central difference of the loss by a number that `set` puts into the scene.
double difference(const Device& device, const Scene& scene, const Image& grad, double step,
                  const std::function<void(Scene&, double)>& set) {
  Renderer renderer(device);
  double sum = 0;
  for (const double sign : {1.0, -1.0}) {
    Scene moved = scene;
    set(moved, sign * step);
    renderer.set_scene(moved);
    sum += sign * loss_of(renderer, grad);
  }
  return sum / (2 * step);
}

glm::mat4 turned(const glm::mat4& m, int axis, double angle) {
  glm::dvec3 about(0);
  about[axis] = 1;
  glm::dmat4 turn = glm::rotate(glm::dmat4(1), angle, about) * glm::dmat4(glm::dmat3(glm::dmat4(m)));
  turn[3] = glm::dmat4(m)[3];
  return glm::mat4(turn);
}

glm::mat4 moved(glm::mat4 m, int axis, double by) {
  m[3][axis] += static_cast<float>(by);
  return m;
}

/// Differences for every block of blocks_of(), by name; empty for what has none. Where lengths and angles
/// change by more than `length_step`, edges pass samples whose neighbours have other colours, and the image
/// jumps a little.
std::vector<double> differences(const Device& device, const Scene& scene, const Image& grad,
                                const std::string& name, double length_step) {
  std::vector<double> found;
  const auto add = [&](double step, const std::function<void(Scene&, double)>& set) {
    found.push_back(difference(device, scene, grad, step, set));
  };
  constexpr double k_degrees = 20;  // of the field of view, for a step of 1
  const auto relative = [&](float value) { return 1e-2 * static_cast<double>(value); };
  const Mesh& mesh = scene.meshes[0].mesh;
  const std::size_t colors = mesh.vertex_colors.empty() ? mesh.face_colors.size() : mesh.vertex_colors.size();
  for (int axis = 0; axis < 3; ++axis) {
    if (name == "rotation")
      add(length_step,
          [=](Scene& m, double x) { m.meshes[0].transform = turned(m.meshes[0].transform, axis, x); });
    if (name == "translation")
      add(length_step,
          [=](Scene& m, double x) { m.meshes[0].transform = moved(m.meshes[0].transform, axis, x); });
    if (name == "camera rotation")
      add(length_step, [=](Scene& m, double x) { m.camera.view = turned(m.camera.view, axis, x); });
    if (name == "camera translation")
      add(length_step, [=](Scene& m, double x) { m.camera.view = moved(m.camera.view, axis, x); });
    if (name == "background")
      add(0.1, [=](Scene& m, double x) { m.background[axis] += static_cast<float>(x); });
    if (name == "ambient" && scene.lights)
      add(0.1, [=](Scene& m, double x) { m.lights->ambient[axis] += static_cast<float>(x); });
  }
  if (name == "fov")
    add(k_degrees * length_step, [](Scene& m, double x) { m.camera.fov_y_degrees += static_cast<float>(x); });
  if (name == "sigma")
    add(relative(scene.smoothing.sigma),
        [](Scene& m, double x) { m.smoothing.sigma += static_cast<float>(x); });
  if (name == "gamma")
    add(relative(scene.smoothing.gamma),
        [](Scene& m, double x) { m.smoothing.gamma += static_cast<float>(x); });
  for (std::size_t i = 0; name == "positions" && i < mesh.positions.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      add(length_step,
          [=](Scene& m, double x) { m.meshes[0].mesh.positions[i][axis] += static_cast<float>(x); });
    }
  }
  for (std::size_t i = 0; name == "colors" && i < colors; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      add(0.1, [=](Scene& m, double x) {
        Mesh& its = m.meshes[0].mesh;
        (its.vertex_colors.empty() ? its.face_colors : its.vertex_colors)[i][axis] += static_cast<float>(x);
      });
    }
  }
  return found;
}

void check_gradients(const Device& device, const Scene& scene, double length_step, double tolerance) {
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  const Image grad = smooth_image(scene.width, scene.height);
  for (Block block : blocks_of(renderer.backward(std::span(&grad, 1)))) {
    CAPTURE(block.name);
    block.expected = differences(device, scene, grad, block.name, length_step);
    if (block.expected.empty()) continue;
    CHECK((norm(block.expected) > 0 || block.name == "gamma"));
    const double error = block_error(block, tolerance);
    CHECK_MESSAGE(error < (is_sensitivity(block.name) ? 10 : 1) * tolerance, block.name << ": " << error);
  }
}

/// Relative to the largest of the same key.
void check_light_gradients(const Device& device, const Scene& scene, double tolerance) {
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  const Image grad = smooth_image(scene.width, scene.height);
  const std::vector<double> found = light_numbers(renderer.backward(std::span(&grad, 1)));
  std::map<std::string, Block> by_key;
  std::size_t i = 0;
  Lights lights = *scene.lights;
  for_each_light_number(lights, [&](std::string_view key, float) {
    const double step = key.ends_with("degrees") ? 0.2 : 1e-2;
    const auto move = [i](Scene& m, double by) {
      std::size_t at = 0;
      for_each_light_number(*m.lights, [&](std::string_view, float& number) {
        if (at++ == i) number += static_cast<float>(by);
      });
    };
    Block& block = by_key[std::string(key)];
    block.found.push_back(found.at(i++));
    block.expected.push_back(difference(device, scene, grad, step, move));
  });
  CHECK(i == found.size());
  for (const auto& [key, block] : by_key) {
    CAPTURE(key);
    CHECK(norm(block.expected) > 1e-3);
    CHECK(block_error(block, tolerance) < tolerance);
    Block wrong = block;
    for (double& value : wrong.found) value *= 1 + 2 * tolerance;
    CHECK_FALSE(block_error(wrong, tolerance) < tolerance);
  }
}

/// A slanted square, whose lower edge crosses row 44; `height` says where the frame ends.
Scene cut_off_scene(int height, double blur_pixels) {
  Scene scene;
  scene.width = 60;
  scene.height = height;
  scene.camera.view = glm::translate(glm::mat4(1.0F), glm::vec3(0.0F, 0.0F, -4.0F));
  scene.camera.intrinsics = Intrinsics{60.0F, 60.0F, 30.3F, 30.4F};
  Mesh mesh;
  mesh.positions = {{-1.1F, -0.9F, 0}, {1, -1, 0}, {0.6F, 1.1F, 0}, {-0.7F, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  scene.meshes.push_back({mesh});
  scene.smoothing = smoothing_preset("pixel");
  scene.smoothing.sigma = sigma_of_pixels(blur_pixels, height);
  return scene;
}

/// A mesh in the light of its camera: towards its silhouette, where it is dark, it changes ever faster.
Scene falling_off_scene(const Mesh& mesh, const glm::vec3& camera, int supersampling) {
  Scene scene = sphere_scene(0, 64, sigma_of_pixels(1, 64));
  scene.camera.view = glm::translate(glm::mat4(1.0F), -camera);
  scene.meshes[0].mesh = mesh;
  scene.meshes[0].mesh.vertex_colors.clear();
  Lights lights;
  lights.point.clear();
  lights.ambient = glm::vec3(0.0F);
  lights.directional.push_back({{-0.2F, -0.3F, -1.0F}, glm::vec3(1.0F), glm::vec3(0.0F)});
  scene.lights = lights;
  scene.smoothing.supersampling = supersampling;
  return scene;
}

/// A derivative of the image that differs from pixel to pixel.
Image varying_weights(int size) {
  Image weights(size, size);
  for (int row = 0; row < size; ++row) {
    for (int column = 0; column < size; ++column) {
      const float x = (static_cast<float>(column) + 0.5F) / static_cast<float>(size),
                  y = (static_cast<float>(row) + 0.5F) / static_cast<float>(size);
      weights.at(column, row) = {std::sin(6 * x), std::cos(5 * y), std::sin(4 * x + 3 * y), 0.0F};
    }
  }
  return weights;
}

double weighted_sum(const Image& image, const Image& weights) {
  double sum = 0;
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    sum += static_cast<double>(glm::dot(image.pixels[i], weights.pixels[i]));
  return sum;
}

/// By fourth-order differences over a pixel or so, of finer images.
glm::dvec3 by_camera(Renderer& renderer, const Mesh& mesh, const glm::vec3& camera, const Image& weights) {
  constexpr float k_step = 0.03F;
  glm::dvec3 derivative;
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = [&](float steps) {
      glm::vec3 moved = camera;
      moved[axis] += steps * k_step;
      renderer.set_scene(falling_off_scene(mesh, moved, 4));
      renderer.forward();
      return weighted_sum(renderer.image(), weights);
    };
    derivative[axis] = (at(-2) - 8 * at(-1) + 8 * at(1) - at(2)) / (12 * static_cast<double>(k_step));
  }
  return derivative;
}

/// A torus of 280 faces of their own colours, turned at random.
Scene faceted_scene(int size, check::Random& random) {
  Scene scene = sphere_scene(0, size, sigma_of_pixels(1, size));
  Mesh& mesh = scene.meshes[0].mesh;
  mesh = make_torus(0.8F, 0.35F, 20, 7);
  mesh.vertex_colors.clear();
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) mesh.face_colors.push_back(random.vector(0, 1));
  scene.meshes[0].transform = check::placed(random(0, 360), 1.0F, random.vector(-0.05F, 0.05F));
  return scene;
}

/// How far the mean gradient over a motion of a pixel is from the change of the image, relative to the larger
/// of that and the mean size of the gradient.
double error_of_motion(Renderer& renderer, Scene scene, const glm::vec3& way, const Image& weights) {
  constexpr int k_parts = 16;
  const glm::vec4 start = scene.meshes[0].transform[3];
  const auto render = [&](float part) {
    scene.meshes[0].transform[3] = start + glm::vec4(part * way, 0.0F);
    renderer.set_scene(scene);
    renderer.forward();
  };
  double sum = 0, size = 0;
  for (int i = 0; i < k_parts; ++i) {
    render((static_cast<float>(i) + 0.5F) / k_parts);
    const glm::dvec3 gradient = renderer.backward(std::span(&weights, 1)).views[0].transforms[0].translation;
    const double slope = glm::dot(gradient, glm::dvec3(way)) / k_parts;
    sum += slope;
    size += std::abs(slope);
  }
  render(1);
  double change = weighted_sum(renderer.image(), weights);
  render(0);
  change -= weighted_sum(renderer.image(), weights);
  return std::abs(change - sum) / std::max(std::abs(change), size);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("pixel noise: gradients of faces of their own colours are right in the mean") {
    if (test::is_reduced()) return;
    constexpr std::size_t k_paths = 24;
    Renderer renderer(open_device());
    const std::pair<int, double> sizes[] = {{32, 0.2}, {64, 5e-2}, {128, 3e-2}};
    for (const auto& [size, tolerance] : sizes) {
      const Image weights = varying_weights(size);
      check::Random random(11);
      std::vector<double> errors;
      for (std::size_t i = 0; i < k_paths; ++i) {
        const Scene scene = faceted_scene(size, random);
        const glm::vec3 way = glm::normalize(random.vector(-1, 1)) * (3.15F / static_cast<float>(size));
        errors.push_back(error_of_motion(renderer, scene, way, weights));
      }
      std::ranges::sort(errors);
      MESSAGE(size << "x" << size << ": off by a median of " << 100 * errors[k_paths / 2] << "%");
      CHECK(errors[k_paths / 2] < tolerance);
    }
  }

  TEST_CASE("pixel noise: gradients are right in the mean where colours fall off towards silhouettes") {
    if (test::is_reduced()) return;
    const Image weights = varying_weights(64);
    Renderer renderer(open_device());
    // The torus hides parts of itself: where its contours end, they cross steps that no fading reaches.
    const std::pair<Mesh, double> meshes[] = {{make_icosphere(4), 4e-3},
                                              {make_torus(0.8F, 0.35F, 96, 48), 4e-2}};
    for (const auto& [mesh, tolerance] : meshes) {
      glm::dvec3 error(0.0), size(0.0);
      for (int i = 0; i < 4; ++i) {  // places within a pixel
        const auto along = static_cast<float>(i);
        const glm::vec3 camera(0.049F * glm::fract(0.755F * along), 0.049F * glm::fract(0.57F * along),
                               2.732F);
        renderer.set_scene(falling_off_scene(mesh, camera, 1));
        renderer.forward();
        const SceneGradient gradient = renderer.backward(std::span(&weights, 1));
        const glm::dvec3 expected = by_camera(renderer, mesh, camera, weights);
        // The camera's translation moves the scene the other way.
        error += -gradient.views[0].camera.view.translation - expected;
        size += expected;
      }
      MESSAGE("off by " << 100 * glm::length(error) / glm::length(size) << "%");
      CHECK(glm::length(error) < tolerance * glm::length(size));
    }
  }

  TEST_CASE("the frame's last row is what it is in a larger frame") {
    for (const double blur_pixels : {0.05, 0.3, 1.0}) {
      CAPTURE(blur_pixels);
      Renderer small(open_device()), large(open_device());
      small.set_scene(cut_off_scene(45, blur_pixels));
      large.set_scene(cut_off_scene(60, blur_pixels));
      small.forward();
      large.forward();
      const Image found = small.image(), expected = large.image();
      dpr::test::Worst worst;
      for (int x = 0; x < 60; ++x)
        worst.add(std::abs(static_cast<double>(found.at(x, 44).w - expected.at(x, 44).w)), "column", x);
      DPR_CHECK_WORST(worst, 1e-4);
    }
  }

  TEST_CASE("pixel noise: areas are the polyhedron's, and their derivatives, whatever triangles and sigma") {
    const Device device = open_device();
    const int size = reduced(128, 16);
    for (const unsigned subdivisions : {2U, 3U, 4U, 5U}) {
      if (test::is_reduced() && subdivisions > 2) continue;
      for (const float sigma : {1e-5F, 1e-4F, 1e-3F}) {
        const Scene scene = sphere_scene(subdivisions, size, sigma);
        CAPTURE(subdivisions);
        CAPTURE(sigma);
        Renderer renderer(device);
        renderer.set_scene(scene);
        renderer.forward();
        const double wanted = silhouette_area(scene, 1);
        CHECK(alpha_area(scene, renderer.image()) == doctest::Approx(wanted).epsilon(reduced(3, 20) * 1e-3));
        constexpr double k_step = 1e-3;
        const double by_radius =
            (silhouette_area(scene, 1 + k_step) - silhouette_area(scene, 1 - k_step)) / (2 * k_step);
        const double found = area_by_radius(renderer);
        CAPTURE(found / by_radius);
        CHECK(found == doctest::Approx(by_radius).epsilon(reduced(1, 5) * 1e-2));
      }
    }
  }

  TEST_CASE("pixel noise: opaque inside") {
    const Scene scene = sphere_scene(reduced(4, 1), reduced(128, 16), reduced(1, 0) == 1 ? 1e-3F : 1e-4F);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const Image image = renderer.image();
    float least = 1, most = 0;
    for (int row = 0; row < scene.height; ++row) {
      for (int column = 0; column < scene.width; ++column) {
        const float alpha = image.pixels[static_cast<std::size_t>(row * scene.width + column)].w;
        most = std::max(most, alpha);
        const double x = (column + 0.5) * 2 / scene.width - 1, y = (row + 0.5) * 2 / scene.height - 1;
        if (std::hypot(x, y) < 0.4) least = std::min(least, alpha);
      }
    }
    CHECK(least > 1 - 1e-5F);
    CHECK(most < 1 + 1e-5F);
  }

  TEST_CASE("pixel noise: few triangles and many differ by what their silhouettes do") {
    if (test::is_reduced()) return;
    for (const int size : {128, 256}) {
      for (const double pixels : {1.0, 3.0}) {
        std::vector<Image> images;
        std::vector<Scene> scenes;
        for (const unsigned subdivisions : {4U, 6U}) {
          scenes.push_back(sphere_scene(subdivisions, size, sigma_of_pixels(pixels, size)));
          Renderer renderer(open_device());
          renderer.set_scene(scenes.back());
          renderer.forward();
          images.push_back(renderer.image());
        }
        float largest = 0;
        for (std::size_t i = 0; i < images[0].pixels.size(); ++i) {
          const glm::vec4 apart = glm::abs(images[0].pixels[i] - images[1].pixels[i]);
          largest = std::max({largest, apart.x, apart.y, apart.z, apart.w});
        }
        // An edge that moves changes a pixel by the density of its noise and its area.
        const double gap = largest_gap(scenes[0], scenes[1]) * size / 2;
        const double density = 1 / std::sqrt(glm::radians(360.0) * (pixels * pixels + 1.0 / 12));
        CAPTURE(size);
        CAPTURE(pixels);
        CAPTURE(gap);
        CHECK(static_cast<double>(largest) < density * gap + 5e-3);
      }
    }
  }

  TEST_CASE(
      "pixel noise: vertices that only coincide are as good as shared ones, whatever the order of corners") {
    const Device device = open_device();
    const Shown shared = show(device, folded_quad(std::nullopt));
    for (unsigned turns = 0; turns < 9; ++turns) {
      CAPTURE(turns);
      const Shown split = show(device, folded_quad(turns));
      float largest = 0;
      for (std::size_t i = 0; i < shared.image.pixels.size(); ++i) {
        const glm::vec4 apart = glm::abs(shared.image.pixels[i] - split.image.pixels[i]);
        largest = std::max({largest, apart.x, apart.y, apart.z, apart.w});
      }
      CHECK(largest < 1e-6F);
      CHECK(glm::length(split.by_translation - shared.by_translation) <
            1e-4F * glm::length(shared.by_translation));
    }
  }

  TEST_CASE("pixel noise: the same bits again, in another renderer, in bands") {
    Device device = open_device();
    Scene scene = cube_of_eight(reduced(45, 14));
    scene.lights = two_lights(Shading::phong);
    scene.gradients.lights = true;
    scene.smoothing.gamma = 1e-2F;
    Renderer renderer(device);
    renderer.set_scene(scene);
    const Result first = render(renderer);
    CHECK(norm(flat(first.gradient.meshes[0].positions)) > 0);
    CHECK(same_bits(first, render(renderer)));
    CHECK(same_bits(first, render(open_device(), scene)));

    Device small = open_device();
    small.set_memory_budget(static_cast<std::size_t>(reduced(131072, 11500)));
    Renderer banded(small);
    banded.set_scene(scene);
    CHECK(same_bits(first, render(banded)));
    CHECK(banded.statistics().bands > 1);
  }

  TEST_CASE("pixel noise: auxiliary outputs are the pixels'") {
    for (const std::uint32_t supersampling : {1U, 2U}) {
      const int size = reduced(41, 21);
      Scene scene = sphere_scene(reduced(4, 1), size, sigma_of_pixels(1, size));
      scene.smoothing.supersampling = supersampling;
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      const Result before = render(renderer);
      const AuxiliaryOutputs outputs = auxiliary_outputs(renderer);
      const auto pixels = static_cast<std::size_t>(size * size), middle = pixels / 2;
      REQUIRE(outputs.depth.size() == pixels);
      REQUIRE(outputs.face_id.size() == pixels);
      CHECK(outputs.depth[middle] == doctest::Approx(1.732).epsilon(reduced(1, 10) * 1e-2));
      CHECK(outputs.normal[middle].z > 0.9F);
      CHECK(outputs.face_id[middle] >= 0);
      CHECK(outputs.effective_faces[middle] == doctest::Approx(1).epsilon(1e-3));
      CHECK(outputs.depth[0] == 0);
      CHECK(outputs.face_id[0] == -1);
      // They leave what the backward pass needs.
      const Image grad = random_image(size, size, -1.0F, 1.0F);
      CHECK(same_bits(before.gradient, renderer.backward(std::span(&grad, 1))));
    }
  }

  TEST_CASE("pixel noise: views with shapes of their own, and what set_positions() moves") {
    Scene scene = cube_of_eight(reduced(33, 12));
    scene.smoothing.gamma = 1e-2F;  // so that back faces count: of shapes of views' own none is left out
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const std::vector<View> views(2, {scene.camera, {scene.meshes[0].transform}});
    std::vector<glm::vec3> shapes = scene.meshes[0].mesh.positions;
    for (const glm::vec3& p : scene.meshes[0].mesh.positions) shapes.push_back(0.7F * p);
    renderer.set_views(views);
    renderer.set_shapes(shapes, {});
    renderer.forward();
    const Image grad = smooth_image(scene.width, scene.height);
    const SceneGradient both = renderer.backward(std::vector<Image>{grad, grad});
    for (std::size_t v = 0; v < 2; ++v) {
      Renderer alone(open_device());
      alone.set_scene(scene);
      alone.forward();
      alone.set_positions(0, std::span(shapes).subspan(v * 8, 8));
      alone.forward();
      CHECK(same_bits(renderer.image(v), alone.image()));
      const std::vector<double> wanted = flat(alone.backward(std::span(&grad, 1)).meshes[0].positions);
      std::vector<double> found = flat(both.shapes.positions);
      found = {found.begin() + static_cast<std::ptrdiff_t>(24 * v),
               found.begin() + static_cast<std::ptrdiff_t>(24 * (v + 1))};
      CHECK(same_bits(found, wanted));
    }
  }

  TEST_CASE("pixel noise: every prior, every supersampling, and back to triangles") {
    const Device device = open_device();
    Scene scene = cube_of_eight(reduced(33, 12));
    Renderer renderer(device);
    renderer.set_scene(scene);
    const Result first = render(renderer);
    const double area = alpha_area(scene, first.image);
    for (const Prior prior : {Prior::gaussian, Prior::cauchy, Prior::logistic, Prior::uniform}) {
      for (const std::uint32_t supersampling : {1U, 2U, 4U}) {
        Smoothing smoothing = scene.smoothing;
        smoothing.occupancy_prior = prior;
        smoothing.sigma *= 0.1F;  // so that little leaves the frame
        smoothing.supersampling = supersampling;
        renderer.set_smoothing(smoothing);
        renderer.forward();
        CAPTURE(to_string(prior));
        CAPTURE(supersampling);
        CHECK(alpha_area(scene, renderer.image()) == doctest::Approx(area).epsilon(reduced(1, 10) * 1e-2));
      }
    }
    Scene triangles = scene;
    triangles.smoothing = smoothing_preset("gaussian");
    renderer.set_smoothing(triangles.smoothing);
    CHECK(same_bits(render(renderer), render(device, triangles)));
    renderer.set_smoothing(scene.smoothing);
    CHECK(same_bits(render(renderer), first));
  }

  TEST_CASE("pixel noise: a raster that cannot be counted is refused, and what was set stays") {
    Scene scene = cube_of_eight(reduced(33, 12));
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    const Result first = render(renderer);
    Smoothing wide = scene.smoothing;
    wide.sigma = 1e6F;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_smoothing(wide),
                          "sigma and supersampling (smoothing): got a raster of");
    CHECK(same_bits(render(renderer), first));
  }
}

// Hundreds of frames: the simulator sees the kernels in the cases above.
TEST_SUITE("gradient") {
  TEST_CASE("pixel noise: every gradient of flat colours against differences of the image") {
    if (test::is_reduced()) return;
    Scene scene = cube_of_eight(96);
    scene.smoothing.gamma = 1e-8F;
    check_gradients(open_device(), scene, 3e-4, 1e-3);
  }

  TEST_CASE("pixel noise: every gradient where depths mix and lights shine") {
    if (test::is_reduced()) return;
    for (const Composition composition : {Composition::joint, Composition::barrier}) {
      Scene scene = cube_of_eight(96);
      scene.smoothing.composition = composition;
      scene.smoothing.gamma = 3e-2F;
      scene.smoothing.background_depth = 0.6F;
      scene.lights = two_lights(Shading::phong);
      scene.gradients.lights = true;
      check_gradients(open_device(), scene, 5e-5, 5e-3);
    }
  }

  TEST_CASE("pixel noise: every number of every kind of light, and shapes in their light") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    for (const Shading shading : {Shading::phong, Shading::blinn, Shading::microfacet}) {
      CAPTURE(static_cast<int>(shading));
      Scene scene = cube_of_eight(96);
      scene.smoothing.gamma = 1e-8F;
      scene.lights = every_light(shading);
      // Edge-on, reflection begins steeply at n.l = 0. Differences step over that, above all on the cube, whose
      // corners' normals turn away within sight.
      const bool is_steep = shading == Shading::microfacet;
      if (is_steep) scene.meshes[0].mesh = make_icosphere(2);
      scene.meshes[0].mesh.materials = materials_for(shading);
      scene.gradients.lights = true;
      check_light_gradients(device, scene, is_steep ? 4e-3 : 2e-3);
      check_gradients(device, scene, 5e-5, 5e-3);
    }
  }
}

}  // namespace pixel_noise_test
