// Sums of the pose solver against plain ones in double precision, at every width of the lanes, and how little of
// them comes back from the device.
#include "solve/normal_equations.hpp"

#include <doctest/doctest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "dpr/renderer.hpp"
#include "solve/pose_level.hpp"
#include "support/difference.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace normal_equations_test {

using namespace dpr;

namespace {

using Pixels = std::vector<cl_float4>;

double number(std::mt19937& engine, double low, double high) {
  return low + (high - low) * static_cast<double>(engine()) / 4294967296.0;
}

/// Random images: a third of the pixels do not show the object, another third does not move.
struct Case {
  std::size_t pixels, views, directions;
  PoseLight light;
  float scale;
  WeighedTarget target;
  Pixels colors, normals, tangents, normal_tangents;

  Case(std::size_t pixels_, std::size_t directions_, PoseLight light_, float scale_)
      : pixels(pixels_), views(3), directions(directions_), light(light_), scale(scale_) {
    std::mt19937 engine(static_cast<unsigned>(pixels + directions));
    const auto random = [&](double low, double high, double alpha) {
      const auto one = [&] { return static_cast<float>(number(engine, low, high)); };
      return cl_float4{{one(), one(), one(), static_cast<float>(alpha)}};
    };
    target.background = {0.1F, 0.3F, 0.2F};
    for (std::size_t i = 0; i < pixels; ++i) {
      target.colors.push_back(random(0, 1, 1));
      target.weights.push_back(i % 7 == 0 ? 0.0F : static_cast<float>(number(engine, 0.2, 1)));
    }
    for (std::size_t i = 0; i < views * pixels; ++i) {
      const double alpha = i % 3 == 0 ? 0 : number(engine, 0.1, 1);
      colors.push_back(random(0, alpha, alpha));
      normals.push_back(random(-alpha, alpha, alpha));
    }
    for (std::size_t i = 0; i < directions * views * pixels; ++i) {
      const double size = i % 3 == 1 ? 0 : 1;
      tangents.push_back(random(-size, size, size * number(engine, -1, 1)));
      normal_tangents.push_back(i % pixels % 3 == 2 && i / pixels % 3 == 0 ? random(-1, 1, 0) : cl_float4{});
    }
  }
};

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

/// Real spherical harmonics of a mean square of 1 over the sphere, without a normal the first alone.
Vector harmonics(Eigen::Vector3d n) {
  if (n.norm() > 0) n.normalize();
  const double first = std::sqrt(3.0), second = std::sqrt(15.0), zonal = std::sqrt(1.25);
  Vector basis(9);
  basis << 1, first * n.x(), first * n.y(), first * n.z(), second * n.x() * n.y(), second * n.y() * n.z(),
      second * n.z() * n.x(), zonal * (2 * n.z() * n.z() - n.x() * n.x() - n.y() * n.y()),
      second / 2 * (n.x() * n.x() - n.y() * n.y());
  return basis;
}

double at(const cl_float4& pixel, int channel) { return static_cast<double>(pixel.s[channel]); }

/// A view of a case in double precision.
class Reference {
 public:
  Reference(const Case& c, std::size_t view, double scale) : case_(c), view_(view) {
    inverse_ = scale > 0 ? 1 / (scale * scale) : 0;
    weights_ = Vector(pixels());
    for (Eigen::Index i = 0; i < pixels(); ++i) weights_[i] = mask(i);
    residuals_ = Matrix(pixels(), 3);
    solve();
    weigh();
    for (int i = 0; i < 30 && inverse_ > 0 && c.light != PoseLight::fixed; ++i) {
      const double before = loss_;
      solve();
      weigh();
      if (loss_ > (1 - 1e-5) * before) break;
    }
  }

  double loss() const { return loss_ / total(); }

