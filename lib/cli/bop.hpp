// Images and poses of the BOP benchmark, in its scene-wise format (https://bop.felk.cvut.cz): an object's camera, start
// and reference, and rows of results.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <string>
#include <vector>

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

/// An object's entry in scene_gt.json.
struct BopInstance {
  std::size_t gt_id = 0;  ///< its place among the image's entries, from 0
  Pose pose;
};

/// What the files say. Lengths are millimetres. The world has the axes and the origin of OpenCV's camera, so that poses
/// are cam_R_m2c and cam_t_m2c.
struct BopImage {
  float depth_scale = 1;  ///< length of a 1 in the depth file
  Intrinsics intrinsics;
  std::vector<BopInstance> instances;  ///< of the object, in the file's order; none without scene_gt.json
};

/// The scene's folder, absolute and without a slash at the end.
std::filesystem::path bop_scene_folder(const std::string& folder);

/// The file of the image's colours or greys. Throws IoError where there is none.
std::string bop_picture(const BopOptions& options);

/// Throws IoError, and InvalidArgument with the place in the file. An image or object that is not there is an error.
BopImage read_bop_image(const BopOptions& options);

/// The object alone, in the first instance's pose if `starts_true`, or else upright in front of the camera.
Scene bop_scene(const BopOptions& options, const BopImage& image, glm::ivec2 size, bool starts_true,
                Notes& notes);

/// The instance whose origin is nearest to that of the pose; null where there is none.
const BopInstance* nearest_instance(const BopImage& image, const Pose& found);

/// Prints how far the pose is from the instance, the nearest.
void print_reference(const BopImage& image, const BopInstance& nearest, const Pose& found);

/// Number of the scene, which is the name of its folder. Throws InvalidArgument for another name.
std::uint64_t bop_scene_number(const std::string& folder);

/// Writes a row of results below BOP's head. The score is 1 where the pose explains the picture, or else 0.
void write_bop_result(const std::filesystem::path& file, const BopOptions& options, const PoseResult& result);

void add_bop_options(CLI::App& command, BopOptions& options);

}  // namespace dpr::cli
