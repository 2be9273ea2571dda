// Pose problems: an object, its true pose, and where the solver begins; from seeds or from files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dpr/image.hpp"
#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "dpr/scene.hpp"

namespace dpr::bench {

/// A family of problems. Together with a seed it says everything.
struct PoseProblemSet {
  std::string object = "cube";   ///< cube, published_cube, mailbox, bag, or a mesh file
  double initial_degrees = 50;   ///< angle between initial pose and truth; 0: the initial rotation is uniform
  double translation_error = 0;  ///< length of the initial pose's error, a part of the camera's distance
  double occluded = 0;           ///< part of the object hidden behind a patch, in [0, 1)
  bool clutter = false;          ///< random patches instead of the background
  std::uint64_t seed = 1;
};

struct PoseProblem {
  std::uint64_t seed = 0;  ///< of the target's occlusion and clutter
  Pose truth, initial;
};

/// The true rotations are uniform; so is the axis of what the initial pose is turned by. Bitwise the same
/// everywhere.
std::vector<PoseProblem> make_pose_problems(const PoseProblemSet& set, std::size_t count);

/// cube, published_cube, mailbox, bag, or a mesh file moved and scaled to reach as far as the cube. A mesh
/// without colours is coloured by position. Throws IoError where a mesh file cannot be read.
Mesh make_object(const std::string& object);

/// The scene of the paper's pose experiments (128x128, camera at distance 6.7, elevation 30, azimuth 120,
/// field of view 60, point light at (0, 2, -2), black background) with an object.
Scene pose_scene(const std::string& object);
inline constexpr double k_pose_camera_distance = 6.7;

/// Renders rigid images of one scene in any pose.
class RigidCamera {
 public:
  RigidCamera(const Device& device, Scene scene);
  Image render(const Pose& pose);

 private:
  Renderer renderer_;
  View view_;
};

/// The rigid image of the truth, with what the set says in front of it and behind it.
Image make_target(RigidCamera& camera, const PoseProblemSet& set, const PoseProblem& problem);

/// The part of the pixels whose colours differ by more than rounding to eight bits makes of it.
double differing_pixels(const Image& a, const Image& b);

/// {"set": {...}, "problems": [{"seed", "truth", "initial"}, ...]}, so that others can replay them. Throws
/// IoError.
void write_pose_problems(const std::filesystem::path& file, const PoseProblemSet& set,
                         const std::vector<PoseProblem>& problems);
std::vector<PoseProblem> read_pose_problems(const std::filesystem::path& file, PoseProblemSet& set);

nlohmann::ordered_json to_json(const PoseProblemSet& set);

}  // namespace dpr::bench