  NormalEquations equations() const {
    const auto n = static_cast<Eigen::Index>(case_.directions);
    Matrix hessian = Matrix::Zero(n, n), scores = Matrix::Zero(pixels(), n);
    Vector gradient = Vector::Zero(n);
    for (int c = 0; c < 3; ++c) {
      Matrix jacobian(pixels(), n);
      constexpr double k_step = 1e-5;
      for (Eigen::Index k = 0; k < n; ++k)
        jacobian.col(k) = (image(c, k, k_step) - image(c, k, -k_step)) / (2 * k_step);
      const Vector residual = weights_.cwiseProduct(residuals_.col(c));
      Matrix rest = jacobian;
      if (case_.light != PoseLight::fixed) {
        const Matrix t = terms(c, 0, 0);
        rest -= t * (inverses_[c] * (t.transpose() * weights_.asDiagonal() * jacobian));
      }
      hessian += jacobian.transpose() * weights_.asDiagonal() * rest;
      gradient += jacobian.transpose() * residual;
      scores += residual.asDiagonal() * rest;
    }
    const Matrix scatter = scores.transpose() * scores;
    NormalEquations result;
    result.loss = loss();
    for (Eigen::Index k = 0; k < n; ++k) {
      result.gradient[static_cast<std::size_t>(k)] = gradient[k] / total();
      for (Eigen::Index l = 0; l < n; ++l) {
        const auto place = static_cast<std::size_t>(k * n + l);
        result.hessian[place] = (hessian(k, l) + hessian(l, k)) / (2 * total());
        result.scatter[place] = scatter(k, l) / (total() * total());
      }
    }
    return result;
  }

  double median() const {
    std::vector<double> sizes;
    for (Eigen::Index i = 0; i < pixels(); ++i) {
      for (int c = 0; c < 3; ++c) {
        if (color(i).s[3] > 0) sizes.push_back(std::abs(residuals_(i, c)));
      }
    }
    const auto middle = sizes.begin() + std::ssize(sizes) / 2;
    std::ranges::nth_element(sizes, middle);
    return *middle;
  }

 private:
  Eigen::Index pixels() const { return static_cast<Eigen::Index>(case_.pixels); }
  const cl_float4& color(Eigen::Index i) const {
    return case_.colors[view_ * case_.pixels + static_cast<std::size_t>(i)];
  }
  double mask(Eigen::Index i) const {
    return static_cast<double>(case_.target.weights[static_cast<std::size_t>(i)]);
  }
  double total() const {
    double sum = 0;
    for (Eigen::Index i = 0; i < pixels(); ++i) sum += mask(i);
    return 3 * sum;
  }
  /// Place of a pixel in the tangents.
  std::size_t moved(Eigen::Index i, Eigen::Index k) const {
    return (static_cast<std::size_t>(k) * case_.views + view_) * case_.pixels + static_cast<std::size_t>(i);
  }

  /// [pixel][term], moved by a step in a direction.
  Matrix terms(int channel, Eigen::Index direction, double step) const {
    const Eigen::Index factors = case_.light == PoseLight::gain ? 1 : 9;
    Matrix result(pixels(), factors + 1);
    for (Eigen::Index i = 0; i < pixels(); ++i) {
      const std::size_t still = view_ * case_.pixels + static_cast<std::size_t>(i),
                        place = moved(i, direction);
      Eigen::Vector3d normal;
      for (int k = 0; k < 3; ++k)
        normal[k] = at(case_.normals[still], k) + step * at(case_.normal_tangents[place], k);
      const double c = at(color(i), channel) + step * at(case_.tangents[place], channel);
      result.row(i).head(factors) = c * harmonics(normal).head(factors);
      result(i, factors) = at(color(i), 3) + step * at(case_.tangents[place], 3);
    }
    return result;
  }

  /// What shows where the object does not.
  double behind(Eigen::Index i, int channel) const {
    return case_.target.has_unknown_background ? at(case_.target.colors[static_cast<std::size_t>(i)], channel)
                                               : static_cast<double>(case_.target.background[channel]);
  }

