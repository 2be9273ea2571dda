// The parts of the scene format that other files share with it, and what a command line replaces of a scene.
#pragma once

#include <functional>
#include <optional>

#include "base/json_node.hpp"
#include "dpr/camera.hpp"
#include "dpr/notes.hpp"
#include "dpr/scene.hpp"
#include "dpr/smoothing_options.hpp"

namespace dpr {

/// The "camera" object of a scene. What is not given takes its default. Not validated.
Camera parse_camera(const JsonNode& node);

/// The "smoothing" object of a scene.
SmoothingOptions parse_smoothing(const JsonNode& node);

/// Values that replace those of a scene file.
struct SceneOverrides {
  std::optional<glm::ivec2> size;  ///< pixels
  SmoothingOptions smoothing;
  /// Size of the picture that the scene is compared with. A scene that gives neither width nor height has that size,
  /// and a larger scene of the same shape shrinks to that size.
  std::optional<glm::ivec2> picture = std::nullopt;
};

/// True if one size is the other scaled, up to a pixel of the smaller one and a hundredth.
bool have_same_shape(glm::ivec2 a, glm::ivec2 b);

/// Calls `check`. An InvalidArgument that it throws about a field, such as "znear (camera)", names the file and
/// the key in it instead. A field of the smoothing keeps its name where the overrides decide on it.
void with_keys_of(const std::filesystem::path& file, const SmoothingOptions& smoothing,
                  const SmoothingOptions& overrides, const std::function<void()>& check);

/// The same picture with other pixels: intrinsics, which are in pixels, follow.
void resize(Scene& scene, glm::ivec2 size);

/// Parses a scene file. Messages call it `file`, and the scene's meshes are looked for beside that path.
/// The smoothing is resolved with the overrides, for their size. Throws as read_scene() does.
Scene parse_scene(const std::filesystem::path& file, std::string_view text, Notes& notes,
                  const SceneOverrides& overrides = {});

}  // namespace dpr
