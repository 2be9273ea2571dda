// dpr devices: what there is to run on, and whether it computes right.
#include <CL/cl.h>

#include <cstdio>
#include <memory>
#include <optional>

#include "cli/commands.hpp"
#include "cli/device_check.hpp"
#include "cli/json.hpp"
#include "device/choose_device.hpp"
#include "device/pocl_cache.hpp"
#include "dpr/device.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

Json device_to_json(const DeviceInfo& info) {
  return {{"index", info.index},
          {"platform", info.platform},
          {"name", info.name},
          {"vendor", info.vendor},
          {"type", info.type},
          {"version", info.version},
          {"driver", info.driver},
          {"compute_units", info.compute_units},
          {"memory_bytes", info.memory_bytes},
          {"max_allocation_bytes", info.max_allocation_bytes},
          {"shares_host_memory", info.shares_host_memory},
          {"lanes", info.lanes},
          {"frame_milliseconds", info.frame_milliseconds},
          {"default", info.is_default},
          {"default_reason", info.default_reason}};
}

void print(const DeviceInfo& info) {
  constexpr double k_gibibyte = 1024.0 * 1024.0 * 1024.0;
  std::printf("%zu: %s\n", info.index, info.name.c_str());
  std::printf("   platform       %s\n", info.platform.c_str());
  std::printf("   type           %s\n", info.type.c_str());
  std::printf("   version        %s, driver %s\n", info.version.c_str(), info.driver.c_str());
  std::printf("   compute units  %u\n", info.compute_units);
  std::printf("   memory         %.1f GiB\n", static_cast<double>(info.memory_bytes) / k_gibibyte);
  std::printf("   lanes          %u\n", info.lanes);
  if (info.frame_milliseconds > 0) std::printf("   small frame    %.1f ms\n", info.frame_milliseconds);
  if (info.is_default) std::printf("   default        %s\n", info.default_reason.c_str());
}

struct DevicesOptions {
  bool as_json = false, checks = false;
  std::optional<std::size_t> rows_of;  // print_check_rows()
  std::optional<std::string> trial;    // run_trial()
};

/// All, or those that --device names.
std::vector<DeviceInfo> chosen_devices(const std::string& selectors) {
  const std::vector<DeviceInfo> devices = list_devices();
  if (selectors.empty()) return devices;
  std::vector<DeviceInfo> chosen;
  for (const DeviceChoice& choice : choose_devices(devices, selectors, "--device"))
    chosen.push_back(devices[choice.position]);
  return chosen;
}

/// Throws DeviceError where a device failed its test.
void require_passed(const std::string& failed) {
  if (!failed.empty())
    throw DeviceError(CL_INVALID_KERNEL, "the self-test, with results beyond their bounds on " + failed);
}

void run(const DevicesOptions& options, const std::string& selectors) {
  if (options.rows_of) return print_check_rows(*options.rows_of);
  if (options.trial) return run_trial(*options.trial);
  Json list = Json::array();
  std::string failed;
  const std::vector<DeviceInfo> devices = chosen_devices(selectors);
  for (const DeviceInfo& info : devices) {
    if (!options.as_json) print(info);
    list.push_back(device_to_json(info));
    if (!options.checks) continue;
    const DeviceCheck check = check_device(info, !options.as_json);
    if (check.failed > 0) failed += (failed.empty() ? "" : ", ") + info.name;
    list.back()["check"] = {{"comparisons", check.comparisons},
                            {"failed", check.failed},
                            {"seconds", check.seconds},
                            {"rows", check.rows}};
  }
  if (options.as_json) {
    std::printf("%s", to_text(list).c_str());
  } else if (devices.empty()) {
    const std::string failure = pocl_cache_failure();
    std::printf("No OpenCL device. On Debian, pocl-opencl-icd makes the CPU one.\n%s%s", failure.c_str(),
                failure.empty() ? "" : "\n");
  }
  require_passed(failed);
}

}  // namespace

void add_devices_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand(
      "devices", "Lists every OpenCL device, and which is the default; tests them");
  const auto options = std::make_shared<DevicesOptions>();
  command->add_flag("--json", options->as_json, "Print JSON");
  command->add_flag("--check", options->checks,
                    "Compare every stage with a reference in double precision, in some seconds a device");
  command->add_option("--check-rows", options->rows_of)->group("");  // for --check itself
  command->add_option("--trial", options->trial)->group("");         // for the library
  command->add_option("--device", common.device, "These alone, a list (default: all)")
      ->type_name("cpu|gpu|INDEX|SUBSTRING|LIST");
  add_output_options(*command, common);
  command->footer(
      "--check exits with status 2 where a difference is beyond its bound. The first time, the kernels are "
      "compiled too.\n"
      "Example: dpr devices --check --device gpu");
  command->callback([options, &common] { run(*options, common.device); });
}

}  // namespace dpr::cli
