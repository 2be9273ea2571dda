// Devices of the C interface.
#include "c/handles.hpp"
#include "dpr/opencl_handles.hpp"

using namespace dpr::c;

dpr_status dpr_device_open(const char* selector, dpr_device** device) {
  return guarded([&] {
    deref(device, "device");
    give(device, dpr::open_device(selector ? selector : ""));
  });
}

dpr_status dpr_device_count(std::size_t* count) {
  return guarded([&] { deref(count, "count") = dpr::list_devices().size(); });
}

dpr_status dpr_device_describe(std::size_t index, dpr_device_info* info) {
  return guarded([&] {
    std::vector<dpr::DeviceInfo> devices = dpr::list_devices();
    if (index >= devices.size())
      throw dpr::InvalidArgument("index", std::to_string(index), "below " + std::to_string(devices.size()));
    thread_local dpr::DeviceInfo kept;
    kept = std::move(devices[index]);
    dpr_device_info found{};
    found.platform = kept.platform.c_str();
    found.name = kept.name.c_str();
    found.vendor = kept.vendor.c_str();
    found.version = kept.version.c_str();
    found.driver = kept.driver.c_str();
    found.type = kept.type.c_str();
    found.memory_bytes = kept.memory_bytes;
    found.compute_units = kept.compute_units;
    found.lanes = kept.lanes;
    found.is_default = kept.is_default ? 1 : 0;
    fill(info, found, "info");
  });
}

dpr_status dpr_device_adopt(struct _cl_context* context, struct _cl_command_queue* queue,
                            dpr_device** device) {
  return guarded([&] {
    deref(context, "context");
    deref(queue, "queue");
    deref(device, "device");
    give(device, dpr::adopt_device(context, queue));
  });
}

dpr_status dpr_device_name(const dpr_device* device, const char** name) {
  return guarded([&] { deref(name, "name") = deref(device, "device").device.info().name.c_str(); });
}

void dpr_device_destroy(dpr_device* device) { destroy(device); }
