// Report of the pose solver: numbers, pictures and plots.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "cli/common_options.hpp"
#include "cli/json.hpp"
#include "cli/page.hpp"
#include "dpr/light.hpp"
#include "dpr/pose.hpp"
#include "solve/pose_body.hpp"
#include "solve/scene_light.hpp"

namespace dpr::cli {

/// As --light and pose.json have them, in the order of PoseLight.
std::span<const std::string_view> light_names();
std::string name_of(PoseLight light);
/// As pose.json has it; and what leaves little more than a target that is not explained.
std::string name_of(PoseDoubt doubt);
std::string doubt_text(const PoseResult& result);

/// A body of the scene, and what was found of its pose.
struct FoundBody {
  std::vector<std::size_t> meshes;
  PoseResult result;
};
/// ", meshes 1, 2", to tell one of several bodies from the others; empty for an only one.
std::string suffix_of(const FoundBody& body, std::size_t bodies);

/// A callback for the solver that shows how far it is; `iterations` of one descent or through all levels. `part`: what
/// PoseIteration::body counts, each fitted several times; empty: one fit.
PoseSolver::Callback progress_callback(unsigned iterations, bool quiet, const std::string& part = "");

/// A pose with its parts, as pose.json has it, of a body of the scene.
Json hypothesis_to_json(const PoseHypothesis& hypothesis, const Scene& scene, const PoseBody& body);
/// A list of rows.
Json covariance_to_json(const std::vector<double>& covariance);
/// pose.json, without the light that was found. With the true rotation, the angle errors too.
Json poses_to_json(const Scene& scene, std::span<const FoundBody> found,
                   const std::optional<glm::dmat3>& truth = {});

/// A light that was found along with a pose, by find_gain() or find_light(); neither: the scene's own.
struct FoundLight {
  std::optional<ColorGain> gain;
  std::optional<Lights> lights;
};
/// A picture, and how the solver compared poses with it.
struct PoseTarget {
  const Image& image;
  const LeastSquares& method;
};
/// One for all bodies.
FoundLight light_of(const Device& device, Scene scene, std::span<const FoundBody> found,
                    const PoseTarget& target);
/// Adds it to pose.json.
void add_light(Json& json, const FoundLight& light);

/// Writes target, start, end, difference, iterations and plot (all PNG), and index.html that shows them, into
/// a folder, which is made if need be. Start and end are rendered rigidly, the iterations as the solver saw
/// them, all in that light; poses that are equals, each in its own. Several bodies have iterations_0.png, plot_0.png
/// and so on, which show a body's way with the others where they were found. Throws IoError.
void write_pose_report(const std::filesystem::path& folder, const PageSource& source, const Device& device,
                       const Scene& scene, std::span<const FoundBody> found, const PoseTarget& target,
                       const FoundLight& light, bool quiet, const std::optional<glm::dmat3>& truth = {});

}  // namespace dpr::cli
