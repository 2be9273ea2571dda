// Other programs' cameras: points that their own formulas project, in double precision, land on the same
// pixels through the library's converters and device code.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "dpr/dpr.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/opencv_points.hpp"
#include "support/probe.hpp"

namespace cameras_test {

using namespace dpr;
using dpr::test::OpencvCase;

namespace {

constexpr int k_width = 200, k_height = 150;
constexpr double k_tolerance = 1e-4;  // of a pixel

/// Pixels from the corner of the top-left one, as the device's transform stage projects.
std::vector<glm::dvec2> pixels_of(const Camera& camera, const std::vector<glm::vec3>& points) {
  Scene scene;
  scene.width = k_width;
  scene.height = k_height;
  scene.camera = camera;
  Mesh mesh;
  mesh.positions = points;
  mesh.faces = {{0, 1, 2}};
  scene.meshes = {{mesh}};
  Renderer renderer(test::test_device());
  renderer.set_scene(scene);
  Renderer::Impl& m = impl_of(renderer);
  m.transform.forward(m.frame, m.device_views, *m.geometry, false);
  std::vector<glm::dvec2> pixels;
  for (const cl_float4& ndc : m.transform.ndc.download()) {
    const glm::dvec2 from_centre(ndc.s[0], -ndc.s[1]);
    pixels.push_back(glm::dvec2(k_width, k_height) / 2.0 + from_centre * (std::min(k_width, k_height) / 2.0));
  }
  return pixels;
}

/// In front of the camera.
std::vector<glm::vec3> some_points() {
  std::vector<glm::vec3> points;
  for (const float x : {-0.75F, 0.125F, 0.875F}) {
    for (const float y : {-0.5F, 0.25F, 0.75F}) points.insert(points.end(), {{x, y, -0.5F}, {x, y, 0.75F}});
  }
  return points;
}

/// A turned camera, with numbers that single precision holds.
glm::mat4 some_view() {
  glm::mat4 view(0.0F);  // columns
  view[0] = {0.6F, 0, 0.8F, 0};
  view[1] = {0, 1, 0, 0};
  view[2] = {-0.8F, 0, 0.6F, 0};
  view[3] = {0.125F, -0.25F, -3.5F, 1};
  return view;
}

using Formula = std::function<glm::dvec2(const glm::dvec3& point)>;

double largest_difference(const Camera& camera, const Formula& formula) {
  const std::vector<glm::vec3> points = some_points();
  const std::vector<glm::dvec2> found = pixels_of(camera, points);
  double largest = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    largest = std::max(largest, glm::length(found[i] - formula(glm::dvec3(points[i]))));
  return largest;
}

/// OpenGL's: clip coordinates, the division, the viewport, whose rows count from below.
Formula opengl_formula(const glm::mat4& view, const glm::mat4& projection) {
  return [=](const glm::dvec3& point) {
    const glm::dvec4 clip = glm::dmat4(projection) * (glm::dmat4(view) * glm::dvec4(point, 1));
    return glm::dvec2((clip.x / clip.w + 1) / 2 * k_width, (1 - clip.y / clip.w) / 2 * k_height);
  };
}

/// Pixels between where a camera shows OpenCV's points and where OpenCV does, which counts from pixels' centres.
double largest_error(const Camera& camera, const OpencvCase& opencv) {
  const std::vector<glm::dvec2> found = pixels_of(camera, opencv.points);
  double worst = 0;
  for (std::size_t i = 0; i < found.size(); ++i)
    worst = std::max(worst, glm::length(found[i] - (opencv.pixels[i] + 0.5)));
  return worst;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("cameras: OpenGL's matrices, both ways") {
    glm::mat4 frustum(0.0F);
    frustum[0][0] = 1.5F;
    frustum[1][1] = 2.25F;
    frustum[2] = {0.125F, -0.0625F, -1.25F, -1};
    frustum[3][2] = -2.25F;
    const Camera camera = from_opengl(some_view(), frustum, k_width, k_height);
    CHECK(camera.znear == doctest::Approx(1));
    CHECK(camera.zfar == doctest::Approx(9));
    CHECK(largest_difference(camera, opengl_formula(some_view(), frustum)) < k_tolerance);
    const glm::mat4 back = to_opengl_projection(camera, k_width, k_height);
    for (int column = 0; column < 4; ++column) CHECK(glm::length(back[column] - frustum[column]) < 1e-6F);

    glm::mat4 box(0.0F);
    box[0][0] = 0.375F;
    box[1][1] = 0.5F;
    box[2][2] = -0.25F;
    box[3] = {0, 0, -1.25F, 1};
    const Camera orthographic = from_opengl(some_view(), box, k_width, k_height);
    CHECK(*orthographic.orthographic_height == 4);
    CHECK(orthographic.znear == 1);
    CHECK(orthographic.zfar == 9);
    CHECK(largest_difference(orthographic, opengl_formula(some_view(), box)) < k_tolerance);
    CHECK(to_opengl_projection(orthographic, k_width, k_height) == box);
    Camera higher = orthographic;
    *higher.orthographic_height *= 1.001F;
    CHECK(largest_difference(higher, opengl_formula(some_view(), box)) > k_tolerance);
  }

  TEST_CASE("cameras: OpenCV's projectPoints, with all five coefficients") {
    for (const OpencvCase& opencv : test::opencv_cases("lenses")) {
      const auto largest = [&](const Camera& camera) { return largest_error(camera, opencv); };
      CHECK(largest(opencv.camera) < k_tolerance);
      // Coefficients in another order, or with another axis, are noticed.
      const Distortion d = *opencv.camera.distortion;
      if (d.k1 == 0) continue;
      Camera wrong = opencv.camera;
      wrong.distortion = Distortion{d.k1, d.k2, d.p2, d.p1, d.k3};
      CHECK(largest(wrong) > 0.1);
      wrong.distortion = Distortion{d.k1, d.k2, -d.p1, d.p2, d.k3};
      CHECK(largest(wrong) > 0.1);
      wrong.distortion = Distortion{d.k1, d.k3, d.p1, d.p2, d.k2};
      CHECK(largest(wrong) > 1e-3);
      CHECK(to_opencv_intrinsics(*opencv.camera.intrinsics).cx == opencv.camera.intrinsics->cx - 0.5F);
    }
  }

  TEST_CASE("cameras: OpenCV's fisheye::projectPoints, with all four coefficients") {
    for (const OpencvCase& opencv : test::opencv_cases("fisheyes")) {
      CHECK(largest_error(opencv.camera, opencv) < k_tolerance);
      const Distortion d = *opencv.camera.distortion;
      Camera wrong = opencv.camera;
      wrong.distortion->model = LensModel::brown;
      wrong.distortion->k4 = 0;
      CHECK(largest_error(wrong, opencv) > 10);
      for (const Distortion& other :
           {fisheye(d.k1 + 0.01F, d.k2, d.k3, d.k4), fisheye(d.k1, d.k2 + 0.01F, d.k3, d.k4),
            fisheye(d.k1, d.k2, d.k3 + 0.01F, d.k4), fisheye(d.k1, d.k2, d.k3, d.k4 + 0.01F)}) {
        wrong.distortion = other;
        CHECK(largest_error(wrong, opencv) > 0.3);
      }
    }
  }

  TEST_CASE("cameras: PyTorch3D's NDC, perspective and orthographic") {
    const PyTorch3dView view = to_pytorch3d_view(some_view());
    const glm::dvec2 focal(2.25, 2.5), centre(0.125, -0.0625);
    // x_cam = x_world R + T; NDC has x to the left and y up, [-1, 1] on the short side, and so has the screen
    // half the short side to a unit of NDC, from the image's middle (PyTorch3D's docs/notes/cameras.md).
    const auto formula = [&](bool is_orthographic, const glm::dvec2& f, const glm::dvec2& c) {
      return [=](const glm::dvec3& point) {
        const glm::dvec3 p = point * glm::dmat3(view.R) + glm::dvec3(view.T);
        const glm::dvec2 ndc = f * glm::dvec2(p) / (is_orthographic ? 1.0 : p.z) + c;
        return glm::dvec2(k_width, k_height) / 2.0 - ndc * (k_height / 2.0);
      };
    };
    Camera camera;
    camera.view = from_pytorch3d_view(view);
    camera.intrinsics = from_pytorch3d_projection({glm::vec2(focal), glm::vec2(centre)}, k_width, k_height);
    CHECK(largest_difference(camera, formula(false, focal, centre)) < k_tolerance);
    CHECK(largest_difference(camera, formula(false, focal, -centre)) > 1);
    const PyTorch3dProjection back = to_pytorch3d_projection(camera, k_width, k_height);
    CHECK(glm::length(back.focal_length - glm::vec2(focal)) < 1e-6F);
    CHECK(glm::length(back.principal_point - glm::vec2(centre)) < 1e-6F);

    Camera orthographic;
    orthographic.view = some_view();
    orthographic.orthographic_height = 3.0F;
    const PyTorch3dProjection of = to_pytorch3d_projection(orthographic, k_width, k_height);
    CHECK(largest_difference(orthographic, formula(true, glm::dvec2(of.focal_length), glm::dvec2(0))) <
          k_tolerance);
    CHECK(of.principal_point == glm::vec2(0));
  }

  TEST_CASE("cameras: an orthographic one by its height in world units") {
    Camera camera;
    camera.view = some_view();
    camera.orthographic_height = 3.0F;
    const Formula formula = [&](const glm::dvec3& point) {
      const glm::dvec4 p = glm::dmat4(camera.view) * glm::dvec4(point, 1);
      const double pixels_per_unit = k_height / 3.0;
      return glm::dvec2(k_width / 2.0 + pixels_per_unit * p.x, k_height / 2.0 - pixels_per_unit * p.y);
    };
    CHECK(largest_difference(camera, formula) < k_tolerance);
  }

  TEST_CASE("cameras: without distortion a lens gives the same picture, and all coefficients gradients") {
    Scene scene;
    scene.width = scene.height = 24;
    scene.camera = orbit_camera(4, 20, 30);
    scene.meshes = {{make_cube()}};
    scene.smoothing = smoothing_preset("pixel");
    scene.gradients.distortion = true;
    Renderer renderer(test::test_device());
    renderer.set_scene(scene);
    renderer.forward();
    const Image plain = renderer.image();
    scene.camera.distortion = Distortion{};
    renderer.set_scene(scene);
    renderer.forward();
    double largest = 0;
    for (std::size_t i = 0; i < plain.pixels.size(); ++i)
      largest = std::max(largest, double(glm::length(renderer.image().pixels[i] - plain.pixels[i])));
    CHECK(largest < 1e-4);
    Image grad(24, 24);
    for (std::size_t i = 0; i < grad.pixels.size(); ++i) grad.pixels[i] = glm::vec4(float(i % 7), 0, 0, 0);
    const SceneGradient found = renderer.backward(std::span(&grad, 1));
    for (const double k : found.views[0].camera.distortion) CHECK(k != 0);
    scene.camera.distortion = fisheye(0, 0, 0, 0);
    renderer.set_scene(scene);
    renderer.forward();
    CHECK(renderer.image().pixels != plain.pixels);
    const SceneGradient of_fisheye = renderer.backward(std::span(&grad, 1));
    for (const double k : of_fisheye.views[0].camera.fisheye) CHECK(k != 0);
    for (const double k : of_fisheye.views[0].camera.distortion) CHECK(k == 0);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("cameras: of one kind in a batch; views may have different lenses") {
    Scene scene;
    scene.width = scene.height = 8;
    scene.camera = orbit_camera(4, 20, 30);
    scene.meshes = {{make_cube()}};
    Renderer renderer(test::test_device());
    renderer.set_scene(scene);
    View own{scene.camera, {glm::mat4(1.0F)}}, other = own;
    other.camera.orthographic_height = 3.0F;
    const View mixed[] = {own, other}, orthographic[] = {other, other};
    CHECK_THROWS_AS(renderer.set_views(mixed), InvalidArgument);
    CHECK_NOTHROW(renderer.set_views(orthographic));
    other = own;
    other.camera.distortion = Distortion{-0.2F};
    View fish = own;
    fish.camera.distortion = fisheye(-0.2F, 0, 0, 0);
    const View lenses[] = {own, other, fish};
    renderer.set_views(std::span(&own, 1));
    renderer.forward();
    const Image alone = renderer.image();
    renderer.set_views(lenses);
    renderer.forward();
    CHECK(renderer.image(0).pixels == alone.pixels);
    CHECK(renderer.image(1).pixels != alone.pixels);
    CHECK(renderer.image(2).pixels != renderer.image(1).pixels);
  }
}

}  // namespace cameras_test
