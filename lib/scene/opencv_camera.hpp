// Cameras that OpenCV calibrated.
#pragma once

#include <filesystem>
#include <glm/glm.hpp>
#include <optional>
#include <string_view>

#include "dpr/camera.hpp"

namespace dpr {

/// A camera as cv::FileStorage writes it in YAML, under the names of OpenCV's calibration programs.
struct OpenCvCamera {
  Intrinsics intrinsics;                 ///< from the corner of the top-left pixel, as dpr counts
  std::optional<Distortion> distortion;  ///< none where all coefficients are 0, but of a fisheye
  std::optional<glm::ivec2> size;        ///< pixels of the images that the intrinsics hold for
};

/// Reads camera_matrix, distortion_coefficients, image_width and image_height, and which model the coefficients
/// belong to: fisheye_model, as OpenCV's programs write it, or ROS' distortion_model, "equidistant" for a fisheye.
/// Other keys are left alone. Throws IoError, with the line, where the file cannot be read or has no camera, and
/// InvalidArgument for a camera that a Camera cannot hold: skewed, of another model, or with coefficients beyond
/// k3 that are not 0.
OpenCvCamera read_opencv_camera(const std::filesystem::path& file);
/// The same of a text; messages call it `file`.
OpenCvCamera parse_opencv_camera(const std::filesystem::path& file, std::string_view text);

}  // namespace dpr
