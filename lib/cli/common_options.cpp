// The options that the commands share, and how they change a scene.
#include "cli/common_options.hpp"

#include <algorithm>
#include <cstdio>

#include "base/input_file.hpp"
#include "cli/text.hpp"
#include "dpr/error.hpp"
#include "dpr/multi_device.hpp"
#include "scene/scene_json.hpp"
#include "smoothing/choice_names.hpp"
#include "smoothing/option_fields.hpp"

namespace dpr::cli {
namespace {

/// An option whose value is a word of the library's.
template <typename Value, typename Parse>
CLI::Option* add_word(CLI::App& command, const std::string& flag, std::optional<Value>& option, Parse parse) {
  return command.add_option_function<std::string>(
      flag, [&option, parse, flag](const std::string& word) { option = parse(word, flag); });
}

template <SmoothingChoice Choice>
CLI::Option* add_option(CLI::App& command, const std::string& flag, std::optional<Choice>& option) {
  return add_word(command, flag, option, parse_choice<Choice>);
}

CLI::Option* add_option(CLI::App& command, const std::string& flag, std::optional<std::string>& preset) {
  return add_word(command, flag, preset, [](const std::string& word, const std::string& where) {
    require_preset(word, where);
    return word;
  });
}

template <typename Number>
CLI::Option* add_option(CLI::App& command, const std::string& flag, std::optional<Number>& option) {
  return command.add_option(flag, option);
}

void add_smoothing_options(CLI::App& command, SmoothingOptions& options) {
  for_each_option([&](std::string_view key, const char* description, auto member) {
    if (key == "seed") return;  // of everything random, not of the smoothing alone: an option of its own
    std::string flag = "--" + std::string(key);
    std::ranges::replace(flag, '_', '-');
    auto& option = options.*member;
    add_option(command, flag, option)
        ->description(description)
        ->group(k_smoothing_group)
        ->type_name(option_type(option));
  });
}

}  // namespace

bool gives_any(const CLI::App& command, const std::string& group) {
  return std::ranges::any_of(command.get_options(), [&](const CLI::Option* option) {
    return option->get_group() == group && option->count() > 0;
  });
}

CLI::Option* add_seed_option(CLI::App& command, const std::function<void(std::uint64_t)>& set,
                             const std::string& description) {
  const auto read = [set](const std::string& text) {
    set(parse_whole_number(text, "--seed (command line)"));
  };
  return command.add_option_function<std::string>("--seed", read, description)->type_name("N");
}

void add_output_options(CLI::App& command, CommonOptions& options) {
  auto* quiet = command.add_flag("--quiet", options.quiet, "Print errors only");
  command.add_flag("--verbose", options.verbose, "Print details; build logs in case of errors")
      ->excludes(quiet);
}

void add_device_options(CLI::App& command, CommonOptions& options) {
  command
      .add_option("--device", options.device,
                  "OpenCL device (default: DPR_DEVICE, else a GPU, else an accelerator, else a CPU)")
      ->type_name("cpu|gpu|INDEX|SUBSTRING");
  command
      .add_option("--memory-budget", options.memory_budget,
                  "Device memory for fragments and samples; larger frames are rendered in bands "
                  "(default: a quarter; of a CPU's an eighth, at most 1024)")
      ->check(CLI::Range(1, 1 << 30))
      ->type_name("MiB");
}

void allow_several_devices(CLI::App& command) {
  command.get_option("--device")
      ->type_name("cpu|gpu|INDEX|SUBSTRING|LIST")
      ->description(
          "List of OpenCL devices: each takes a part of every batch. DEVICE/N: N equal parts of a device "
          "(default: DPR_DEVICE, else one GPU, else an accelerator, else a CPU)");
}

void add_image_options(CLI::App& command, CommonOptions& options) {
  add_output_options(command, options);
  add_device_options(command, options);
  command.add_option("--size", options.size, "Size of the image in pixels")->type_name("WxH");
  command.add_flag("--linear", options.linear, "Files of 8 and 16 bits hold linear colours instead of sRGB");
}

void add_common_options(CLI::App& command, CommonOptions& options) {
  add_image_options(command, options);
  add_seed_option(
      command, [&](std::uint64_t seed) { options.seed = seed; }, "Seed of everything random");
  add_smoothing_options(command, options.smoothing);
}

namespace {

/// Applies the options to an opened device.
void set_up(Device& device, const CommonOptions& options) {
  constexpr std::size_t k_mebibyte = 1024 * 1024;
  print_notes(device.info().passed_over, options);
  if (options.memory_budget) device.set_memory_budget(*options.memory_budget * k_mebibyte);
  if (options.verbose) {
    const DeviceInfo& info = device.info();
    std::printf("device %zu: %s, %s, %u compute units, %u lanes\n", info.index, info.platform.c_str(),
                info.name.c_str(), info.compute_units, info.lanes);
  }
}

}  // namespace

Device open_device(const CommonOptions& options) {
  Device device = dpr::open_device(options.device);
  set_up(device, options);
  return device;
}

std::vector<Device> open_devices(const CommonOptions& options) {
  std::vector<Device> devices = dpr::open_devices(options.device);
  for (Device& device : devices) set_up(device, options);
  return devices;
}

SmoothingOptions smoothing_options(const CommonOptions& options) {
  SmoothingOptions smoothing = options.smoothing;
  if (options.seed) smoothing.seed = options.seed;
  return smoothing;
}

void apply(const CommonOptions& options, Scene& scene) {
  if (options.size) resize(scene, parse_size(*options.size));
  scene.smoothing = resolve_smoothing(smoothing_options(options), scene.width, scene.height, scene.smoothing);
}

void print_notes(const Notes& notes, const CommonOptions& options) {
  if (options.quiet) return;
  for (const std::string& note : notes) std::fprintf(stderr, "dpr: note: %s\n", note.c_str());
}

Scene read_scene(const std::string& file, const CommonOptions& options, std::optional<glm::ivec2> picture) {
  SceneOverrides overrides{.size = {}, .smoothing = smoothing_options(options), .picture = picture};
  if (options.size) overrides.size = parse_size(*options.size);
  Notes notes;
  Scene scene = parse_scene(file, read_file(file), notes, overrides);
  print_notes(notes, options);
  return scene;
}

}  // namespace dpr::cli