  /// A channel in the light, moved.
  Vector image(int channel, Eigen::Index direction, double step) const {
    Vector result(pixels());
    if (case_.light == PoseLight::fixed) {
      for (Eigen::Index i = 0; i < pixels(); ++i) {
        const cl_float4& tangent = case_.tangents[moved(i, direction)];
        result[i] = at(color(i), channel) + step * at(tangent, channel);
        if (case_.target.has_unknown_background)
          result[i] += (1 - at(color(i), 3) - step * at(tangent, 3)) * behind(i, channel);
      }
      return result;
    }
    const Matrix t = terms(channel, direction, step);
    result = t * lights_[channel];
    for (Eigen::Index i = 0; i < pixels(); ++i) result[i] += behind(i, channel) * (1 - t(i, t.cols() - 1));
    return result;
  }

  void solve() {
    prior_loss_ = 0;
    for (int c = 0; c < 3; ++c) {
      if (case_.light != PoseLight::fixed) solve(c);
      const Vector shown = image(c, 0, 0);
      for (Eigen::Index i = 0; i < pixels(); ++i)
        residuals_(i, c) = shown[i] - at(case_.target.colors[static_cast<std::size_t>(i)], c);
    }
  }

  void solve(int c) {
    const Matrix t = terms(c, 0, 0);
    const Eigen::Index last = t.cols() - 1;
    Vector wanted(pixels());
    for (Eigen::Index i = 0; i < pixels(); ++i)
      wanted[i] = at(case_.target.colors[static_cast<std::size_t>(i)], c) - (1 - t(i, last)) * behind(i, c);
    Matrix normal = t.transpose() * weights_.asDiagonal() * t;
    const double part = 0.1 / std::max(normal(last, last), 0.1);
    Vector prior = Vector::Constant(last + 1, 1e-6 * normal(last, last) + 1e-20);
    prior.segment(1, last - 1).array() += part * normal(0, 0);
    prior[last] += part * normal(last, last);
    normal.diagonal() += prior;
    const Vector right = t.transpose() * weights_.asDiagonal() * wanted;
    const auto solve_from = [&](Eigen::Index first) {
      const Eigen::Index count = last + 1 - first;
      inverses_[c].setZero(last + 1, last + 1);
      inverses_[c].bottomRightCorner(count, count) = normal.bottomRightCorner(count, count).inverse();
      lights_[c] = inverses_[c] * right;
    };
    solve_from(0);
    if (lights_[c][0] < 0) solve_from(1);
    if ((weights_.asDiagonal() * t.leftCols(last) * lights_[c].head(last)).sum() < 0) solve_from(last);
    if ((weights_.asDiagonal() * t * lights_[c]).sum() < 0) lights_[c].setZero();
    prior_loss_ += lights_[c].cwiseAbs2().dot(prior);
  }

  void weigh() {
    loss_ = prior_loss_;
    for (Eigen::Index i = 0; i < pixels(); ++i) {
      const double squared = residuals_.row(i).squaredNorm(), slope = 1 / (1 + squared * inverse_);
      loss_ += mask(i) * squared * slope;
      weights_[i] = mask(i) * slope * slope;
    }
  }

  const Case& case_;
  std::size_t view_;
  double inverse_ = 0, prior_loss_ = 0, loss_ = 0;
  Vector weights_;
  Matrix residuals_;
  std::array<Vector, 3> lights_;
  std::array<Matrix, 3> inverses_;
};

/// A case on a device.
struct Run {
  Run(const Case& c, const Device& device)
      : sums(device, c.target, c.light, c.directions),
        colors(impl_of(device), c.colors),
        normals(impl_of(device), c.normals),
        tangents(impl_of(device), c.tangents),
        normal_tangents(impl_of(device), c.normal_tangents),
        images{c.views, colors, normals, colors} {}

