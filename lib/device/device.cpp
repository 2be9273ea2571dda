// Listing, choosing and opening devices.
#include "dpr/device.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <optional>
#include <span>

#include "device/choose_device.hpp"
#include "device/context.hpp"
#include "device/info.hpp"
#include "device/kernel.hpp"
#include "device/pocl_cache.hpp"
#include "device/trial.hpp"
#include "dpr/multi_device.hpp"
#include "dpr/opencl_handles.hpp"
#include "kernels/scan.hpp"

namespace dpr {
namespace {

constexpr const char* k_pocl = "Portable Computing Language";

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

std::string type_name(cl_device_type type) {
  if (type & CL_DEVICE_TYPE_CPU) return "cpu";
  return type & CL_DEVICE_TYPE_GPU ? "gpu" : "accelerator";
}

/// The widths that kernels are written and tested for.
constexpr std::array k_lanes{1U, 8U, 16U};

/// Vector width that DPR_LANES asks for in place of the device's own: for tests and measurements.
std::optional<unsigned> lanes_of_environment() {
  const char* const text = std::getenv("DPR_LANES");
  if (text == nullptr) return std::nullopt;
  const auto wanted =
      std::ranges::find_if(k_lanes, [&](unsigned lanes) { return std::to_string(lanes) == text; });
  if (wanted == k_lanes.end())
    throw InvalidArgument("DPR_LANES (environment)", "'" + std::string(text) + "'", "1, 8 or 16");
  return *wanted;
}

/// The lanes to use, the best first.
std::vector<unsigned> lanes_to_try(unsigned best) {
  std::vector<unsigned> list{best};
  if (lanes_of_environment()) return list;
  for (const unsigned lanes : {8U, 1U}) {
    if (lanes < best) list.push_back(lanes);
  }
  return list;
}

/// Vectors as wide as the device's registers pay on CPUs; a GPU's lanes are its work-items.
unsigned choose_lanes(const DeviceInfo& info, const cl::Device& device) {
  if (const auto lanes = lanes_of_environment()) return *lanes;
  if (info.type != "cpu") return 1;
  return device_info<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>(device) >= 16 ? 16 : 8;
}

/// The memory of a CPU, or of a GPU that shares it, is the whole machine's, and other programs' too.
std::size_t default_memory_budget(const DeviceInfo& info) {
  constexpr std::size_t k_most_of_cpu = std::size_t{1} << 30;
  if (info.type == "cpu") return std::min(info.memory_bytes / 8, k_most_of_cpu);
  return info.memory_bytes / (info.shares_host_memory ? 8 : 4);
}

std::vector<cl::Device> devices_of(const cl::Platform& platform) {
  std::vector<cl::Device> devices;
  const int error = platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
  if (error != CL_DEVICE_NOT_FOUND) check_cl(error, "clGetDeviceIDs");
  return devices;
}

std::vector<DeviceInfo> infos_of(const std::vector<FoundDevice>& found) {
  std::vector<DeviceInfo> infos;
  for (const FoundDevice& entry : found) infos.push_back(entry.info);
  return infos;
}

void mark_default(std::vector<FoundDevice>& found) {
  const std::vector<DeviceInfo> infos = infos_of(found);
  DeviceInfo& best = found[by_preference(infos).front()].info;
  best.is_default = true;
  best.default_reason = reason_of_preference(best, infos);
}

/// Embedded devices may lack what every other one has.
void require_abilities(const DeviceInfo& info, const cl::Device& device) {
  constexpr std::size_t k_local_bytes = 24 << 10;  // sort_scatter's, the most of all kernels
  constexpr cl_device_fp_config k_rounding = CL_FP_ROUND_TO_NEAREST | CL_FP_INF_NAN;  // exact predicates
  const std::size_t local_bytes = device_info<CL_DEVICE_LOCAL_MEM_SIZE>(device);
  std::string lacking;
  if (local_bytes < k_local_bytes)
    lacking = "whose work-groups have " + std::to_string(local_bytes) + " bytes of memory: dpr needs " +
              std::to_string(k_local_bytes);
  if ((device_info<CL_DEVICE_SINGLE_FP_CONFIG>(device) & k_rounding) != k_rounding)
    lacking = "which does not round to the nearest number, or has no infinity";
  if (!lacking.empty()) throw DeviceError(CL_DEVICE_NOT_AVAILABLE, info.name + ", " + lacking);
}

/// Kernels with barriers run in groups of DPR_GROUP, or of what the device allows. Throws DeviceError for a
/// device on which they cannot run.
unsigned choose_group(const DeviceInfo& info, const cl::Device& device) {
  require_abilities(info, device);
  if (info.lanes > 1) return DPR_GROUP;  // there a work-item works alone
  const std::size_t most = device_info<CL_DEVICE_MAX_WORK_GROUP_SIZE>(device);
  if (most < DPR_LEAST_GROUP) {
    throw DeviceError(CL_INVALID_WORK_GROUP_SIZE, info.name + ", whose work-groups have at most " +
                                                      std::to_string(most) + " work-items: dpr needs " +
                                                      std::to_string(DPR_LEAST_GROUP));
  }
  return static_cast<unsigned>(std::bit_floor(std::min<std::size_t>(most, DPR_GROUP)));
}

/// A platform or device that does not answer is passed over: the others can be used.
FoundDevices find_devices() {
  FoundDevices found;
  std::vector<cl::Platform> platforms;
  const int error = on_own_thread([&] { return cl::Platform::get(&platforms); });
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
    ask([&] { devices = on_own_thread([&] { return devices_of(platform); }); });
    for (const cl::Device& device : devices) {
      ask([&] {
        FoundDevice entry{device, describe(platform, device)};
        entry.info.index = found.devices.size();
        found.devices.push_back(std::move(entry));
      });
    }
  }
  const Store store;
  for (FoundDevice& entry : found.devices) {
    if (const auto trial = remembered_trial(entry.info, store))
      entry.info.frame_milliseconds = trial->milliseconds;
  }
  if (!found.devices.empty()) mark_default(found.devices);
  return found;
}

/// Hint for a machine without devices: PoCL may be installed and offer none.
std::string hint() {
  const std::string failure = pocl_cache_failure();
  return failure.empty() ? "" : "; or if it is installed: " + failure;
}

/// The caller's word, or else the environment's, and what messages call it.
struct Wanted {
  explicit Wanted(const std::string& selector) : text(selector) {
    const char* const environment = std::getenv("DPR_DEVICE");
    if (!selector.empty() || environment == nullptr) return;
    text = environment;
    where = "DPR_DEVICE (environment)";
  }

