// A camera calibrated from pictures of a board of coloured squares: focal lengths, centre, two coefficients
// of distortion and six poses, by the gradients of the images alone. The pictures are the renderer's own, or
// of points that OpenCV projected.
#include <doctest/doctest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "dpr/dpr.hpp"
#include "support/opencv_points.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace calibration_test {

using namespace dpr;
using dpr::test::OpencvCase;

namespace {

using Vector = Eigen::VectorXd;

constexpr int k_width = 96, k_height = 72, k_columns = 9, k_rows = 7;  // of the board's corners
constexpr Eigen::Index k_lens = 6, k_pose = 6;                         // parameters of all views, and of each

/// Every square a colour of its own, which tells it from its neighbours.
Mesh make_board(const std::vector<glm::vec3>& corners) {
  std::mt19937 engine(3);
  const auto channel = [&] { return static_cast<float>(engine() % 256U) / 255.0F; };
  Mesh mesh;
  mesh.positions = corners;
  for (unsigned row = 0; row + 1 < k_rows; ++row) {
    for (unsigned column = 0; column + 1 < k_columns; ++column) {
      const unsigned first = row * k_columns + column, below = first + k_columns;
      mesh.faces.insert(mesh.faces.end(), {{first, below, first + 1}, {first + 1, below, below + 1}});
      const float red = channel(), green = channel();
      mesh.face_colors.insert(mesh.face_colors.end(), 2, glm::vec3(red, green, channel()));
    }
  }
  return mesh;
}

Scene board_scene(const std::vector<glm::vec3>& corners) {
  Scene scene;
  scene.width = k_width;
  scene.height = k_height;
  scene.background = glm::vec3(0.5F);
  scene.meshes = {{make_board(corners)}};
  scene.smoothing.distance = DistanceMetric::euclidean;
  scene.smoothing = smoothing_preset("joint_gaussian");  // smooth to the last digit
  scene.smoothing.distance = DistanceMetric::euclidean;
  scene.gradients = {.positions = false,
                     .colors = false,
                     .transform = false,
                     .smoothing = false,
                     .background = false,
                     .distortion = true};
  return scene;
}

float sigma_of(double pixels) { return static_cast<float>(2 * pixels / k_height); }

std::vector<Image> render(const Device& device, Scene scene, const std::vector<View>& views, double blur) {
  scene.smoothing.sigma = sigma_of(blur);
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.set_views(views);
  renderer.forward();
  std::vector<Image> images;
  for (std::size_t v = 0; v < views.size(); ++v) images.push_back(renderer.image(v));
  return images;
}

/// Pictures of the points where OpenCV sees them, without any of the library's cameras: the corners are put
/// before a pinhole, each at its pixel.
std::vector<Image> opencv_pictures(const Device& device, const std::vector<OpencvCase>& cases, double blur) {
  constexpr float k_depth = 5;
  std::vector<Image> images;
  for (const OpencvCase& of : cases) {
    std::vector<glm::vec3> corners;
    for (const glm::dvec2& pixel : of.pixels) {
      const glm::vec2 from_centre(pixel + 0.5 - glm::dvec2(k_width, k_height) / 2.0);
      corners.emplace_back(from_centre.x, -from_centre.y, -k_depth);
    }
    Scene scene = board_scene(corners);
    scene.camera.intrinsics = Intrinsics{k_depth, k_depth, k_width / 2.0F, k_height / 2.0F};
    images.push_back(render(device, scene, {View{scene.camera, {glm::mat4(1.0F)}}}, blur).front());
  }
  return images;
}

/// How far a parameter goes to move what the cameras see by about a pixel.
Vector units(std::size_t views) {
  Vector unit(k_lens + k_pose * static_cast<Eigen::Index>(views));
  unit.head(k_lens) << 2, 2, 1, 1, 0.1, 0.4;
  for (Eigen::Index v = 0; v < static_cast<Eigen::Index>(views); ++v)
    unit.segment(k_lens + k_pose * v, k_pose) << 0.025, 0.025, 0.02, 0.025, 0.025, 0.06;
  return unit;
}

/// A world-to-camera matrix turned and shifted, in the chart of its gradients.
glm::mat4 moved(const glm::mat4& view, const glm::dvec3& rotation, const glm::dvec3& translation) {
  const glm::dmat4 m(view);
  const glm::dmat3 linear = rotation_from_vector(rotation) * glm::dmat3(m);
  glm::dmat4 result(linear);
  result[3] = glm::dvec4(glm::dvec3(m[3]) + translation, 1);
  return glm::mat4(result);
}

/// The views a step further: fx, fy, cx, cy, k1, k2 of all, then rotation and translation of each.
std::vector<View> moved(std::vector<View> views, const Vector& step) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto pose = step.segment(k_lens + k_pose * static_cast<Eigen::Index>(v), k_pose);
    Camera& camera = views[v].camera;
    camera.view = moved(camera.view, {pose[0], pose[1], pose[2]}, {pose[3], pose[4], pose[5]});
    Intrinsics& k = *camera.intrinsics;
    float* const lens[] = {&k.fx, &k.fy, &k.cx, &k.cy, &camera.distortion->k1, &camera.distortion->k2};
    for (Eigen::Index i = 0; i < k_lens; ++i)
      *lens[i] = static_cast<float>(static_cast<double>(*lens[i]) + step[i]);
  }
  return views;
}

