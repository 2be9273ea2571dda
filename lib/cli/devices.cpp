// dpr devices: what there is to run on.
#include <cstdio>
#include <memory>

#include "cli/commands.hpp"
#include "cli/json.hpp"
#include "dpr/device.hpp"

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
  if (info.is_default) std::printf("   default        %s\n", info.default_reason.c_str());
}

void run(bool as_json) {
  const std::vector<DeviceInfo> devices = list_devices();
  if (as_json) {
    Json list = Json::array();
    for (const DeviceInfo& info : devices) list.push_back(device_to_json(info));
    std::printf("%s", to_text(list).c_str());
    return;
  }
  for (const DeviceInfo& info : devices) print(info);
  if (devices.empty()) std::printf("No OpenCL device. On Debian, pocl-opencl-icd makes the CPU one.\n");
}

}  // namespace

void add_devices_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command =
      application.add_subcommand("devices", "Lists every OpenCL device, and which is the default");
  const auto as_json = std::make_shared<bool>(false);
  command->add_flag("--json", *as_json, "Print JSON");
  add_output_options(*command, common);
  command->footer("Example: dpr devices --json");
  command->callback([as_json] { run(*as_json); });
}

}  // namespace dpr::cli