  std::string text, where = "device";
};

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
  info.shares_host_memory = device_info<CL_DEVICE_HOST_UNIFIED_MEMORY>(device) != CL_FALSE;
  info.lanes = choose_lanes(info, device);
  return info;
}

std::vector<DeviceInfo> list_devices() {
  FoundDevices found = find_devices();
  if (found.devices.empty() && found.failure) throw DeviceError(*found.failure);
  return infos_of(found.devices);
}

Device make_device(const cl::Device& device, const cl::Context& context, const cl::CommandQueue& queue) {
  auto impl = std::make_shared<Device::Impl>();
  impl->device = device;
  impl->context = context;
  impl->queue = queue;
  impl->info = describe(cl::Platform(device_info<CL_DEVICE_PLATFORM>(device)), device);
  impl->group_size = choose_group(impl->info, device);
  // PoCL keeps what it compiles itself, and for a binary compiles every kernel for groups of any size: 48 s
  // for the kernels of a frame. oclgrind compiles nothing.
  impl->keeps_binaries = impl->info.platform != k_pocl && impl->info.platform != "Oclgrind";
  impl->memory_budget = default_memory_budget(impl->info);
  return Device(std::move(impl));
}

namespace {

/// In order.
cl::CommandQueue make_queue(const cl::Context& context, const cl::Device& device) {
  int error = CL_SUCCESS;
  cl::CommandQueue queue(context, device, cl_command_queue_properties{0}, &error);
  check_cl(error, "clCreateCommandQueue");
  return queue;
}

/// Opens a device in the widest lanes in which its driver does not fail, as far as that is known.
Device open_found(const FoundDevice& found) {
  DeviceInfo info = found.info;
  if (info.platform == k_pocl) {
    if (const std::string failure = pocl_cache_failure(); !failure.empty())
      throw DeviceError(CL_DEVICE_NOT_AVAILABLE, failure);
  }
  const Store store;
  for (const unsigned lanes : lanes_to_try(info.lanes)) {
    info.lanes = lanes;
    const auto trial = try_device(info, store);
    if (trial && !trial->failure.empty()) {
      info.passed_over.push_back(trial->failure);
      continue;
    }
    int error = CL_SUCCESS;
    const cl::Context context(found.device, nullptr, nullptr, nullptr, &error);
    check_cl(error, "clCreateContext");
    Device device = make_device(found.device, context, make_queue(context, found.device));
    if (trial) info.frame_milliseconds = trial->milliseconds;
    impl_of(device).info = info;
    impl_of(device).group_size = choose_group(info, found.device);
    return device;
  }
  std::string failures;
  for (const std::string& failure : info.passed_over) failures += (failures.empty() ? "" : "; ") + failure;
  throw BuildError(std::string(k_frame_file), info.platform + ", driver " + info.driver,
                   "-DDPR_LANES=" + std::to_string(info.lanes), failures);
}

/// Builds and runs a small kernel. Throws DeviceError or BuildError where that fails, or gives what is wrong.
void try_out(const Device& device) {
  constexpr std::array<cl_uint, 4> k_values{1, 20, 300, 4000};
  constexpr std::array<cl_uint, 1> k_count{k_values.size()};
  Launcher<kernel::scan_sum> launch(impl_of(device));
  const Buffer<cl_uint> values(impl_of(device), std::span<const cl_uint>(k_values)),
      count(impl_of(device), std::span<const cl_uint>(k_count));
  Buffer<cl_uint> sums(impl_of(device), 1);
  launch.in_groups(1,
                   kernel::scan_sum{.count = k_count[0], .present = count, .values = values, .sums = sums});
  if (sums.download()[0] != 4321)
    throw DeviceError(CL_INVALID_KERNEL, "a first kernel, which gives a wrong sum");
}

/// The devices, and how fast those are that are preferred to the others alike, where there are several.
std::vector<DeviceInfo> measured(std::vector<DeviceInfo> infos) {
  const std::vector<std::size_t> equals = best_equals(infos);
  if (equals.size() < 2) return infos;
  const Store store;
  for (const std::size_t position : equals) {
    if (const auto trial = try_device(infos[position], store))
      infos[position].frame_milliseconds = trial->milliseconds;
  }
  return infos;
}

}  // namespace

