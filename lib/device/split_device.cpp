// Parts of a device as devices of their own.
#include <algorithm>
#include <array>
#include <string>

#include "device/context.hpp"
#include "device/info.hpp"
#include "dpr/multi_device.hpp"

namespace dpr {

std::vector<Device> split_device(const Device& device, unsigned compute_units) {
  const DeviceInfo& info = device.info();
  if (compute_units < 1 || compute_units > info.compute_units) {
    throw InvalidArgument("compute_units (split_device)", std::to_string(compute_units),
                          "1 to " + std::to_string(info.compute_units) + ", the units of " + info.name);
  }
  const std::array<cl_device_partition_property, 3> properties{
      CL_DEVICE_PARTITION_EQUALLY, static_cast<cl_device_partition_property>(compute_units), 0};
  cl::Device whole = impl_of(device).device;
  const std::string call = "clCreateSubDevices of " + info.name;
  const auto offered = cl_info<CL_DEVICE_PARTITION_PROPERTIES>(whole, "clGetDeviceInfo");
  if (std::ranges::find(offered, properties[0]) == offered.end())
    throw DeviceError(CL_DEVICE_PARTITION_FAILED, call + ", which its driver does not divide");
  std::vector<cl::Device> parts;
  check_cl(whole.createSubDevices(properties.data(), &parts), call);

  std::vector<Device> devices;
  for (const cl::Device& part : parts) {
    int error = CL_SUCCESS;
    const cl::Context context(part, nullptr, nullptr, nullptr, &error);
    check_cl(error, "clCreateContext");
    const cl::CommandQueue queue(context, part, cl_command_queue_properties{0}, &error);
    check_cl(error, "clCreateCommandQueue");
    devices.push_back(make_device(part, context, queue));
    Device::Impl& impl = impl_of(devices.back());
    impl.info.index = info.index;
    impl.info.lanes = info.lanes;  // where the driver fails with more
    impl.group_size = impl_of(device).group_size;
  }
  return devices;
}

}  // namespace dpr
