// The dpr command.

#include "cli/commands.hpp"
#include "dpr/version.hpp"

int main(int argc, char** argv) {
  dpr::cli::CommonOptions common;
  CLI::App application("A differentiable perturbed renderer on OpenCL.", "dpr");
  application.set_version_flag("--version", "dpr " DPR_VERSION);
  application.require_subcommand(1);
  application.footer("Every command explains itself: dpr COMMAND --help\nExample: dpr demo -o demo-output");
  dpr::cli::add_devices_command(application, common);
  dpr::cli::add_info_command(application, common);
  dpr::cli::add_render_command(application, common);
  dpr::cli::add_gradient_command(application, common);
  dpr::cli::add_pose_command(application, common);
  dpr::cli::add_track_command(application, common);
  dpr::cli::add_fit_command(application, common);
  dpr::cli::add_learn_command(application);
  dpr::cli::add_bench_command(application);
  dpr::cli::add_demo_command(application, common);
  dpr::cli::add_completion_command(application);
  return dpr::cli::run_application(application, common, argc, argv);
}
