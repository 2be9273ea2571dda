/// The stages of the reference renderer against closed forms, their gradients against finite differences of
/// their own forward pass. Every checker also has a case that must fail.
#include "test_support.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

namespace reference_test {

using namespace dpr::reference;

TEST_SUITE("unit") {
  TEST_CASE("priors: known values deep in the tail") {
    const auto near = [](double value, double expected) { return std::fabs(value / expected - 1.0) < 1e-14; };
    CHECK(near(log_cdf(Prior::gaussian, -9.0), -43.628149113332115497));
    CHECK(near(log_cdf(Prior::gaussian, -10.5), -58.404187061073243416));
    CHECK(near(log_cdf(Prior::gaussian, -1000.0), -500007.82669481218431));
    CHECK(near(log_cdf(Prior::gaussian, 5.0), -2.8665161296376359338e-7));
    CHECK(near(hazard(Prior::gaussian, 9.0), 9.1085231050028687978));
    CHECK(near(hazard(Prior::gaussian, 30.0), 30.033259667433677037));
    CHECK(near(cdf(Prior::cauchy, -1e9), 1e-9 / std::numbers::pi));
    CHECK(near(log_cdf(Prior::logistic, -800.0), -800.0));
    CHECK(near(log_survival(Prior::gumbel, 700.0), -700.0));
    CHECK_FALSE(
        near(std::log(0.5 * (1.0 + std::erf(-8.0 / std::numbers::sqrt2))), log_cdf(Prior::gaussian, -8.0)));
  }

  TEST_CASE("rasterize: inside and outside, metrics and discarded triangles") {
    const NdcTriangle t = {Vec3d{0.0, 0.0, 2.0}, Vec3d{1.0, 0.0, 4.0}, Vec3d{0.0, 1.0, 8.0}};
    RasterizeParameters p;
    p.blur_radius = 0.05;
    const auto inside = rasterize_forward(t, 7, {0.25, 0.1}, p);
    REQUIRE(inside);
    CHECK(inside->face == 7);
    CHECK(inside->distance == doctest::Approx(0.01));
    CHECK(1.0 / inside->depth == doctest::Approx(0.65 / 2.0 + 0.25 / 4.0 + 0.1 / 8.0));
    p.metric = DistanceMetric::euclidean;
    CHECK(rasterize_forward(t, 7, {0.25, -0.04}, p)->distance == doctest::Approx(-0.04));
    CHECK_FALSE(rasterize_forward(t, 7, {0.25, -0.06}, p));
    CHECK_FALSE(is_discarded(t, p));
    CHECK(is_discarded({t[0], t[1], Vec3d{2.0, 0.0, 3.0}}, p));
    CHECK(is_discarded({t[0], t[1], Vec3d{0.0, 1.0, 0.5}}, p));
    CHECK(is_discarded({Vec3d{0.0, 0.0, 101.0}, Vec3d{1.0, 0.0, 102.0}, Vec3d{0.0, 1.0, 103.0}}, p));
    CHECK(is_discarded({t[0], t[1], Vec3d{std::nan(""), 1.0, 3.0}}, p));
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("finite differences: a right gradient passes, wrong ones are rejected") {
    const ScalarFunction f = [](const std::vector<double>& x) { return std::sin(x[0]) * x[1]; };
    const std::vector<double> at = {0.3, 2.0};
    const double a = 2.0 * std::cos(0.3);
    const double b = std::sin(0.3);
    CHECK(check_gradient(f, at, {a, b}, 1e-5, 1e-8).passed);
    CHECK_FALSE(check_gradient(f, at, {a, -b}, 1e-5, 1e-8).passed);
    CHECK_FALSE(check_gradient(f, at, {a * 1.001, b}, 1e-5, 1e-8).passed);
    CHECK_FALSE(check_gradient(f, at, {a, std::nan("")}, 1e-5, 1e-8).passed);
    CHECK_FALSE(check_gradient(f, at, {a}, 1e-5, 1e-8).passed);
  }

  TEST_CASE("priors: density, hazard and score are derivatives of one another") {
    for (const Prior prior : k_priors) {
      CAPTURE(static_cast<int>(prior));
      for (const double x : {-4.2, -0.4, 0.0, 0.3, 4.1, 10.2}) {
        CAPTURE(x);
        CHECK(cdf(prior, x) + survival(prior, x) == doctest::Approx(1.0).epsilon(1e-14));
        const auto log_s = [&](const std::vector<double>& v) { return log_survival(prior, v[0]); };
        if (prior == Prior::uniform && std::fabs(x) > 0.5) continue;
        CHECK_GRADIENT(log_s, {x}, {-hazard(prior, x)}, 1e-5, 1e-7);
        const auto f_cdf = [&](const std::vector<double>& v) { return cdf(prior, v[0]); };
        CHECK_GRADIENT(f_cdf, {x}, {density(prior, x)}, 1e-5, 1e-6);
        if (prior == Prior::uniform) continue;
        const auto log_f = [&](const std::vector<double>& v) { return log_density(prior, v[0]); };
        CHECK_GRADIENT(log_f, {x}, {-score(prior, x)}, 1e-5, 1e-7, 1e-9);
      }
    }
    CHECK_THROWS_AS(score(Prior::uniform, 0.0), std::invalid_argument);
  }

  TEST_CASE("occupancy: values and gradients, from deep outside to deep inside") {
    CHECK(occupancy_forward(Prior::gaussian, 0.0, 1e-3).p == doctest::Approx(0.5));
    CHECK(occupancy_forward(Prior::logistic, 2e-3, 1e-3).p == doctest::Approx(1.0 / (1.0 + std::exp(-2.0))));
    CHECK(occupancy_forward(Prior::uniform, -0.6e-3, 1e-3).log_p == k_minus_infinity);
    CHECK(occupancy_backward(Prior::uniform, -0.6e-3, 1e-3, 1.0, 1.0).distance == 0.0);
    const double sigma = 0.3;
    for (const Prior prior : k_priors) {
      for (const double x : {-30.0, -9.0, -3.0, -0.3, 0.2, 2.0}) {
        if (prior == Prior::uniform && std::fabs(x) > 0.5) continue;
        CAPTURE(static_cast<int>(prior));
        CAPTURE(x);
        for (const bool logarithm : {false, true}) {
          const ScalarFunction f = [&](const std::vector<double>& v) {
            const Occupancy o = occupancy_forward(prior, v[0], v[1]);
            return logarithm ? o.log_p : o.p;
          };
          const OccupancyGradient g =
              occupancy_backward(prior, x * sigma, sigma, logarithm ? 0.0 : 1.0, logarithm ? 1.0 : 0.0);
          CHECK_GRADIENT(f, {x * sigma, sigma}, {g.distance, g.sigma}, 1e-6, 1e-6, 1e-9);
          CHECK_FALSE(
              check_gradient(f, {x * sigma, sigma}, {g.distance, -g.sigma - 1.0}, 1e-6, 1e-6, 1e-9).passed);
        }
      }
    }
  }

  TEST_CASE("transform: gradients of every parameter, field of view and intrinsics, non-square images") {
    Random random(1);
    const Mat4d model = moved(scaled({1.2, 0.7, 1.1}), {0.3, -0.4, 0.2}, {0.1, 0.2, -0.1});
    const Mat4d view = moved(k_identity, {0.2, 0.5, -0.1}, {0.1, -0.2, -3.0});
    const Vec3d position = random.vector(-0.5, 0.5);
    const Vec3d grad_ndc = random.vector(-1.0, 1.0);
    const Vec3d grad_world = random.vector(-1.0, 1.0);
    for (const ImageSize size : {ImageSize{64, 48}, ImageSize{30, 50}}) {
      for (const bool intrinsic : {false, true}) {
        Camera camera;
        camera.view = view;
        camera.fov_y_degrees = 50.0;
        if (intrinsic) camera.intrinsics = Intrinsics{40.0, 45.0, 20.0, 26.0};
        // position, model rotation and translation, view rotation and translation, field of view, intrinsics
        const ScalarFunction f = [&](const std::vector<double>& v) {
          Camera c = camera;
          c.view = moved(view, take(v, 9), take(v, 12));
          c.fov_y_degrees += v[15];
          if (intrinsic) c.intrinsics = Intrinsics{40.0 + v[16], 45.0 + v[17], 20.0 + v[18], 26.0 + v[19]};
          const TransformedVertex t = transform_forward(
              position + take(v, 0), moved(model, take(v, 3), take(v, 6)), c.view, make_projection(c, size));
          return dot(grad_ndc, t.ndc) + dot(grad_world, t.world);
        };
        const TransformGradient g =
            transform_backward(position, model, view, make_projection(camera, size), grad_ndc, grad_world);
        const ProjectionGradient p = projection_backward(camera, size, g.projection);
        std::vector<double> gradient;
        for (const Vec3d& v :
             {g.position, g.model_rotation, g.model_translation, g.view_rotation, g.view_translation}) {
          append(gradient, v);
        }
        gradient.insert(gradient.end(), {p.fov_y_degrees, p.intrinsics.fx, p.intrinsics.fy, p.intrinsics.cx,
                                         p.intrinsics.cy});
        CHECK_GRADIENT(f, std::vector<double>(20), gradient, 1e-6, 1e-8);
        gradient[10] *= 1.01;
        CHECK_FALSE(check_gradient(f, std::vector<double>(20), gradient, 1e-6, 1e-8).passed);
      }
    }
  }

  TEST_CASE("transform: gradients through a lens that distorts, and of an orthographic camera") {
    Random random(2);
    const Mat4d view = moved(k_identity, {0.2, 0.5, -0.1}, {0.1, -0.2, -3.0});
    const Vec3d position = random.vector(-0.7, 0.7);
    const Vec3d grad_ndc = random.vector(-1.0, 1.0);
    const ImageSize size{64, 48};
    enum class Lens { brown, fisheye, orthographic };
    for (const Lens lens : {Lens::brown, Lens::fisheye, Lens::orthographic}) {
      const bool is_orthographic = lens == Lens::orthographic;
      // view rotation and translation, height, intrinsics, coefficients
      const auto camera_at = [&](const std::vector<double>& v) {
        Camera c;
        c.view = moved(view, take(v, 0), take(v, 3));
        if (is_orthographic) {
          c.orthographic_height = 2.3 + v[6];
        } else {
          c.intrinsics = Intrinsics{40.0 + v[7], 45.0 + v[8], 20.0 + v[9], 26.0 + v[10]};
          c.distortion = Distortion{{-0.31 + v[11], 0.12 + v[12], 0.02 + v[13], -0.03 + v[14], 0.05 + v[15]},
                                    lens == Lens::fisheye};
        }
        return c;
      };
      const ScalarFunction f = [&](const std::vector<double>& v) {
        const Camera c = camera_at(v);
        return dot(grad_ndc, transform_forward(position, k_identity, c.view, make_projection(c, size)).ndc);
      };
      const std::vector<double> zero(16);
      const Camera camera = camera_at(zero);
      const TransformGradient g =
          transform_backward(position, k_identity, view, make_projection(camera, size), grad_ndc, {});
      const ProjectionGradient p = projection_backward(camera, size, g.projection);
      std::vector<double> gradient;
      append(gradient, g.view_rotation);
      append(gradient, g.view_translation);
      gradient.insert(gradient.end(), {p.orthographic_height, p.intrinsics.fx, p.intrinsics.fy,
                                       p.intrinsics.cx, p.intrinsics.cy});
      gradient.insert(gradient.end(), g.distortion.begin(), g.distortion.end());
      CHECK_GRADIENT(f, zero, gradient, 1e-6, 1e-8);
      gradient[is_orthographic ? 6 : 13] *= 1.01;
      CHECK_FALSE(check_gradient(f, zero, gradient, 1e-6, 1e-8).passed);
    }
  }

  TEST_CASE("transform: conventions and the camera's centre") {
    Camera camera;
    camera.fov_y_degrees = 90.0;
    const Projection wide = make_projection(camera, {80, 40});
    CHECK(transform_forward({0.0, 2.0, -2.0}, k_identity, k_identity, wide).ndc.y == doctest::Approx(1.0));
    const Projection tall = make_projection(camera, {40, 80});
    CHECK(transform_forward({0.0, 2.0, -2.0}, k_identity, k_identity, tall).ndc.y == doctest::Approx(2.0));
    camera.intrinsics = Intrinsics{40.0, 40.0, 20.0, 40.0};  // the same camera in pixels
    const Projection pixels = make_projection(camera, {40, 80});
    CHECK(transform_forward({0.0, 2.0, -2.0}, k_identity, k_identity, pixels).ndc.y == doctest::Approx(2.0));
    CHECK(pixel_center(0, 0, {40, 80}).y == doctest::Approx(2.0 - 1.0 / 40.0));

    const Mat4d view = moved(scaled({1.1, 0.9, 1.0}), {0.2, 0.5, -0.1}, {0.1, -0.2, -3.0});
    const Vec3d weight = {0.3, -0.7, 0.2};
    Camera at_zero;
    at_zero.view = view;
    const ScalarFunction f = [&](const std::vector<double>& v) {
      Camera c;
      c.view = moved(view, take(v, 0), take(v, 3));
      return dot(weight, camera_center(c));
    };
    const ViewGradient g = camera_center_backward(at_zero, weight);
    std::vector<double> gradient;
    append(gradient, g.rotation);
    append(gradient, g.translation);
    CHECK_GRADIENT(f, std::vector<double>(6), gradient, 1e-6, 1e-8);
    CHECK_FALSE(check_gradient(f, std::vector<double>(6), std::vector<double>(6), 1e-6, 1e-8).passed);
  }

  TEST_CASE("rasterize: gradients at faces, edges, vertices and beyond the horizon") {
    const NdcTriangle t = {Vec3d{-0.4, -0.3, 2.0}, Vec3d{0.6, -0.2, 3.0}, Vec3d{0.1, 0.5, 9.0}};
    const FragmentGradient weight = {0.7, 0.3, {0.2, -0.5, 0.9}};
    // inside twice, beside each edge, beside each vertex, beyond the horizon (the far vertex has 4.5 times
    // the depth)
    const std::vector<Vec2d> points = {{0.1, 0.0},   {0.15, 0.3},  {0.1, -0.4}, {0.6, 0.4},  {-0.4, 0.3},
                                       {-0.6, -0.5}, {0.9, -0.25}, {0.1, 0.8},  {0.15, 1.4}, {-0.9, 1.6}};
    for (const Vec2d& point : points) {
      for (const DistanceMetric metric : {DistanceMetric::squared, DistanceMetric::euclidean}) {
        for (const auto& [perspective, clip] :
             {std::pair{true, true}, {true, false}, {false, true}, {false, false}}) {
          const RasterizeParameters p{10.0, metric, perspective, clip, 1.0, 100.0};
          const ScalarFunction f = [&](const std::vector<double>& v) {
            const auto fragment = rasterize_forward({take(v, 0), take(v, 3), take(v, 6)}, 0, point, p);
            return weight.distance * fragment->distance + weight.depth * fragment->depth +
                   dot(weight.barycentric, fragment->barycentric);
          };
          const NdcTriangle g = rasterize_backward(t, point, p, weight);
          std::vector<double> at;
          std::vector<double> gradient;
          for (std::size_t i = 0; i < 3; ++i) {
            append(at, t[i]);
            append(gradient, g[i]);
          }
          CAPTURE(point.x);
          CAPTURE(point.y);
          CHECK_GRADIENT(f, at, gradient, 1e-6, 1e-7);
          for (double& value : gradient) value = -value;
          CHECK_FALSE(check_gradient(f, at, gradient, 1e-6, 1e-7).passed);
        }
      }
    }
  }

  TEST_CASE("shade: gradients of colours, barycentrics, geometry and lights in every model") {
    Random random(2);
    const std::vector<Face> faces = {{0, 1, 2}, {0, 2, 3}, {1, 4, 2}};
    const std::vector<Vec3d> world = {
        {0.0, 0.0, 0.1}, {1.0, 0.1, 0.0}, {0.9, 1.0, 0.3}, {0.0, 1.1, 0.0}, {2.0, 0.5, 0.2}};
    Lights lights;
    lights.ambient = {0.4, 0.5, 0.6};
    lights.point = {{{0.5, 0.3, 2.0}, {0.3, 0.4, 0.2}, {0.5, 0.2, 0.3}},
                    {{2.0, 1.0, 1.5}, {0.1, 0.4, 0.5}, {0.3, 0.4, 0.1}}};
    lights.directional = {{{-0.3, 0.2, -1.0}, {0.2, 0.1, 0.3}, {0.4, 0.3, 0.2}}};
    lights.spot = {{{0.3, 1.2, 1.8}, {0.2, -0.5, -1.7}, 50.0, 5.0, {0.4, 0.1, 0.2}, {0.3, 0.2, 0.1}}};
    for (int k = 0; k < 9; ++k) lights.harmonics.push_back(random.vector(-0.5, 0.5));
    lights.shininess = 4.0;
    lights.reflectance = {0.3, 0.8, 0.05};
    const Vec3d camera = {0.4, 0.6, 3.0};
    const Vec3d weight = {0.3, 0.8, -0.4};
    const CornerColors corners = {random.vector(0.0, 1.0), random.vector(0.0, 1.0), random.vector(0.0, 1.0)};
    const std::array<Vec3d, 3> bary = {Vec3d{0.2, 0.5, 0.3}, Vec3d{0.6, 0.1, 0.3}, Vec3d{0.0, 0.4, 0.6}};

    std::vector<double> at;
    for (const Vec3d& v : bary) append(at, v);
    for (const Vec3d& v : corners) append(at, v);
    for (const Vec3d& v : world) append(at, v);
    append(at, camera);
    const std::vector<double> numbers = numbers_of(lights);
    at.insert(at.end(), numbers.begin(), numbers.end());
    for (const Shading shading : k_shadings) {
      CAPTURE(static_cast<int>(shading));
      const auto unpack = [&](const std::vector<double>& v) {
        Lights l = displaced(zero_like(lights), {v.begin() + 36, v.end()});
        l.shading = shading;
        std::vector<Vec3d> w;
        for (std::size_t i = 0; i < 5; ++i) w.push_back(take(v, 18 + 3 * i));
        return shade_prepare(w, faces, l, take(v, 33));
      };
      const ScalarFunction f = [&](const std::vector<double>& v) {
        const ShadeScene scene = unpack(v);
        double sum = 0.0;
        for (std::size_t i = 0; i < 3; ++i) {
          sum += dot(weight, shade_forward(scene, i, take(v, 3 * i),
                                           CornerColors{take(v, 9), take(v, 12), take(v, 15)}));
        }
        return sum;
      };
      const ShadeScene scene = unpack(at);
      ShadeGradient total = make_shade_gradient(scene);
      std::vector<double> gradient;
      CornerColors grad_corners{};
      for (std::size_t i = 0; i < 3; ++i) {
        const ShadeFragmentGradient g = shade_backward(scene, i, bary[i], corners, weight, total);
        append(gradient, g.barycentric);
        for (std::size_t k = 0; k < 3; ++k) grad_corners[k] += g.corners[k];
      }
      shade_finish_backward(scene, total);
      for (const Vec3d& v : grad_corners) append(gradient, v);
      for (const Vec3d& v : total.world) append(gradient, v);
      append(gradient, total.camera);
      const std::vector<double> of_lights = numbers_of(total.lights);
      for (const double number : of_lights) CHECK(number != 0.0);
      gradient.insert(gradient.end(), of_lights.begin(), of_lights.end());
      CHECK_GRADIENT(f, at, gradient, 1e-6, 1e-8);
      gradient[33] += 1e-3;  // as if the view direction did not depend on the camera
      CHECK_FALSE(check_gradient(f, at, gradient, 1e-6, 1e-8).passed);
    }
  }

  TEST_CASE("shade: harmonics give what a diffuse surface reflects of the environment's radiance") {
    Random random(5);
    Lights lights;
    lights.ambient = {};
    for (int k = 0; k < 9; ++k) lights.harmonics.push_back(random.vector(-0.5, 0.5));
    const Vec3d normal = unit({0.3, -0.5, 0.8});
    // Radiance times the cosine over pi, summed over the sphere by midpoints in height and angle. The basis
    // is checked too: orthonormal, with integrals of the squares.
    constexpr int k_heights = 400, k_angles = 400;
    constexpr std::array k_lobe{1.0, 2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 0.25, 0.25, 0.25, 0.25, 0.25};
    const double area = 4.0 * std::numbers::pi / (k_heights * k_angles);
    Vec3d reflected;
    std::array<double, 9> squares{};
    for (int row = 0; row < k_heights; ++row) {
      for (int column = 0; column < k_angles; ++column) {
        const double z = (2.0 * row + 1.0) / k_heights - 1.0, side = std::sqrt(1.0 - z * z),
                     angle = 2.0 * std::numbers::pi * (column + 0.5) / k_angles;
        const Vec3d w{side * std::cos(angle), side * std::sin(angle), z};
        const std::array<double, 9> terms = harmonic_terms(w);
        Vec3d radiance;
        for (std::size_t k = 0; k < 9; ++k) {
          const double y = terms[k] / k_lobe[k];
          radiance += y * lights.harmonics[k];
          squares[k] += area * y * y;
        }
        reflected += area / std::numbers::pi * std::max(dot(normal, w), 0.0) * radiance;
      }
    }
    const LightTerms found = light_terms(lights, {}, {1.0, 2.0, 3.0}, normal);
    for (std::size_t channel = 0; channel < 3; ++channel)
      CHECK(found.factor[channel] == doctest::Approx(reflected[channel]).epsilon(1e-4));
    for (const double square : squares) CHECK(square == doctest::Approx(1.0).epsilon(1e-4));
  }

  TEST_CASE("shade: normals without a direction give no light and no NaN") {
    for (const Shading shading : k_shadings) {
      Lights lights;
      lights.point.resize(1);
      lights.shading = shading;
      const std::vector<Vec3d> world = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {2.0, 0.0, 0.0}};
      const ShadeScene scene = shade_prepare(world, {{0, 1, 2}}, lights, {0.0, 0.0, 3.0});
      const CornerColors white = {Vec3d{1.0, 1.0, 1.0}, Vec3d{1.0, 1.0, 1.0}, Vec3d{1.0, 1.0, 1.0}};
      CHECK(shade_forward(scene, 0, {0.2, 0.3, 0.5}, white).x == doctest::Approx(0.5));
      ShadeGradient total = make_shade_gradient(scene);
      shade_backward(scene, 0, {0.2, 0.3, 0.5}, white, {1.0, 1.0, 1.0}, total);
      shade_finish_backward(scene, total);
      for (const Vec3d& g : total.world) CHECK(length(g) == 0.0);
    }
  }

  TEST_CASE("losses: values and gradients") {
    Random random(3);
    Image image = make_image(3, 2);
    Image target = make_image(3, 2);
    for (double& v : image.rgba) v = random(0.0, 1.0);
    for (double& v : target.rgba) v = random(0.0, 1.0);
    for (const auto& [loss, name] : k_losses) {
      CAPTURE(name);
      CAPTURE(static_cast<int>(loss));
      const ScalarFunction f = [&](const std::vector<double>& v) {
        return evaluate_loss(loss, {3, 2, v}, target).value;
      };
      std::vector<double> gradient = evaluate_loss(loss, image, target).grad_image.rgba;
      CHECK_GRADIENT(f, image.rgba, gradient, 1e-6, 1e-8);
      gradient[loss == Loss::silhouette ? 3 : 0] *= 3.0;
      CHECK_FALSE(check_gradient(f, image.rgba, gradient, 1e-6, 1e-8).passed);
    }
    CHECK(evaluate_loss(Loss::mse, target, target).value == 0.0);
    CHECK(evaluate_loss(Loss::l1, target, target).value == 0.0);
    CHECK(evaluate_loss(Loss::silhouette, make_image(3, 2), make_image(3, 2)).value == 0.0);
    CHECK_THROWS_AS(evaluate_loss(Loss::mse, image, make_image(2, 3)), std::invalid_argument);
  }
}

}  // namespace reference_test
