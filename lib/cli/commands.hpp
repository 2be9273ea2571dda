// The commands: each adds itself to the application and runs when it was chosen.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/common_options.hpp"

namespace dpr::cli {

void add_devices_command(CLI::App& application, CommonOptions& common);
/// Describes a file's content; opens no device.
void add_info_command(CLI::App& application, CommonOptions& common);
void add_render_command(CLI::App& application, CommonOptions& common);
void add_gradient_command(CLI::App& application, CommonOptions& common);
void add_pose_command(CLI::App& application, CommonOptions& common);
void add_track_command(CLI::App& application, CommonOptions& common);
void add_fit_command(CLI::App& application, CommonOptions& common);
/// These hand over to the programs dpr-learn and dpr-bench beside this one.
void add_learn_command(CLI::App& application);
void add_bench_command(CLI::App& application);
/// Flushes what was printed, then has each of these programs that is installed print its
/// completion_entries().
void print_entries_of_programs();
void add_demo_command(CLI::App& application, CommonOptions& common);
void add_completion_command(CLI::App& application);

/// Renders a small frame and its gradients on the device of that name (device/trial.hpp). Prints every
/// program and kernel before it is built or run, and then how long such a frame takes. Throws InvalidArgument
/// for a name that no device has: another version's command.
void run_trial(const std::string& name);

/// Parses the arguments, which runs the command they choose. What goes wrong becomes one line on stderr and
/// the exit status: 1 for wrong input or an output that cannot be written, 2 if the device failed.
int run_application(CLI::App& application, CommonOptions& common, int argc, char** argv);

}  // namespace dpr::cli
