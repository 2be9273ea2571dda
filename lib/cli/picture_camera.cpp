#include "cli/picture_camera.hpp"

#include <cmath>

#include "base/checks.hpp"
#include "dpr/error.hpp"
#include "scene/opencv_camera.hpp"
#include "scene/scene_json.hpp"
#include "solve/resample.hpp"

namespace dpr::cli {

void take_opencv_camera(Scene& scene, const std::string& file, glm::ivec2 picture) {
  const OpenCvCamera found = read_opencv_camera(file);
  const glm::ivec2 from = found.size.value_or(picture), to(scene.width, scene.height);
  if (!have_same_shape(from, to)) {
    throw InvalidArgument("image_width and image_height (" + file + ")", checks::size(from.x, from.y),
                          "the shape of the scene's " + checks::size(to.x, to.y) +
                              ", which --size, or the picture of a scene without width and height, decides");
  }
  Camera& camera = scene.camera;
  if (camera.orthographic_height)
    throw InvalidArgument("--camera (command line)", "an orthographic scene", "a perspective one");
  camera.intrinsics = found.intrinsics;
  camera.distortion = found.distortion;
  camera = resample(camera, from.x, from.y, to.x, to.y);
}

void take_exif_focal(Scene& scene, float focal_35mm, const std::string& file, Notes& notes) {
  constexpr double k_film_diagonal = 43.2666;  // mm, of 36 by 24
  if (!(focal_35mm > 0)) {
    throw InvalidArgument("--exif-focal (command line)", file + " without Exif's FocalLengthIn35mmFilm",
                          "a camera's own file, or fov_y_degrees in the scene, or --focal");
  }
  Camera& camera = scene.camera;
  if (camera.orthographic_height)
    throw InvalidArgument("--exif-focal (command line)", "an orthographic scene", "a perspective one");
  const double wanted =
      static_cast<double>(focal_35mm) / k_film_diagonal * std::hypot(scene.width, scene.height);
  const float given = in_pixels(camera, scene.width, scene.height).intrinsics->fy;
  camera = zoomed(camera, wanted / static_cast<double>(given));
  notes.push_back(file + " has a focal length of " + checks::text(focal_35mm) +
                  " mm (35-mm film), which the camera takes");
}

}  // namespace dpr::cli
