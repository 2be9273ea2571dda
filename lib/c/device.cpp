// Devices of the C interface.
#include "c/handles.hpp"
#include "dpr/opencl_handles.hpp"

using dpr::c::deref;
using dpr::c::give;
using dpr::c::guarded;

dpr_status dpr_device_open(const char* selector, dpr_device** device) {
  return guarded([&] {
    deref(device, "device");
    give(device, dpr::open_device(selector ? selector : ""));
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

void dpr_device_destroy(dpr_device* device) { dpr::c::destroy(device); }
