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
  std::optional<Distortion> distortion;  ///< none where all coefficients are 0
  std::optional<glm::ivec2> size;        ///< pixels of the images that the intrinsics hold for
};

/// Reads camera_matrix, distortion_coefficients, image_width and image_height; other keys are left alone. Throws
/// IoError, with the line, where the file cannot be read or has no camera, and InvalidArgument for a camera that a
/// Camera cannot hold: skewed, a fish-eye, or with coefficients beyond k3 that are not 0.
OpenCvCamera read_opencv_camera(const std::filesystem::path& file);
/// The same of a text; messages call it `file`.
OpenCvCamera parse_opencv_camera(const std::filesystem::path& file, std::string_view text);

}  // namespace dpr