  NormalSums sums;
  Buffer<cl_float4> colors, normals, tangents, normal_tangents;
  HypothesisImages images;
};

using test::difference;

constexpr std::array k_lights{PoseLight::fixed, PoseLight::gain, PoseLight::harmonics};

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("normal equations: sums in double precision, at every width of the lanes") {
    for (const unsigned lanes : {1U, 8U, 16U}) {
      const Device device = open_device(test::test_device().info().name);
      if (test::is_reduced() && lanes != device.info().lanes) continue;
      impl_of(device).info.lanes = lanes;
      for (const PoseLight light : k_lights) {
        for (const auto& [directions, has_unknown_background] :
             std::array<std::pair<std::size_t, bool>, 4>{{{3, false}, {6, false}, {9, false}, {6, true}}}) {
          if (test::is_reduced() && directions != 6) continue;
          // A light is found to 1e-5 of the loss: with a wide scale, in so few steps that it is exact.
          for (const float scale : {0.0F, light == PoseLight::fixed ? 0.6F : 4.0F}) {
            CAPTURE(lanes);
            CAPTURE(static_cast<int>(light));
            CAPTURE(directions);
            CAPTURE(scale);
            Case c(test::is_reduced() ? 77 : 1337, directions, light, scale);
            c.target.has_unknown_background = has_unknown_background;
            Run run(c, device);
            const std::vector<NormalEquations> found =
                run.sums.linearize(run.images, {run.tangents, run.normal_tangents, run.tangents}, {scale});
            CHECK(run.sums.losses(run.images, {scale})[1] == found[1].loss);
            for (std::size_t view = 0; view < c.views; ++view) {
              const NormalEquations expected = Reference(c, view, static_cast<double>(scale)).equations();
              CHECK(found[view].loss == doctest::Approx(expected.loss).epsilon(1e-6));
              const std::size_t n = directions;
              CHECK(difference(found[view].gradient, expected.gradient, n) < 1e-4);
              CHECK(difference(found[view].hessian, expected.hessian, n * n) < 1e-5);
              CHECK(difference(found[view].scatter, expected.scatter, n * n) < 1e-5);
            }
          }
        }
      }
    }
  }

  TEST_CASE("normal equations: no light makes a negative's colours") {
    for (const PoseLight light : {PoseLight::gain, PoseLight::harmonics}) {
      CAPTURE(static_cast<int>(light));
      Case c(77, 6, light, 0);
      std::mt19937 engine(3);
      for (cl_float4& color : c.target.colors) {
        const float value = engine() % 2 == 0 ? 0.1F : 0.9F;
        color = {{value, value, value, 1}};
      }
      for (std::size_t i = 0; i < c.colors.size(); ++i) {
        const float negative = 1 - c.target.colors[i % c.pixels].s[0];
        c.colors[i] = {{negative, negative, negative, 1}};
      }
      for (const bool is_flat :
           {false, true}) {  // a single normal: directional light alone could be the negative
        CAPTURE(is_flat);
        if (is_flat) std::ranges::fill(c.normals, cl_float4{{0.2F, 0.1F, 0.97F, 1}});
        Run run(c, test::test_device());
        CHECK(run.sums.losses(run.images, {})[0] > 0.1);  // variance of 0.1 and 0.9: 0.16
      }
      for (std::size_t i = 0; i < c.pixels; ++i) c.target.colors[i] = c.colors[i];
      Run same(c, test::test_device());
      CHECK(same.sums.losses(same.images, {})[0] < 0.01);
    }
  }

  TEST_CASE("normal equations: a scale from the median residual, none without an object") {
    for (const PoseLight light : k_lights) {
      CAPTURE(static_cast<int>(light));
      Case c(test::is_reduced() ? 77 : 1337, 3, light, 0);
      for (std::size_t i = 0; i < c.pixels; ++i) c.colors[c.pixels + i] = cl_float4{};
      Run run(c, test::test_device());
      const std::vector<float> found = run.sums.scales(run.images);
      CHECK(found[1] == 0);
      for (const std::size_t view : {std::size_t{0}, std::size_t{2}}) {
        double scale = 0;
        for (int i = 0; i < 3; ++i) scale = 4 * 1.4826 * Reference(c, view, scale).median();
        CHECK(static_cast<double>(found[view]) == doctest::Approx(scale).epsilon(1e-3));
      }
    }
  }

