// The camera that took a picture: as OpenCV calibrated it, or as the picture's file says.
#pragma once

#include <glm/glm.hpp>
#include <string>

#include "dpr/notes.hpp"
#include "dpr/scene.hpp"

namespace dpr::cli {

/// Gives the scene's camera the intrinsics and the lens of a file of OpenCV's (scene/opencv_camera.hpp), which hold for
/// the size that the file gives, or else for the picture's. Throws IoError, and InvalidArgument where that size has
/// another shape than the scene's.
void take_opencv_camera(Scene& scene, const std::string& file, glm::ivec2 picture);

/// Gives the scene's camera the focal length of Exif in mm for a camera of 35-mm film; principal point and lens stay.
/// Throws InvalidArgument for 0, unknown, and for an orthographic camera.
void take_exif_focal(Scene& scene, float focal_35mm, const std::string& file, Notes& notes);

}  // namespace dpr::cli
