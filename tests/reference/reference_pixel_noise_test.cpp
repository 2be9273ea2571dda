/// The reference for noise on the pixel against closed forms: a half-plane, areas and their derivatives;
/// against a dense sum; and where it must not depend on the tessellation.
#include "reference/pixel_noise.hpp"
#include "test_support.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

namespace reference_pixel_noise_test {

using namespace dpr::reference;

namespace {

/// Scene of an image that is not higher than wide, in which NDC is (x, y) at depth 1.
Scene flat_scene(int width, int height) {
  Scene scene;
  scene.width = width;
  scene.height = height;
  scene.camera.fov_y_degrees = 90.0;
  scene.camera.znear = 0.1;
  scene.camera.zfar = 10.0;
  scene.smoothing.composition = Composition::joint;
  scene.smoothing.gamma = 0.0;
  scene.background = {0.1, 0.2, 0.3};
  return scene;
}

void set_scale(Scene& scene, double pixels) {
  const double ndc = 2.0 * pixels / std::min(scene.width, scene.height);
  scene.smoothing.sigma = ndc * ndc;
}

Mesh polygon(const std::vector<Vec2d>& corners, double depth, const Vec3d& color) {
  Mesh mesh;
  for (const Vec2d& p : corners) mesh.positions.push_back({depth * p.x, depth * p.y, -depth});
  for (std::size_t i = 2; i < corners.size(); ++i) mesh.faces.push_back({0, i - 1, i});
  mesh.face_colors.assign(mesh.faces.size(), color);
  return mesh;
}

std::vector<Vec2d> disc(double radius, std::size_t corners, const Vec2d& center = {}) {
  std::vector<Vec2d> result;
  for (std::size_t i = 0; i < corners; ++i) {
    const double angle =
        2.0 * std::numbers::pi * (static_cast<double>(i) + 0.3) / static_cast<double>(corners);
    result.push_back(center + radius * Vec2d{std::cos(angle), std::sin(angle)});
  }
  return result;
}

double polygon_area(const std::vector<Vec2d>& corners) {
  double area = 0.0;
  for (std::size_t i = 0; i < corners.size(); ++i)
    area += 0.5 * cross(corners[i], corners[(i + 1) % corners.size()]);
  return area;
}

/// Sum of alpha times a pixel's area, NDC^2.
double image_area(const Scene& scene) {
  const Image image = render_pixel_noise(scene);
  double sum = 0.0;
  for (std::size_t i = 3; i < image.rgba.size(); i += 4) sum += image.rgba[i];
  const double pixel = 2.0 / std::min(scene.width, scene.height);
  return sum * pixel * pixel;
}

double largest_difference(const Image& a, const Image& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.rgba.size(); ++i)
    largest = std::max(largest, std::fabs(a.rgba[i] - b.rgba[i]));
  return largest;
}

/// The second antiderivative of the Gaussian density of this scale.
double twice_integrated(double x, double scale) {
  const double u = x / scale;
  return scale * (u * cdf(Prior::gaussian, u) + density(Prior::gaussian, u));
}

/// A third one: twice_integrated is the integral of the CDF; this is the integral of that.
double thrice_integrated(double x, double scale) {
  const double u = x / scale;
  return 0.5 * scale * scale * ((u * u + 1.0) * cdf(Prior::gaussian, u) + u * density(Prior::gaussian, u));
}

/// Alpha of a half-plane, d inside at the pixel's centre, whose edge has the unit normal n: the Gaussian's
/// CDF averaged over the pixel, which along n is a trapezoid.
double half_plane(double d, const Vec2d& n, double scale, double pixel) {
  const double a = 0.5 * pixel * std::fabs(n.x), b = 0.5 * pixel * std::fabs(n.y);
  if (b < 1e-9) return (twice_integrated(d + a, scale) - twice_integrated(d - a, scale)) / (2.0 * a);
  return (thrice_integrated(d + a + b, scale) - thrice_integrated(d + a - b, scale) -
          thrice_integrated(d - a + b, scale) + thrice_integrated(d - a - b, scale)) /
         (4.0 * a * b);
}

/// A square so large that only the edge through offset * n is in reach.
Mesh half_plane_mesh(const Vec2d& n, double offset) {
  const Vec2d t = {-n.y, n.x};
  return polygon({offset * n + 20.0 * t, offset * n + (-20.0) * t, offset * n + (-20.0) * t + 20.0 * n,
                  offset * n + 20.0 * t + 20.0 * n},
                 1.0, {0.9, 0.5, 0.4});
}

/// A triangle of several colours before a square behind it.
Scene overlapping() {
  Scene scene = flat_scene(6, 5);
  set_scale(scene, 1.3);
  Mesh triangle = polygon({{-0.5, -0.61}, {0.63, -0.2}, {-0.1, 0.72}}, 1.5, {});
  triangle.face_colors.clear();
  triangle.vertex_colors = {{1.0, 0.0, 0.2}, {0.0, 0.9, 0.1}, {0.2, 0.3, 1.0}};
  triangle.positions[1] = 1.3 * triangle.positions[1];
  scene.meshes = {polygon({{-0.8, -0.35}, {0.41, -0.45}, {0.52, 0.4}, {-0.7, 0.55}}, 2.5, {0.7, 0.7, 0.1}),
                  triangle};
  return scene;
}

/// Colour of the nearest triangle at a point, and whether there is one.
std::pair<Vec3d, bool> nearest_color(const Scene& scene, const PreparedScene& prepared, const Vec2d& point) {
  double nearest = std::numeric_limits<double>::infinity();
  Vec3d color = scene.background;
  for (std::size_t face = 0; face < prepared.shade.faces.size(); ++face) {
    const auto fragment = rasterize_forward(ndc_triangle(prepared, face), face, point, prepared.rasterize);
    if (!fragment || fragment->depth >= nearest) continue;
    nearest = fragment->depth;
    color = shade_forward(prepared.shade, face, fragment->barycentric, corner_colors(scene, prepared, face));
  }
  return {color, std::isfinite(nearest)};
}

/// Points at the centres of `factor` x `factor` cells of every pixel, of `reach` pixels more on each side.
Image dense_sum(Scene scene, int factor, int reach) {
  scene.smoothing.blur_radius = 0.0;
  const PreparedScene prepared = prepare(scene);
  const ImageSize size{scene.width, scene.height};
  const double pixel = 2.0 / short_side(size), scale = pixel_noise_scale(scene.smoothing);
  const double cell = pixel / factor;
  const Vec2d first =
      pixel_center(0, 0, size) + (reach + 0.5) * Vec2d{-pixel, pixel} + 0.5 * Vec2d{cell, -cell};
  Image sum = make_image(size.width, size.height);
  for (int j = 0; j < (size.height + 2 * reach) * factor; ++j) {
    for (int i = 0; i < (size.width + 2 * reach) * factor; ++i) {
      const Vec2d point = first + cell * Vec2d{static_cast<double>(i), -static_cast<double>(j)};
      const auto [color, is_covered] = nearest_color(scene, prepared, point);
      for (int row = 0; row < size.height; ++row) {
        for (int column = 0; column < size.width; ++column) {
          const Vec2d away = point - pixel_center(column, row, size);
          const double share = cell * cell * pixel_density(Prior::gaussian, scale, pixel, away.x) *
                               pixel_density(Prior::gaussian, scale, pixel, away.y);
          double* rgba = &sum.rgba[4 * static_cast<std::size_t>(row * size.width + column)];
          for (std::size_t k = 0; k < 3; ++k) rgba[k] += share * color[k];
          rgba[3] += is_covered ? share : 0.0;
        }
      }
    }
  }
  return sum;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("a half-plane, whatever the direction of its edge") {
    for (const double scale : {0.3, 1.0, 2.5}) {
      for (const double angle : {0.0, 0.3, 0.7854, 1.4, 2.2, 4.0}) {
        Scene scene = flat_scene(5, 4);
        set_scale(scene, scale);
        const Vec2d n = {std::cos(angle), std::sin(angle)};
        scene.meshes = {half_plane_mesh(n, 0.13)};
        const Image image = render_pixel_noise(scene);
        for (int row = 0; row < scene.height; ++row) {
          for (int column = 0; column < scene.width; ++column) {
            const double d = dot(pixel_center(column, row, {5, 4}), n) - 0.13;
            const double alpha = half_plane(d, n, 0.5 * scale, 0.5);
            const double* rgba = &image.rgba[4 * static_cast<std::size_t>(row * scene.width + column)];
            CAPTURE(scale);
            CAPTURE(angle);
            CHECK(std::fabs(rgba[3] - alpha) < 1e-6);
            CHECK(std::fabs(rgba[0] - (0.1 + alpha * 0.8)) < 1e-6);
          }
        }
      }
    }
  }

  TEST_CASE("a half-plane of another scale is found out") {
    Scene scene = flat_scene(5, 4);
    set_scale(scene, 1.01);
    scene.meshes = {half_plane_mesh({1.0, 0.0}, 0.13)};
    const double d = pixel_center(2, 0, {5, 4}).x - 0.13;
    CHECK(std::fabs(render_pixel_noise(scene).rgba[11] - half_plane(d, {1.0, 0.0}, 0.5, 0.5)) > 1e-4);
  }

  TEST_CASE("a disc keeps its area under every prior, and its derivative by the radius") {
    for (const Prior prior : {Prior::gaussian, Prior::logistic, Prior::uniform}) {
      for (const double scale : {0.5, 1.2}) {
        Scene scene = flat_scene(46, 44);
        scene.smoothing.occupancy_prior = prior;
        set_scale(scene, prior == Prior::logistic ? 0.5 * scale : scale);
        const auto area = [&](double radius) {
          scene.meshes = {polygon(disc(radius, 9, {0.02, -0.01}), 1.0, {1.0, 1.0, 1.0})};
          return image_area(scene);
        };
        const double exact = polygon_area(disc(0.3, 9));
        CHECK(area(0.3) == doctest::Approx(exact).epsilon(1e-7));
        CHECK((area(0.301) - area(0.299)) / 2e-3 == doctest::Approx(2.0 * exact / 0.3).epsilon(1e-6));
      }
    }
  }

  TEST_CASE("how a surface is cut into triangles does not show") {
    Scene scene = flat_scene(7, 6);
    set_scale(scene, 0.8);
    const std::vector<Vec2d> corners = disc(0.6, 7);
    scene.meshes = {polygon(corners, 1.0, {0.3, 0.8, 0.5})};
    const Image coarse = render_pixel_noise(scene);
    Mesh fan;
    fan.positions = {{0.11, -0.07, -1.0}};
    for (const Vec2d& p : corners) fan.positions.push_back({p.x, p.y, -1.0});
    for (std::size_t i = 0; i < corners.size(); ++i)
      fan.faces.push_back({0, i + 1, (i + 1) % corners.size() + 1});
    fan.face_colors.assign(fan.faces.size(), {0.3, 0.8, 0.5});
    scene.meshes = {fan};
    CHECK(largest_difference(render_pixel_noise(scene), coarse) < 1e-10);
  }

  TEST_CASE("overlapping triangles against a dense sum over the image plane") {
    const Scene scene = overlapping();
    const Image found = render_pixel_noise(scene);
    CHECK(largest_difference(found, dense_sum(scene, 30, 6)) < 4e-4);
    Scene wider = scene;
    wider.smoothing.sigma *= 1.02;
    CHECK(largest_difference(found, dense_sum(wider, 30, 6)) > 1e-3);
  }

  TEST_CASE("noise of the depths mixes what covers the same point") {
    Scene scene = flat_scene(3, 3);
    set_scale(scene, 0.5);
    const std::vector<Vec2d> all = {{-9.0, -9.0}, {9.0, -9.0}, {9.0, 9.0}, {-9.0, 9.0}};
    scene.meshes = {polygon(all, 2.0, {1.0, 0.0, 0.0}), polygon(all, 3.0, {0.0, 1.0, 0.0})};
    scene.smoothing.gamma = 0.05;
    const double z = (1.0 / (10.0 - 0.1)) / (0.05 * std::numbers::sqrt2);
    const Image image = render_pixel_noise(scene);
    CHECK(image.rgba[0] == doctest::Approx(cdf(Prior::gaussian, z)).epsilon(1e-8));
    CHECK(image.rgba[1] == doctest::Approx(1.0 - cdf(Prior::gaussian, z)).epsilon(1e-8));
    CHECK(image.rgba[3] == doctest::Approx(1.0).epsilon(1e-9));
    scene.smoothing.gamma = 0.0;
    CHECK(render_pixel_noise(scene).rgba[0] == doctest::Approx(1.0).epsilon(1e-9));
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("moving the edge of a half-plane") {
    Scene scene = flat_scene(5, 4);
    set_scale(scene, 1.0);
    const Vec2d n = {std::cos(0.4), std::sin(0.4)};
    Image weights = make_image(5, 4);
    weights.rgba[4 * 7 + 3] = 1.0;  // alpha of the pixel (2, 1)
    const auto value = [&](const std::vector<double>& at) {
      scene.meshes = {half_plane_mesh(n, at[0])};
      return pixel_noise_objective(scene, weights);
    };
    const double d = dot(pixel_center(2, 1, {5, 4}), n) - 0.13, step = 1e-4;
    const double exact =
        (half_plane(d - step, n, 0.5, 0.5) - half_plane(d + step, n, 0.5, 0.5)) / (2.0 * step);
    CHECK_GRADIENT(value, {0.13}, {exact}, 1e-3, 1e-5);
    CHECK_FALSE(check_gradient(value, {0.13}, {1.01 * exact}, 1e-3, 1e-5).passed);
  }

  TEST_CASE("differences of two steps agree: the image is smooth in every parameter") {
    const Scene scene = overlapping();
    Image weights = make_image(scene.width, scene.height);
    for (std::size_t i = 0; i < weights.rgba.size(); ++i)
      weights.rgba[i] = std::sin(1.7 * static_cast<double>(i));
    const auto derivative = [&](const std::function<void(Scene&, double)>& move, double step) {
      Scene above = scene, below = scene;
      move(above, step);
      move(below, -step);
      return (pixel_noise_objective(above, weights) - pixel_noise_objective(below, weights)) / (2.0 * step);
    };
    for (const std::function<void(Scene&, double)>&move : {
             std::function<void(Scene&, double)>([](Scene&s, double d) { s.meshes[1].positions[0].x += d; }),
             std::function<void(Scene&, double)>([](Scene&s, double d) { s.meshes[1].positions[2].z += d; }),
             std::function<void(Scene&, double)>([](Scene&s, double d) { s.meshes[0].positions[1].y += d; }),
             std::function<void(Scene&, double)>([](Scene&s, double d) { s.smoothing.sigma *= 1.0 + d; }),
             std::function<void(Scene&, double)>(
                 [](Scene&s, double d) { s.camera.fov_y_degrees += 20.0 * d; }),
         }) {
      const double large = derivative(move, 2e-3), small = derivative(move, 5e-4);
      CHECK(large == doctest::Approx(small).epsilon(2e-5));
    }
  }
}

}  // namespace reference_pixel_noise_test
