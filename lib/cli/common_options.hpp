// The options that the commands share.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dpr/device.hpp"
#include "dpr/image.hpp"
#include "dpr/notes.hpp"
#include "dpr/scene.hpp"
#include "dpr/smoothing_options.hpp"

namespace dpr::cli {

struct CommonOptions {
  std::string device;
  std::optional<std::string> size;
  std::optional<std::uint64_t> seed;
  std::optional<std::size_t> memory_budget;  // MiB
  SmoothingOptions smoothing;
  bool verbose = false, quiet = false;
  bool linear = false;  ///< files of 8 and 16 bits hold linear colours

  Encoding encoding() const { return linear ? Encoding::linear : Encoding::srgb; }

  std::string command_line;  ///< as it was typed, for pages
};

/// The help group of the smoothing's flags.
inline constexpr const char* k_smoothing_group = "Smoothing (each replaces the scene's value)";
/// True if the command line gives any option of a help group.
bool gives_any(const CLI::App& command, const std::string& group);

/// --seed, as scene files take it: the command line's library would read -1 as 2^64 - 1.
CLI::Option* add_seed_option(CLI::App& command, const std::function<void(std::uint64_t)>& set,
                             const std::string& description);
/// --device and --memory-budget.
void add_device_options(CLI::App& command, CommonOptions& options);
/// Says in the command's help that --device may be a list.
void allow_several_devices(CLI::App& command);
/// --verbose and --quiet.
void add_output_options(CLI::App& command, CommonOptions& options);
/// Those, --size and --linear: of a command that brings its own smoothing and draws nothing at random.
void add_image_options(CLI::App& command, CommonOptions& options);
/// Those, and all that a command that renders understands.
void add_common_options(CLI::App& command, CommonOptions& options);

/// The device of --device. Says which one it is if asked to be verbose.
Device open_device(const CommonOptions& options);
/// The same where --device may be a list.
std::vector<Device> open_devices(const CommonOptions& options);
/// The smoothing flags and --seed.
SmoothingOptions smoothing_options(const CommonOptions& options);
/// Puts --size, --seed and the smoothing flags into a scene that no file describes: what they leave open is
/// the scene's. Throws InvalidArgument.
void apply(const CommonOptions& options, Scene& scene);
/// Prints what the program leaves out of a file, one line each on stderr; nothing with --quiet.
void print_notes(const Notes& notes, const CommonOptions& options);

/// The scene that the file describes, with these in the place of its values; and print_notes(). `picture`: size of
/// the picture that the scene is compared with (SceneOverrides::picture).
Scene read_scene(const std::string& file, const CommonOptions& options,
                 std::optional<glm::ivec2> picture = std::nullopt);

}  // namespace dpr::cli