Vector flat(const SceneGradient& gradient) {
  Vector result = Vector::Zero(k_lens + k_pose * static_cast<Eigen::Index>(gradient.views.size()));
  Eigen::Index next = k_lens;
  for (const ViewGradient& view : gradient.views) {
    const CameraGradient& c = view.camera;
    for (Eigen::Index k = 0; k < 4; ++k) result[k] += c.intrinsics[static_cast<std::size_t>(k)];
    result[4] += c.distortion[0];
    result[5] += c.distortion[1];
    for (const glm::dvec3& part : {c.view.rotation, c.view.translation}) {
      for (int axis = 0; axis < 3; ++axis) result[next++] = part[axis];
    }
  }
  return result;
}

/// Difference from the pictures, and its gradient in units.
class Objective {
 public:
  Objective(const Device& device, const Scene& scene, const std::vector<Image>& pictures)
      : renderer_(device),
        loss_(device, LossWeights::only(LossKind::mse), pictures),
        unit_(units(pictures.size())) {
    renderer_.set_scene(scene);
  }
  const Vector& unit() const { return unit_; }
  double value(const std::vector<View>& views) {
    renderer_.set_views(views);
    renderer_.forward();
    return loss_.evaluate(renderer_);
  }
  /// At the views of the last value.
  Vector gradient() { return flat(renderer_.backward(loss_)).cwiseProduct(unit_); }

 private:
  Renderer renderer_;
  ImageLoss loss_;
  Vector unit_;
};

/// Curvature that Broyden, Fletcher, Goldfarb & Shanno's steps know: the inverse of the Hessian.
class InverseHessian {
 public:
  explicit InverseHessian(const Vector& gradient) { restart(gradient); }
  /// As if every parameter were alike, with a first step of half a pixel.
  void restart(const Vector& gradient) {
    inverse_ = Eigen::MatrixXd::Identity(gradient.size(), gradient.size()) * (0.5 / gradient.norm());
    is_fresh_ = true;
  }
  bool is_fresh() const { return is_fresh_; }
  /// At most a pixel in every parameter.
  Vector step(const Vector& gradient) const {
    const Vector step = -inverse_ * gradient;
    return step * std::min(1.0, 1.0 / step.lpNorm<Eigen::Infinity>());
  }
  void update(const Vector& step, const Vector& change) {
    const double along = change.dot(step);
    if (!(along > 0)) return;
    const Vector turned = inverse_ * change;
    inverse_ += ((along + change.dot(turned)) / (along * along)) * step * step.transpose() -
                (turned * step.transpose() + step * turned.transpose()) / along;
    is_fresh_ = false;
  }

 private:
  Eigen::MatrixXd inverse_;
  bool is_fresh_ = true;
};

/// Quasi-Newton steps, halved until the loss falls, and begun anew where it does not.
std::vector<View> minimize(Objective& objective, std::vector<View> views, int iterations) {
  constexpr int k_halvings = 12;
  double loss = objective.value(views);
  Vector gradient = objective.gradient();
  InverseHessian inverse(gradient);
  for (int i = 0; i < iterations; ++i) {
    Vector step = inverse.step(gradient);
    std::vector<View> next = moved(views, step.cwiseProduct(objective.unit()));
    double next_loss = objective.value(next);
    for (int halvings = 0; halvings < k_halvings && !(next_loss < loss); ++halvings) {
      step *= 0.5;
      next = moved(views, step.cwiseProduct(objective.unit()));
      next_loss = objective.value(next);
    }
    if (!(next_loss < loss)) {
      if (inverse.is_fresh()) break;
      inverse.restart(gradient);
      continue;
    }
    const Vector next_gradient = objective.gradient();
    inverse.update(step, next_gradient - gradient);
    views = std::move(next);
    loss = next_loss;
    gradient = next_gradient;
  }
  return views;
}

