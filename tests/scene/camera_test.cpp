// The camera against numbers worked out by hand.
#include "dpr/camera.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "support/messages.hpp"

namespace camera_test {

using namespace dpr;

namespace {

constexpr float k_nan = std::numeric_limits<float>::quiet_NaN();

// From rows, as mathematics and the scene files write it.
glm::mat4 rows(const glm::vec4& a, const glm::vec4& b, const glm::vec4& c,
               const glm::vec4& d = {0, 0, 0, 1}) {
  return glm::transpose(glm::mat4(a, b, c, d));
}

bool is_close(const glm::mat4& a, const glm::mat4& b, float tolerance = 1e-6F) {
  for (int column = 0; column < 4; ++column) {
    if (glm::length(a[column] - b[column]) > tolerance) return false;
  }
  return true;
}

const glm::mat4 k_view = rows({0, 0, 1, 2}, {0, 1, 0, 3}, {-1, 0, 0, 4});  // a quarter turn about y

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("field of view: NDC spans the short side") {
    Camera camera;
    camera.fov_y_degrees = 90;
    Projection p = projection(camera, 200, 100);
    CHECK(p.scale.x == doctest::Approx(1));
    CHECK(p.scale.y == doctest::Approx(1));
    CHECK(p.offset == glm::vec2(0));
    p = projection(camera, 100, 200);  // the field of view spans the height, which is 4 in NDC
    CHECK(p.scale.x == doctest::Approx(2));
    CHECK(p.scale.y == doctest::Approx(2));
    camera.fov_y_degrees = 60;
    CHECK(projection(camera, 64, 64).scale.y == doctest::Approx(std::sqrt(3.0)));
  }

  TEST_CASE("intrinsics: from pixels to NDC") {
    Camera camera;
    camera.intrinsics = Intrinsics{100, 50, 64, 32};  // the centre of 128x64
    Projection p = projection(camera, 128, 64);
    CHECK(p.scale.x == doctest::Approx(100.0 / 32));
    CHECK(p.scale.y == doctest::Approx(50.0 / 32));
    CHECK(p.offset == glm::vec2(0));
    camera.intrinsics = Intrinsics{100, 50, 0, 0};  // the principal point in the top-left corner
    p = projection(camera, 128, 64);
    CHECK(p.offset.x == doctest::Approx(-2));
    CHECK(p.offset.y == doctest::Approx(1));
  }

  TEST_CASE("intrinsics and field of view say the same") {
    Camera by_angle, by_pixels;
    by_angle.fov_y_degrees = 40;
    const float focal = 0.5F * 90 / std::tan(glm::radians(20.0F));
    by_pixels.intrinsics = Intrinsics{focal, focal, 60, 45};
    const Projection a = projection(by_angle, 120, 90), b = projection(by_pixels, 120, 90);
    CHECK(a.scale.x == doctest::Approx(b.scale.x));
    CHECK(a.scale.y == doctest::Approx(b.scale.y));
    CHECK(glm::length(b.offset) < 1e-6F);
  }

  TEST_CASE("orthographic: world units from the lower to the upper edge") {
    Camera camera;
    camera.orthographic_height = 4;
    CHECK(projection(camera, 200, 100).scale == glm::vec2(0.5F));
    CHECK(projection(camera, 100, 200).scale == glm::vec2(1.0F));  // the height is 4 in NDC
    CHECK(projection(camera, 100, 200).offset == glm::vec2(0));
  }

  TEST_CASE("the radius where an image folds over") {
    // 1 + 3 k1 r^2 = 0
    CHECK(largest_radius({-0.3F}) == doctest::Approx(std::sqrt(1 / 0.9)));
    CHECK(std::isinf(largest_radius({})));
    CHECK(std::isinf(largest_radius({0.3F, 0.1F, 0.5F, 0.5F, 0.1F})));
    // 1 + 3 k1 s + 5 k2 s^2 with two roots, 1 and 4, or none.
    CHECK(largest_radius({-1.25F / 3, 0.25F / 5}) == doctest::Approx(1));
    CHECK(std::isinf(largest_radius({-0.3F, 0.3F})));
    // (1 - s) (1 - s / 2) (1 - s / 4)
    CHECK(largest_radius({-1.75F / 3, 0.875F / 5, 0, 0, -0.125F / 7}) == doctest::Approx(1));
    CHECK(largest_radius({0, 0, 0, 0, -1.0F / 7}) == doctest::Approx(1));
  }

  TEST_CASE("the radius where the image of a fisheye folds over") {
    // 1 + 3 k1 a^2 = 0, and the same in a^8
    CHECK(largest_radius(fisheye(-0.3F, 0, 0, 0)) == doctest::Approx(std::tan(std::sqrt(1 / 0.9))));
    CHECK(largest_radius(fisheye(0, 0, 0, -1.0F / 9)) == doctest::Approx(std::tan(1.0)));
    // (1 - s) (1 - s / 4), s = a^2
    CHECK(largest_radius(fisheye(-1.25F / 3, 0.25F / 5, 0, 0)) == doctest::Approx(std::tan(1.0)));
    CHECK(std::isinf(largest_radius(fisheye(0, 0, 0, 0))));
    CHECK(std::isinf(largest_radius(fisheye(-0.13F, 0, 0, 0))));  // beyond 90 degrees
  }