Device open_device(const std::string& selector) {
  const auto [wanted, where] = Wanted(selector);
  const auto [found, failure] = find_devices();
  if (wanted.empty() && !found.empty()) {
    const std::vector<DeviceInfo> infos = measured(infos_of(found));
    Device device = open_best(infos, [&entries = found](std::size_t position, bool is_tried) {
      Device candidate = open_found(entries[position]);
      if (is_tried) try_out(candidate);
      return candidate;
    });
    if (failure)
      impl_of(device).info.passed_over.push_back(std::string("a device does not answer: ") + failure->what());
    return device;
  }
  const auto chosen = std::ranges::find_if(
      found, [&name = wanted](const FoundDevice& entry) { return matches(entry.info, name); });
  if (chosen != found.end()) return open_found(*chosen);
  if (failure) throw DeviceError(*failure);  // what does not answer may be what is asked for
  if (found.empty())
    throw DeviceError(CL_DEVICE_NOT_FOUND, "looking for an OpenCL device: install pocl-opencl-icd" + hint());
  const std::vector<DeviceInfo> infos = infos_of(found);
  const bool is_list = names_several(infos, wanted);
  throw InvalidArgument(
      where, "'" + wanted + "'",
      (is_list ? "one device, not a list of them or parts: " : "one that is there: ") + device_names(infos));
}

std::vector<Device> open_devices(const std::string& selectors) {
  const auto [wanted, where] = Wanted(selectors);
  const auto [found, failure] = find_devices();
  const std::vector<DeviceInfo> infos = infos_of(found);
  if (infos.empty() || !names_several(infos, wanted)) return {open_device(selectors)};
  std::vector<DeviceChoice> choices;
  try {
    choices = choose_devices(infos, wanted, where);
  } catch (const InvalidArgument&) {
    if (failure) throw DeviceError(*failure);  // what does not answer may be what is asked for
    throw;
  }
  std::vector<Device> devices;
  for (const auto& [position, parts] : choices) {
    const Device whole = open_found(found[position]);
    if (parts == 1) {
      devices.push_back(whole);
      continue;
    }
    const std::vector<Device> equal = split_device(whole, whole.info().compute_units / parts);
    devices.insert(devices.end(), equal.begin(), equal.begin() + parts);
  }
  return devices;
}

Device adopt_device(cl_context context_handle, cl_command_queue queue_handle) {
  const cl::Context context(context_handle, true);
  const cl::CommandQueue queue(queue_handle, true);
  const auto device = cl_info<CL_QUEUE_DEVICE>(queue, "clGetCommandQueueInfo");
  if (cl_info<CL_QUEUE_CONTEXT>(queue, "clGetCommandQueueInfo")() != context()) {
    throw InvalidArgument("queue (adopt_device)", "a queue of another context", "one of the context");
  }
  const auto properties = cl_info<CL_QUEUE_PROPERTIES>(queue, "clGetCommandQueueInfo");
  if ((properties & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE) == 0) return make_device(device, context, queue);
  return make_device(device, context, make_queue(context, device));
}

const DeviceInfo& Device::info() const { return impl_->info; }
std::size_t Device::allocated_bytes() const { return impl_->allocated_bytes; }
std::size_t Device::peak_allocated_bytes() const { return impl_->peak_allocated_bytes; }
std::size_t Device::memory_budget() const { return impl_->memory_budget; }

void Device::set_memory_budget(std::size_t bytes) {
  if (bytes == 0) throw InvalidArgument("memory budget (device)", "0 bytes", "at least 1");
  impl_->memory_budget = bytes;
}

std::string allocation_name(const DeviceInfo& info, std::size_t bytes) {
  std::string name = "clCreateBuffer of " + std::to_string(bytes) + " bytes";
  if (info.max_allocation_bytes > 0 && bytes > info.max_allocation_bytes) {
    name += ", more than the " + std::to_string(info.max_allocation_bytes) + " of " + info.name +
            ": smaller images or fewer views at once fit";
  }
  return name;
}

}  // namespace dpr
