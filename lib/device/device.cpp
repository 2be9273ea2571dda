// Listing, choosing and opening devices.
#include "dpr/device.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <optional>

#include "device/context.hpp"
#include "device/info.hpp"
#include "dpr/opencl.hpp"

namespace dpr {
namespace {

struct FoundDevice {
  cl::Device device;
  DeviceInfo info;
};

struct FoundDevices {
  std::vector<FoundDevice> devices;
  std::optional<DeviceError> failure;  ///< the first of a platform or device that does not answer
};

template <auto property>
auto device_info(const cl::Device& device) {
  return cl_info<property>(device, "clGetDeviceInfo");
}

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
  return device_info<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>(device) >= 16 ? 16 : 8;
}

/// A CPU's memory is the whole machine's, and other programs' too.
std::size_t default_memory_budget(const DeviceInfo& info) {
  constexpr std::size_t k_most_of_cpu = std::size_t{1} << 30;
  return info.type == "cpu" ? std::min(info.memory_bytes / 8, k_most_of_cpu) : info.memory_bytes / 4;
}

std::vector<cl::Device> devices_of(const cl::Platform& platform) {
  std::vector<cl::Device> devices;
  const int error = platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
  if (error != CL_DEVICE_NOT_FOUND) check_cl(error, "clGetDeviceIDs");
  return devices;
}

void mark_default(std::vector<FoundDevice>& found) {
  const auto cpu = std::ranges::find(found, "cpu", [](const FoundDevice& entry) { return entry.info.type; });
  FoundDevice& preferred = cpu != found.end() ? *cpu : found.front();
  preferred.info.is_default = true;
  preferred.info.default_reason = cpu != found.end() ? "the first CPU: every machine has one"
                                                     : "the first device: there is no CPU";
}

/// A platform or device that does not answer is passed over: the others can be used.
FoundDevices find_devices() {
  FoundDevices found;
  std::vector<cl::Platform> platforms;
  const int error = cl::Platform::get(&platforms);
  if (error == CL_PLATFORM_NOT_FOUND_KHR) return found;
  check_cl(error, "clGetPlatformIDs");
  const auto ask = [&](const auto& question) {
    try {
      question();
    } catch (const DeviceError& failure) {
      if (!found.failure) found.failure = failure;
    }
  };
  for (const cl::Platform& platform : platforms) {
    std::vector<cl::Device> devices;
    ask([&] { devices = devices_of(platform); });
    for (const cl::Device& device : devices) {
      ask([&] {
        FoundDevice entry{device, describe(platform, device)};
        entry.info.index = found.devices.size();
        found.devices.push_back(std::move(entry));
      });
    }
  }
  if (!found.devices.empty()) mark_default(found.devices);
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
  info.platform = cl_info<CL_PLATFORM_NAME>(platform, "clGetPlatformInfo");
  info.name = device_info<CL_DEVICE_NAME>(device);
  info.vendor = device_info<CL_DEVICE_VENDOR>(device);
  info.version = device_info<CL_DEVICE_VERSION>(device);
  info.driver = device_info<CL_DRIVER_VERSION>(device);
  info.type = type_name(device_info<CL_DEVICE_TYPE>(device));
  info.compute_units = device_info<CL_DEVICE_MAX_COMPUTE_UNITS>(device);
  info.memory_bytes = device_info<CL_DEVICE_GLOBAL_MEM_SIZE>(device);
  info.max_allocation_bytes = device_info<CL_DEVICE_MAX_MEM_ALLOC_SIZE>(device);
  info.lanes = choose_lanes(info, device);
  return info;
}

std::vector<DeviceInfo> list_devices() {
  FoundDevices found = find_devices();
  if (found.devices.empty() && found.failure) throw DeviceError(*found.failure);
  std::vector<DeviceInfo> infos;
  for (FoundDevice& entry : found.devices) infos.push_back(std::move(entry.info));
  return infos;
}

Device make_device(const cl::Device& device, const cl::Context& context, const cl::CommandQueue& queue) {
  auto impl = std::make_shared<Device::Impl>();
  impl->device = device;
  impl->context = context;
  impl->queue = queue;
  impl->info = describe(cl::Platform(device_info<CL_DEVICE_PLATFORM>(device)), device);
  impl->memory_budget = default_memory_budget(impl->info);
  return Device(std::move(impl));
}

Device open_device(const std::string& selector) {
  const char* environment = std::getenv("DPR_DEVICE");
  const std::string wanted = selector.empty() && environment != nullptr ? environment : selector;
  const auto [found, failure] = find_devices();
  const auto chosen =
      std::ranges::find_if(found, [&](const FoundDevice& entry) { return matches(entry.info, wanted); });
  // What does not answer may be what is asked for; and no GPU takes the place of a default CPU in silence.
  const bool is_certain = chosen != found.end() && (!wanted.empty() || chosen->info.type == "cpu");
  if (failure && !is_certain) throw DeviceError(*failure);
  if (found.empty())
    throw DeviceError(CL_DEVICE_NOT_FOUND, "looking for an OpenCL device: install pocl-opencl-icd");
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
  const auto device = cl_info<CL_QUEUE_DEVICE>(queue, "clGetCommandQueueInfo");
  if (cl_info<CL_QUEUE_CONTEXT>(queue, "clGetCommandQueueInfo")() != context()) {
    throw InvalidArgument("queue (adopt_device)", "a queue of another context", "one of the context");
  }
  const auto properties = cl_info<CL_QUEUE_PROPERTIES>(queue, "clGetCommandQueueInfo");
  if ((properties & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE) != 0) {
    throw InvalidArgument("queue (adopt_device)", "an out-of-order queue", "an in-order one");
  }
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