  TEST_CASE("normal equations: pixels are means over samples") {
    std::mt19937 engine(3);
    constexpr std::size_t k_width = 5, k_height = 4, k_samples = 3, k_images = 8;
    const std::size_t pixels = k_width * k_height;
    Pixels samples;
    for (std::size_t i = 0; i < k_images * pixels * k_samples * k_samples; ++i)
      samples.push_back({{static_cast<float>(number(engine, 0, 1)), 0.5F, 1, 0}});
    NormalSums sums(test::test_device(), {Pixels(pixels), std::vector<float>(pixels, 1)}, PoseLight::fixed,
                    3);
    Buffer<cl_float4> means;
    sums.average(Buffer<cl_float4>(test::device_impl(), samples), k_width, k_samples, means);
    const Pixels found = means.download();
    REQUIRE(found.size() == k_images * pixels);
    for (std::size_t i = 0; i < found.size(); ++i) {
      const std::size_t row = i / k_width, column = i % k_width;
      double sum = 0;
      for (std::size_t y = 0; y < k_samples; ++y) {
        for (std::size_t x = 0; x < k_samples; ++x)
          sum += at(samples[((row * k_samples + y) * k_width + column) * k_samples + x], 0);
      }
      CHECK(at(found[i], 0) == doctest::Approx(sum / (k_samples * k_samples)).epsilon(1e-6));
      CHECK(at(found[i], 1) == doctest::Approx(0.5));
    }
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("normal equations: nothing of an image comes back from the device") {
    Scene scene;
    scene.width = scene.height = test::reduced(64, 8);
    scene.camera = orbit_camera(6.7F, 30, 120);
    scene.meshes.push_back({make_cube(), glm::mat4(1.0F)});
    const Device device = open_device();
    Renderer renderer(device);
    renderer.set_scene(scene);
    renderer.forward();
    const Image target = renderer.image();
    const Pose pose{rotation_from_vector({0.1, 0.2, 0}), {}};
    const PoseOptions options{.method = LeastSquares{}, .solve_translation = true};
    const PoseSpace space(scene, pose, options);
    std::vector<Hypothesis> hypotheses(5, Hypothesis{pose});
    for (std::size_t i = 1; i < hypotheses.size(); ++i)
      hypotheses[i] = space.moved(hypotheses[i - 1], {0.02, -0.01, 0.03, 0.01, 0.02, 0});
    const auto bytes_of = [&](PoseLight light, int samples) {
      PoseLevel level(device, {scene, target, LeastSquares{}}, space, {scene.height, 0.25F, samples}, light,
                      CornerNormals::parted);
      const std::vector<NormalEquations> first = level.linearize(hypotheses);
      const std::atomic<std::size_t>& bytes = impl_of(device).bytes_from_device;
      const std::size_t before = bytes;
      const std::vector<NormalEquations> again = level.linearize(hypotheses);
      for (std::size_t i = 0; i < hypotheses.size(); ++i) {
        CHECK(again[i].loss == first[i].loss);  // the same bits
        CHECK(again[i].gradient == first[i].gradient);
        CHECK(again[i].hessian == first[i].hessian);
        CHECK(again[i].scatter == first[i].scatter);
      }
      return static_cast<double>(bytes - before) / static_cast<double>(hypotheses.size());
    };
    CHECK(bytes_of(PoseLight::fixed, 1) < 1000);
    CHECK(bytes_of(PoseLight::fixed, 2) < 1000);
    CHECK(bytes_of(PoseLight::harmonics, 1) < 4000);
  }
}

}  // namespace normal_equations_test
