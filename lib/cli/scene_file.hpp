// Scene files as the commands write them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/json.hpp"
#include "dpr/scene.hpp"

namespace dpr::cli {

/// The "camera" of scenes and views files.
Json camera_with_view(const Camera& camera);

/// A scene's file without its smoothing and gradients. `files` are the files of its meshes, in their order, as
/// the scene names them.
Json scene_without_smoothing(const Scene& scene, const std::vector<std::string>& files);

/// Writes a scene from which read_scene() makes the same, but for the gradients. `files` are relative to the
/// working directory; the scene names them relative to itself. Throws IoError.
void write_scene(const std::filesystem::path& file, const Scene& scene, std::vector<std::string> files);

}  // namespace dpr::cli