/// 5% in focal length, 3 degrees and 5% of the distance off, without distortion, the centre in the middle.
std::vector<View> start_from(const std::vector<View>& truth) {
  std::mt19937 engine(7);
  const auto direction = [&] {
    const auto number = [&] { return static_cast<double>(engine()) / 2147483648.0 - 1; };
    const double x = number(), y = number();
    return glm::normalize(glm::dvec3(x, y, number()));
  };
  std::vector<View> views = truth;
  for (View& view : views) {
    const glm::dvec3 rotation = glm::radians(3.0) * direction();
    const double distance = glm::length(glm::dvec3(view.camera.view[3]));
    view.camera.view = moved(view.camera.view, rotation, 0.05 * distance * direction());
    const Intrinsics& k = *truth.front().camera.intrinsics;
    view.camera.intrinsics = Intrinsics{1.05F * k.fx, 1.05F * k.fy, k_width / 2.0F, k_height / 2.0F};
    view.camera.distortion = Distortion{};
  }
  return views;
}

/// The largest of all views: relative to the truth, the centre in pixels.
struct CalibrationError {
  double focal = 0, centre = 0, k1 = 0, k2 = 0, degrees = 0, distance = 0;
};

double relative(float found, float truth) { return std::abs(static_cast<double>(found / truth) - 1); }

CalibrationError error_of(const std::vector<View>& found, const std::vector<View>& truth) {
  const Camera &lens = found.front().camera, &true_lens = truth.front().camera;
  const Intrinsics &k = *lens.intrinsics, &true_k = *true_lens.intrinsics;
  CalibrationError e;
  e.focal = std::max(relative(k.fx, true_k.fx), relative(k.fy, true_k.fy));
  e.centre = glm::length(glm::dvec2(k.cx, k.cy) - glm::dvec2(true_k.cx, true_k.cy));
  e.k1 = relative(lens.distortion->k1, true_lens.distortion->k1);
  e.k2 = relative(lens.distortion->k2, true_lens.distortion->k2);
  for (std::size_t v = 0; v < truth.size(); ++v) {
    const glm::dmat4 view(found[v].camera.view), wanted(truth[v].camera.view);
    e.degrees = std::max(e.degrees, angle_degrees(glm::dmat3(view), glm::dmat3(wanted)));
    e.distance = std::max(e.distance,
                          glm::length(glm::dvec3(view[3] - wanted[3])) / glm::length(glm::dvec3(wanted[3])));
  }
  return e;
}

std::string text(const CalibrationError& e) {
  char line[200];
  std::snprintf(line, sizeof line,
                "focal length %.4f%%, centre %.4f px, k1 %.4f%%, k2 %.4f%%, %.4f degrees, "
                "%.4f%% of the distance",
                100 * e.focal, e.centre, 100 * e.k1, 100 * e.k2, e.degrees, 100 * e.distance);
  return line;
}

/// From blurred pictures to sharp ones.
template <typename Pictures>
CalibrationError calibrate(const Pictures& pictures) {
  const Device device = test::test_device();
  const std::vector<OpencvCase> cases = test::opencv_cases("boards");
  Scene scene = board_scene(cases.front().points);
  std::vector<View> truth;
  for (const OpencvCase& of : cases) truth.push_back({of.camera, {glm::mat4(1.0F)}});
  std::vector<View> views = start_from(truth);
  const CalibrationError before = error_of(views, truth);
  CHECK(before.focal > 0.049);
  CHECK(before.degrees > 2.9);
  CHECK(before.distance > 0.049);
  for (const double blur : {3.0, 1.0, 0.4}) {
    scene.smoothing.sigma = sigma_of(blur);
    Objective objective(device, scene, pictures(device, scene, cases, truth, blur));
    views = minimize(objective, views, 200);
    MESSAGE(blur << " px: " << text(error_of(views, truth)));
  }
  return error_of(views, truth);
}

void check(const CalibrationError& e) {
  CHECK(e.focal < 1e-3);
  CHECK(e.centre < 0.01);
  CHECK(e.k1 < 1e-3);
  CHECK(e.k2 < 1e-3);
  CHECK(e.degrees < 0.05);
  CHECK(e.distance < 1e-3);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("calibration: from the renderer's own pictures") {
    if (test::is_reduced()) return;
    check(calibrate([](const Device& device, const Scene& scene, const std::vector<OpencvCase>&,
                       const std::vector<View>& truth,
                       double blur) { return render(device, scene, truth, blur); }));
  }

  TEST_CASE("calibration: from views whose points OpenCV projected") {
    if (test::is_reduced()) return;
    check(calibrate([](const Device& device, const Scene&, const std::vector<OpencvCase>& cases,
                       const std::vector<View>&,
                       double blur) { return opencv_pictures(device, cases, blur); }));
  }
}

}  // namespace calibration_test