  TEST_CASE("orbit") {
    CHECK(is_close(orbit_camera(6.7F, 0, 0).view, rows({1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, -6.7F})));
    // Azimuth 90: the camera stands on +x and looks down -x; the world's -z is on its right.
    CHECK(is_close(orbit_camera(2, 0, 90).view, rows({0, 0, -1, 0}, {0, 1, 0, 0}, {1, 0, 0, -2})));
    const Camera camera = orbit_camera(3, 30, 120, {1, 2, 3});
    const glm::vec4 target = camera.view * glm::vec4(1, 2, 3, 1);
    CHECK(glm::length(target - glm::vec4(0, 0, -3, 1)) < 1e-5F);
    const glm::vec4 eye = glm::inverse(camera.view) * glm::vec4(0, 0, 0, 1);
    CHECK(eye.y == doctest::Approx(2 + 3 * 0.5));
    CHECK(glm::dot(glm::vec3(camera.view * glm::vec4(0, 1, 0, 0)), glm::vec3(0, 1, 0)) > 0);  // up is up
  }

  TEST_CASE("OpenCV: y down, z forward") {
    CHECK(to_opencv_view(k_view) == rows({0, 0, 1, 2}, {0, -1, 0, -3}, {1, 0, 0, -4}));
    CHECK(from_opencv_view(to_opencv_view(k_view)) == k_view);
  }

  TEST_CASE("PyTorch3D: x left, z forward, row vectors") {
    const PyTorch3dView view = to_pytorch3d_view(k_view);
    // x_cam = x_world R + T. Rows of R as printed: the images of the world's axes.
    const float expected[3][3] = {{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}};
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) CHECK(view.R[column][row] == expected[row][column]);
    }
    CHECK(view.T == glm::vec3(-2, 3, -4));
    const glm::vec3 world(0.5F, -1, 2);
    const glm::vec3 opengl(k_view * glm::vec4(world, 1));
    CHECK(world * view.R + view.T == glm::vec3(-opengl.x, opengl.y, -opengl.z));
    CHECK(from_pytorch3d_view(view) == k_view);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("views that are none") {
    Camera camera;
    CHECK_NOTHROW(validate(camera));
    camera.view = glm::mat4(2.0F);
    camera.view[3] = glm::vec4(0, 0, -5, 1);  // a scaled view is one
    CHECK_NOTHROW(validate(camera));
    camera.view[2] = camera.view[1];
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "view (camera): got a singular matrix");
    camera.view = glm::mat4(0.0F);
    camera.view[3][3] = 1;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "view (camera): got a singular matrix");
    camera.view = glm::mat4(1.0F);
    camera.view[2][3] = -1;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "view (camera): got the last row (0, 0, -1, 1)");
    camera.view = glm::mat4(1.0F);
    camera.view[3][1] = k_nan;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "view (camera): got nan in row 1, column 3");
  }

  TEST_CASE("orthographic cameras and lenses that are none") {
    Camera camera;
    camera.orthographic_height = 2;
    CHECK_NOTHROW(validate(camera));
    camera.intrinsics = Intrinsics{1, 1, 0, 0};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "intrinsics (camera): got one beside");
    camera.intrinsics.reset();
    camera.distortion = Distortion{};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "distortion (camera): got one beside");
    camera.distortion.reset();
    camera.orthographic_height = 0;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "orthographic_height (camera): got 0");
    camera.orthographic_height.reset();
    camera.distortion = Distortion{0, 0, k_nan};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "p1 (camera.distortion): got nan");
    camera.distortion = Distortion{.k4 = 1};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera),
                          "k4 (camera.distortion): got 1, expected 0 of Brown's model");
    camera.distortion = fisheye(0, 0, 0, k_nan);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "k4 (camera.fisheye): got nan");
    camera.distortion = Distortion{.p2 = 1, .model = LensModel::fisheye};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera),
                          "p2 (camera.fisheye): got 1, expected 0 of a fisheye");
    camera.distortion = fisheye(1, 2, 3, 4);
    CHECK_NOTHROW(validate(camera));
    glm::mat4 projection(1.0F);
    projection[2][3] = 0.5F;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, from_opengl(k_view, projection, 8, 8), "projection (from_opengl)");
    projection = glm::mat4(1.0F);
    projection[3][0] = 0.5F;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, from_opengl(k_view, projection, 8, 8), "off the centre");
  }

  TEST_CASE("parameters out of range") {
    Camera camera;
    for (const float angle : {0.0F, -1.0F, 180.0F, k_nan}) {
      camera.fov_y_degrees = angle;
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "fov_y_degrees (camera)");
    }
    camera.intrinsics = Intrinsics{1, 1, 0, 0};  // instead of the field of view
    CHECK_NOTHROW(validate(camera));
    camera.intrinsics->fy = 0;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "fy (camera.intrinsics): got 0");
    camera.intrinsics->fy = 1;
    camera.intrinsics->cx = k_nan;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "cx (camera.intrinsics): got nan");
    camera = Camera();
    camera.znear = 0;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "znear (camera): got 0");
    camera.znear = camera.zfar;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "zfar (camera): got 100");
    camera.zfar = std::numeric_limits<float>::infinity();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(camera), "zfar (camera): got inf");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, orbit_camera(0, 0, 0), "distance (orbit_camera)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, orbit_camera(1, 90, 0),
                          "elevation_degrees (orbit_camera): got 90");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, orbit_camera(1, 0, k_nan), "azimuth_degrees (orbit_camera)");
  }
}

}  // namespace camera_test
