// dpr pose in several pictures, which a views file names.
#pragma once

#include <string>
#include <vector>

#include "cli/common_options.hpp"
#include "dpr/pose_views.hpp"

namespace dpr::cli {

/// A scene and the pictures that show it.
struct SceneOfViews {
  Scene scene;  ///< of the views' size, and before their background where their file has one
  std::vector<PoseView> views;
};

/// Throws IoError and InvalidArgument in the words of the files.
SceneOfViews read_scene_of_views(const std::string& scene_file, const std::string& views_file,
                                 const CommonOptions& common);

/// What the options of dpr pose say of a fit in several pictures.
struct PoseViewsOptions {
  std::string views, output, report;
  std::vector<std::string> meshes;
  bool moving = false;
  PoseStart start = PoseStart::scene;
  PoseOptions solver;
};

/// Finds the poses, writes them and their reports, a folder for each picture, and says how well they explain the
/// pictures. Throws as the command does.
void find_poses_in_views(const PoseViewsOptions& options, const SceneOfViews& in,
                         const CommonOptions& common);

}  // namespace dpr::cli
