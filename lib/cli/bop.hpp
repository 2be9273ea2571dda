// Images and poses of the BOP benchmark, in its scene-wise format (https://bop.felk.cvut.cz): an object's camera, start
// and reference, and rows of results.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <optional>
#include <string>

#include "dpr/camera.hpp"
#include "dpr/notes.hpp"
#include "dpr/pose.hpp"
#include "dpr/scene.hpp"

namespace dpr::cli {

/// Which object of which image.
struct BopOptions {
  std::string folder;  ///< of the scene, with scene_camera.json
  std::string
      models;  ///< folder of the models; empty: models in the data set's folder, two above the scene's
  std::uint64_t image = 0, object = 0;
};

/// What the files say. Lengths are millimetres. The world has the axes and the origin of OpenCV's camera, so that poses
/// are cam_R_m2c and cam_t_m2c.
struct BopImage {
  std::string picture;    ///< file of colours or greys
  float depth_scale = 1;  ///< length of a 1 in the depth file
  Intrinsics intrinsics;
  std::optional<Pose> truth;  ///< of the object's first instance in scene_gt.json; none without that file
};

/// Throws IoError, and InvalidArgument with the place in the file. An image or object that is not there is an error.
BopImage read_bop_image(const BopOptions& options);

/// The object alone, in the true pose if `starts_true`, or else upright in front of the camera.
Scene bop_scene(const BopOptions& options, const BopImage& image, glm::ivec2 size, bool starts_true,
                Notes& notes);

/// Number of the scene, which is the name of its folder. Throws InvalidArgument for another name.
std::uint64_t bop_scene_number(const std::string& folder);

/// Writes a row of results below BOP's head. The score is 1 where the pose explains the picture, or else 0.
void write_bop_result(const std::filesystem::path& file, const BopOptions& options, const PoseResult& result);

void add_bop_options(CLI::App& command, BopOptions& options);

}  // namespace dpr::cli
