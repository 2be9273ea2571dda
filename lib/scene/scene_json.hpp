// The parts of the scene format that other files share with it.
#pragma once

#include "base/json_node.hpp"
#include "dpr/camera.hpp"
#include "dpr/notes.hpp"
#include "dpr/smoothing.hpp"

namespace dpr {

/// The "camera" object of a scene. What is not given takes its default. Not validated.
Camera parse_camera(const JsonNode& node);

/// The "smoothing" object of a scene: the preset first, if there is one, for images of that size, then what
/// is given. Not validated.
Smoothing parse_smoothing(const JsonNode& node, int width = 128, int height = 128);

/// What a scene file holds; `file` is what messages call it, and beside it the scene's meshes are looked for.
/// Throws as read_scene() does.
Scene parse_scene(const std::filesystem::path& file, std::string_view text, Notes& notes);

}  // namespace dpr
