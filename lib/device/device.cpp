// Listing, choosing and opening devices.
#include "dpr/device.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <optional>

#include "device/context.hpp"
#include "dpr/opencl.hpp"

namespace dpr {
namespace {

struct FoundDevice {
  cl::Device device;
  DeviceInfo info;
};

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::string type_name(cl_device_type type) {
  if (type & CL_DEVICE_TYPE_CPU) return "cpu";
  return type & CL_DEVICE_TYPE_GPU ? "gpu" : "accelerator";
}

/// Vectors as wide as the device's registers pay on CPUs; a GPU's lanes are its work-items.
unsigned choose_lanes(const DeviceInfo& info, const cl::Device& device) {
  if (info.type != "cpu") return 1;
  return device.getInfo<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>() >= 16 ? 16 : 8;
}

/// A CPU's memory is the whole machine's, and other programs' too.
std::size_t default_memory_budget(const DeviceInfo& info) {
  constexpr std::size_t k_most_of_cpu = std::size_t{1} << 30;
  return info.type == "cpu" ? std::min(info.memory_bytes / 8, k_most_of_cpu) : info.memory_bytes / 4;
}

std::vector<FoundDevice> find_devices() {
  std::vector<cl::Platform> platforms;
  const int error = cl::Platform::get(&platforms);
  if (error == CL_PLATFORM_NOT_FOUND_KHR) return {};
  check_cl(error, "clGetPlatformIDs");
  std::vector<FoundDevice> found;
  for (const cl::Platform& platform : platforms) {
    std::vector<cl::Device> devices;
    platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);  // a platform without devices is not an error
    for (const cl::Device& device : devices) {
      FoundDevice entry{device, describe(platform, device)};
      entry.info.index = found.size();
      found.push_back(std::move(entry));
    }
  }
  if (found.empty()) return found;
  const auto cpu = std::ranges::find(found, "cpu", [](const FoundDevice& entry) { return entry.info.type; });
  FoundDevice& preferred = cpu != found.end() ? *cpu : found.front();
  preferred.info.is_default = true;
  preferred.info.default_reason = cpu != found.end() ? "the first CPU: every machine has one"
                                                     : "the first device: there is no CPU";
  return found;
}

std::optional<std::size_t> parse_index(const std::string& text) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return index;
}

bool matches(const DeviceInfo& info, const std::string& selector) {
  if (selector.empty()) return info.is_default;
  if (selector == "cpu" || selector == "gpu") return info.type == selector;
  if (const auto index = parse_index(selector)) return info.index == *index;
  return lower(info.platform + " " + info.name).find(lower(selector)) != std::string::npos;
}

std::string names(const std::vector<FoundDevice>& found) {
  std::string list;
  for (const FoundDevice& entry : found) {
    list += (list.empty() ? "" : ", ") + std::to_string(entry.info.index) + " (" + entry.info.type + ", " +
            entry.info.name + ")";
  }
  return list;
}

}  // namespace

DeviceInfo describe(const cl::Platform& platform, const cl::Device& device) {
  DeviceInfo info;
  info.platform = platform.getInfo<CL_PLATFORM_NAME>();
  info.name = device.getInfo<CL_DEVICE_NAME>();
  info.vendor = device.getInfo<CL_DEVICE_VENDOR>();
  info.version = device.getInfo<CL_DEVICE_VERSION>();
  info.driver = device.getInfo<CL_DRIVER_VERSION>();
  info.type = type_name(device.getInfo<CL_DEVICE_TYPE>());
  info.compute_units = device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
  info.memory_bytes = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
  info.max_allocation_bytes = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
  info.lanes = choose_lanes(info, device);
  return info;
}

std::vector<DeviceInfo> list_devices() {
  std::vector<DeviceInfo> infos;
  for (FoundDevice& entry : find_devices()) infos.push_back(std::move(entry.info));
  return infos;
}

Device make_device(const cl::Device& device, const cl::Context& context, const cl::CommandQueue& queue) {
  auto impl = std::make_shared<Device::Impl>();
  impl->device = device;
  impl->context = context;
  impl->queue = queue;
  impl->info = describe(cl::Platform(device.getInfo<CL_DEVICE_PLATFORM>()), device);
  impl->memory_budget = default_memory_budget(impl->info);
  return Device(std::move(impl));
}

Device open_device(const std::string& selector) {
  const char* environment = std::getenv("DPR_DEVICE");
  const std::string wanted = selector.empty() && environment != nullptr ? environment : selector;
  const std::vector<FoundDevice> found = find_devices();
  if (found.empty())
    throw DeviceError(CL_DEVICE_NOT_FOUND, "looking for an OpenCL device: install pocl-opencl-icd");
  const auto chosen =
      std::ranges::find_if(found, [&](const FoundDevice& entry) { return matches(entry.info, wanted); });
  if (chosen == found.end()) throw InvalidArgument("device", "'" + wanted + "'", "one of " + names(found));

  int error = CL_SUCCESS;
  const cl::Context context(chosen->device, nullptr, nullptr, nullptr, &error);
  check_cl(error, "clCreateContext");
  const cl::CommandQueue queue(context, chosen->device, cl_command_queue_properties{0}, &error);
  check_cl(error, "clCreateCommandQueue");
  Device device = make_device(chosen->device, context, queue);
  device.impl().info = chosen->info;
  return device;
}

Device adopt_device(const cl::Context& context, const cl::CommandQueue& queue) {
  const cl::Device device = queue.getInfo<CL_QUEUE_DEVICE>();
  return make_device(device, context, queue);
}

const DeviceInfo& Device::info() const { return impl_->info; }
std::size_t Device::allocated_bytes() const { return impl_->allocated_bytes; }
std::size_t Device::peak_allocated_bytes() const { return impl_->peak_allocated_bytes; }
std::size_t Device::memory_budget() const { return impl_->memory_budget; }

void Device::set_memory_budget(std::size_t bytes) {
  if (bytes == 0) throw InvalidArgument("memory budget (device)", "0 bytes", "at least 1");
  impl_->memory_budget = bytes;
}

}  // namespace dpr
