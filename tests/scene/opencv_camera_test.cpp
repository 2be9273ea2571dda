// Cameras in the YAML of OpenCV's calibration programs.
#include "scene/opencv_camera.hpp"

#include <doctest/doctest.h>

#include <string>

#include "support/messages.hpp"

namespace opencv_camera_test {

using namespace dpr;

namespace {

std::string matrix(const std::string& key, const std::string& data) {
  return key + ": !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ " + data + " ]\n";
}

const std::string k_head = "%YAML:1.0\n---\ncalibration_time: \"Tue Mar  5 12:00:00 2024\"\nflags: 0\n";
const std::string k_matrix = matrix("camera_matrix", "500., 0., 319.5, 0., 5.1e+02, 239.5, 0., 0., 1.");

OpenCvCamera parse(const std::string& text) { return parse_opencv_camera("camera.yml", text); }

std::string message(const std::string& text) {
  return test::message_of<Error>([&] { parse(text); });
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("the camera of a calibration") {
    const OpenCvCamera camera =
        parse(k_head + "image_width: 640\nimage_height: 480\n" + k_matrix +
              matrix("distortion_coefficients", "-0.25, 0.1,\n       1.e-03, -2.e-03, 0.02, 0., 0., 0.") +
              "image_points: !!opencv-matrix\n   rows: 1\n   data: [ .Nan, 1. ]\n");
    CHECK(camera.intrinsics == Intrinsics{500, 510, 320, 240});
    CHECK(camera.distortion == Distortion{-0.25F, 0.1F, 1e-3F, -2e-3F, 0.02F});
    CHECK(camera.size == glm::ivec2(640, 480));
    const OpenCvCamera older =
        parse("\xEF\xBB\xBF%YAML:1.0\r\n" + matrix("Camera_Matrix", "1,0,0,0,1,0,0,0,1") +
              matrix("Distortion_Coefficients", "0,0,0,0"));
    CHECK(older.intrinsics == Intrinsics{1, 1, 0.5F, 0.5F});
    CHECK_FALSE(older.distortion);
    CHECK_FALSE(older.size);
  }

  TEST_CASE("the camera of a calibration whose keys are those of OpenCV's functions") {
    for (const char* const key : {"dist_coeffs", "distCoeffs"}) {
      const OpenCvCamera camera =
          parse(matrix("cameraMatrix", "1,0,0,0,1,0,0,0,1") + matrix(key, "-0.25, 0.1, 0, 0"));
      CHECK(camera.intrinsics == Intrinsics{1, 1, 0.5F, 0.5F});
      CHECK(camera.distortion == Distortion{-0.25F, 0.1F, 0, 0, 0});
      CHECK(test::contains(
          message(k_matrix + matrix(key, "0,0,0,0") + matrix("distortion_coefficients", "0,0,0,0")),
          "\"distortion_coefficients\" twice"));
    }
  }

  TEST_CASE("the camera of a calibration of a fisheye") {
    for (const char* const model : {"fisheye_model: 1\n", "distortion_model: equidistant\n"}) {
      const auto lens = [&](const std::string& data) {
        return parse(model + k_matrix + matrix("distortion_coefficients", data)).distortion;
      };
      CHECK(lens("-0.25, 0.1, 1.e-03, -2.e-03") == fisheye(-0.25F, 0.1F, 1e-3F, -2e-3F));
      CHECK(lens("0, 0, 0, 0") == fisheye(0, 0, 0, 0));
      CHECK(message(model + k_matrix) == "camera.yml: a fisheye without distortion_coefficients");
      CHECK(test::contains(message(model + k_matrix + matrix("distortion_coefficients", "0,0,0,0,0")),
                           "distortion_coefficients: expected 4 numbers of a fisheye, got 5"));
    }
    CHECK_FALSE(parse("fisheye_model: 0\n" + k_matrix).distortion);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("what a camera here cannot hold, and what is no camera, is refused by name and place") {
    const auto lens = [](const std::string& data) {
      return message(k_matrix + matrix("distortion_coefficients", data));
    };
    CHECK(lens("0,0,0,0,0,0.5,0,0") ==
          "k4 of distortion_coefficients (camera.yml): got 0.5, expected 0: a lens here has k1, k2, p1, p2 "
          "and k3; "
          "calibrate without the others");
    CHECK(
        test::contains(lens("0,0,0,0,0,0,0,0,0,1,0,0"), "s2 of distortion_coefficients (camera.yml): got 1"));
    CHECK(test::contains(lens("0,0,0,0,0,0,0,0,0,0,0,0,0,1"), "tau_y of distortion_coefficients"));
    CHECK(test::contains(lens("0,0,0"), "camera.yml:6: distortion_coefficients: expected 4, 5, 8, 12 or 14"));
    CHECK(test::contains(lens("0,0,0,x"), "finite numbers in place of \"x\""));
    CHECK(test::contains(message(matrix("camera_matrix", "1,2,0,0,1,0,0,0,1")),
                         "camera_matrix[1] (camera.yml): got 2, expected 0"));
    CHECK(test::contains(message(matrix("camera_matrix", "-1,0,0,0,1,0,0,0,1")), "fx of camera_matrix"));
    CHECK(test::contains(message(matrix("camera_matrix", "1,0,0")), "expected 9 numbers, got 3"));
    CHECK(test::contains(message("camera_matrix: 3\n"), "camera.yml:1: camera_matrix: expected a matrix"));
    CHECK(test::contains(message(k_head), "camera.yml: no camera_matrix"));
    CHECK(test::contains(message(k_head + "nonsense\n"), "camera.yml:5: not YAML"));
    CHECK(test::contains(message("flags: 0\nflags: 1\n"), "camera.yml:2: \"flags\" twice"));
    CHECK(test::contains(message("<?xml version=\"1.0\"?>"), "XML or JSON, expected YAML"));
    CHECK(test::contains(message("distortion_model: omnidirectional\n" + k_matrix),
                         "got \"omnidirectional\", expected plumb_bob or equidistant"));
    CHECK(test::contains(message("image_width: 0\nimage_height: 5\n" + k_matrix), "got 0x5"));
    CHECK(message("image_width: 5\n" + k_matrix) ==
          "image_height (camera.yml): got none, expected one beside image_width");
    CHECK(message("image_height: 5\n" + k_matrix) ==
          "image_width (camera.yml): got none, expected one beside image_height");
    CHECK(test::contains(message("image_width: w\n" + k_matrix), "camera.yml:1: image_width"));
  }
}

}  // namespace opencv_camera_test
