// The dpr command: picks the command, and turns what goes wrong into one line and an exit status.
#include <algorithm>
#include <cstdio>
#include <string>

#include "cli/commands.hpp"
#include "dpr/error.hpp"

namespace {

// Exit statuses other than 0.
constexpr int k_wrong_input = 1;
constexpr int k_device_failed = 2;

int fail(std::string message, int status) {
  std::ranges::replace(message, '\n', ' ');
  std::fflush(stdout);
  std::fprintf(stderr, "dpr: error: %s\n", message.c_str());
  return status;
}

/// The command as it was typed, as far as it was understood: "dpr render".
std::string command_name(const CLI::App& application) {
  const auto chosen = application.get_subcommands();
  return chosen.empty() ? "dpr" : "dpr " + chosen.front()->get_name();
}

int fail_to_parse(const CLI::App& application, const CLI::ParseError& error) {
  // --help and --version arrive as errors too.
  if (error.get_exit_code() == 0) return application.exit(error);
  const std::string name = command_name(application);
  const auto unknown = application.remaining();
  const std::string problem =
      name == "dpr" && !unknown.empty() ? "no such command: " + unknown.front() : std::string(error.what());
  return fail(
      "arguments (" + name + "): got \"" + problem + "\", expected what \"" + name + " --help\" describes",
      k_wrong_input);
}

}  // namespace

int main(int argc, char** argv) {
  dpr::cli::CommonOptions common;
  CLI::App application("A differentiable perturbed renderer on OpenCL.", "dpr");
  application.set_version_flag("--version", std::string("dpr ") + DPR_VERSION);
  application.require_subcommand(1);
  application.footer("Every command explains itself: dpr COMMAND --help\nExample: dpr demo -o demo-output");
  dpr::cli::add_devices_command(application, common);
  dpr::cli::add_render_command(application, common);
  dpr::cli::add_gradient_command(application, common);
  dpr::cli::add_pose_command(application, common);
  dpr::cli::add_fit_command(application, common);
  dpr::cli::add_bench_command(application, common);
  dpr::cli::add_demo_command(application, common);
  try {
    application.parse(argc, argv);
    return 0;
  } catch (const CLI::ParseError& error) {
    return fail_to_parse(application, error);
  } catch (const dpr::BuildError& error) {
    const int status = fail(error.what(), k_device_failed);
    if (common.verbose) std::fprintf(stderr, "%s\n", error.log().c_str());
    return status;
  } catch (const dpr::DeviceError& error) {
    return fail(error.what(), k_device_failed);
  } catch (const std::exception& error) {
    return fail(error.what(), k_wrong_input);
  }
}
