#include "cli/provenance.hpp"

#include "device/kernel.hpp"

namespace dpr::cli {

const char* commit() { return DPR_COMMIT; }

Json provenance(const Device& device) {
  const DeviceInfo& info = device.info();
  return {{"commit", commit()},
          {"device",
           {{"platform", info.platform},
            {"name", info.name},
            {"type", info.type},
            {"version", info.version},
            {"driver", info.driver},
            {"compute_units", info.compute_units},
            {"lanes", info.lanes}}},
          {"build_options", build_options(impl_of(device))}};
}

PageSource page_source(const std::string& title, const CommonOptions& common,
                       std::span<const Device> devices) {
  std::string names;
  for (const Device& device : devices) {
    const DeviceInfo& info = device.info();
    names += (names.empty() ? "" : "; ") + info.name + " (" + info.platform + ", " + info.version + ")";
  }
  return {title, common.command_line, names};
}

}  // namespace dpr::cli
