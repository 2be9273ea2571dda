// Makes a device look like a small GPU, and holds programs to what it says. The library stands before OpenCL,
// loaded with LD_PRELOAD; the environment names the limits, e.g.
//
//   DPR_SMALL_DEVICE=group=32,local=16384,allocation=8,fp64=0,watchdog=0.2,few=8:aggregate_forward
//
//   group=N       work-groups of at most N work-items, of the device and of every kernel
//   few=N:KERNEL  of at most N for that kernel, as where it needs many registers
//   local=BYTES   local memory
//   allocation=N  buffers of at most the N-th part of the device's memory
//   fp64=0        no double precision
//   abort=N:L     the driver aborts when the N-th kernel (from 1) is launched for the first time, of programs
//                 that are built for L lanes; L left out: for any
//   hang=N:L      the same, but the driver never comes back
//   watchdog=S    a launch that runs for more than S seconds ends, and takes its queue with it
//
// A call beyond a limit fails as drivers fail, and is told on stderr.
#include <CL/cl.h>
#include <dlfcn.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <mutex>
#include <set>
#include <string>

namespace {

struct Limits {
  std::size_t group = 0, few = 0, local = 0, allocation = 0;  // 0: none
  std::string few_kernel;
  std::size_t failing = 0;  // the kernel's place, from 1
  std::string failing_lanes;
  bool hangs = false;
  bool has_fp64 = true;
  double watchdog = 0;

  Limits() {
    const char* const wanted = std::getenv("DPR_SMALL_DEVICE");
    std::string text = wanted == nullptr ? "" : wanted;
    while (!text.empty()) {
      const std::string item = text.substr(0, text.find(','));
      text.erase(0, std::min(item.size() + 1, text.size()));
      set(item.substr(0, item.find('=')), item.substr(item.find('=') + 1));
    }
  }

  void set(const std::string& name, const std::string& value) {
    const std::size_t number = std::strtoull(value.c_str(), nullptr, 10);
    if (name == "group") group = number;
    if (name == "local") local = number;
    if (name == "allocation") allocation = number;
    if (name == "fp64") has_fp64 = number != 0;
    if (name == "abort" || name == "hang") {
      failing = number;
      hangs = name == "hang";
      if (value.find(':') != std::string::npos) failing_lanes = value.substr(value.find(':') + 1);
    }
    if (name == "watchdog") watchdog = std::strtod(value.c_str(), nullptr);
    if (name != "few") return;
    few = number;
    few_kernel = value.substr(value.find(':') + 1);
  }
};

const Limits& limits() {
  static const Limits wanted;
  return wanted;
}

template <class F>
F* next(const char* name) {
  return reinterpret_cast<F*>(dlsym(RTLD_NEXT, name));
}

std::string name_of(cl_kernel kernel) {
  char name[128] = {};
  clGetKernelInfo(kernel, CL_KERNEL_FUNCTION_NAME, sizeof name - 1, name, nullptr);
  return name;
}

/// Work-items of a group of the kernel, given what the driver allows.
std::size_t most_of(cl_kernel kernel, std::size_t allowed) {
  if (limits().group > 0) allowed = std::min(allowed, limits().group);
  return limits().few > 0 && name_of(kernel) == limits().few_kernel ? std::min(allowed, limits().few)
                                                                    : allowed;
}

/// The driver's answer to a question, made smaller.
template <class T>
void lower(void* answer, T most) {
  if (answer == nullptr || most == 0) return;
  T value{};
  std::memcpy(&value, answer, sizeof value);
  value = std::min(value, most);
  std::memcpy(answer, &value, sizeof value);
}

cl_ulong most_allocated(cl_device_id device) {
  cl_ulong memory = 0;
  clGetDeviceInfo(device, CL_DEVICE_GLOBAL_MEM_SIZE, sizeof memory, &memory, nullptr);
  return limits().allocation > 0 ? memory / limits().allocation : 0;
}

std::mutex mutex;
std::set<std::string> launched;    // kernels
std::set<cl_command_queue> ended;  // by the watchdog

int refuse(const std::string& kernel, const std::string& why, int error) {
  std::fprintf(stderr, "small device: kernel %s: %s\n", kernel.c_str(), why.c_str());
  return error;
}

/// Error of a launch that asks for more than there is.
int check_launch(cl_command_queue queue, cl_kernel kernel, cl_uint dimensions, const size_t* local_size) {
  cl_device_id device = nullptr;
  clGetCommandQueueInfo(queue, CL_QUEUE_DEVICE, sizeof device, static_cast<void*>(&device), nullptr);
  std::size_t most = 0, items = 1, required[3] = {};
  cl_ulong local = 0;
  clGetKernelWorkGroupInfo(kernel, device, CL_KERNEL_WORK_GROUP_SIZE, sizeof most, &most, nullptr);
  clGetKernelWorkGroupInfo(kernel, device, CL_KERNEL_COMPILE_WORK_GROUP_SIZE, sizeof required, required,
                           nullptr);
  clGetKernelWorkGroupInfo(kernel, device, CL_KERNEL_LOCAL_MEM_SIZE, sizeof local, &local, nullptr);
  for (cl_uint d = 0; local_size != nullptr && d < dimensions; ++d) items *= local_size[d];
  if (items > most || (required[0] > 0 && items != required[0]))
    return refuse(name_of(kernel), std::to_string(items) + " work-items", CL_INVALID_WORK_GROUP_SIZE);
  if (limits().local > 0 && local > limits().local)
    return refuse(name_of(kernel), std::to_string(local) + " bytes of local memory", CL_OUT_OF_RESOURCES);
  return CL_SUCCESS;
}

/// Aborts or hangs at the kernel that the environment names.
void fail_at(cl_kernel kernel) {
  if (limits().failing == 0) return;
  cl_program program = nullptr;
  cl_device_id device = nullptr;
  char options[512] = {};
  clGetKernelInfo(kernel, CL_KERNEL_PROGRAM, sizeof program, static_cast<void*>(&program), nullptr);
  clGetProgramInfo(program, CL_PROGRAM_DEVICES, sizeof device, static_cast<void*>(&device), nullptr);
  clGetProgramBuildInfo(program, device, CL_PROGRAM_BUILD_OPTIONS, sizeof options - 1, options, nullptr);
  const std::string wanted = "-DDPR_LANES=" + limits().failing_lanes;
  if (!limits().failing_lanes.empty() && (std::string(options) + " ").find(wanted + " ") == std::string::npos)
    return;
  const std::scoped_lock lock(mutex);
  launched.insert(name_of(kernel));
  if (launched.size() < limits().failing) return;
  while (limits().hangs) sleep(1);
  std::fprintf(stderr, "LLVM ERROR: a pass did not reach a fixpoint\n");
  std::abort();
}

/// The processor time of this process, in seconds.
double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

/// Ends the queue if the launch took too long: by the clock, and by the processor's time on each unit, which
/// other programs on a busy machine do not lengthen.
int watch(cl_command_queue queue, cl_kernel kernel, cl_event launch) {
  if (limits().watchdog == 0) return CL_SUCCESS;
  cl_device_id device = nullptr;
  cl_uint units = 1;
  clGetCommandQueueInfo(queue, CL_QUEUE_DEVICE, sizeof device, static_cast<void*>(&device), nullptr);
  clGetDeviceInfo(device, CL_DEVICE_MAX_COMPUTE_UNITS, sizeof units, &units, nullptr);
  const double before = processor_seconds();
  clWaitForEvents(1, &launch);
  const double worked = (processor_seconds() - before) / units;
  cl_ulong start = 0, end = 0;
  clGetEventProfilingInfo(launch, CL_PROFILING_COMMAND_START, sizeof start, &start, nullptr);
  clGetEventProfilingInfo(launch, CL_PROFILING_COMMAND_END, sizeof end, &end, nullptr);
  const double seconds = std::min(worked, static_cast<double>(end - start) * 1e-9);
  if (seconds <= limits().watchdog) return CL_SUCCESS;
  const std::scoped_lock lock(mutex);
  ended.insert(queue);
  return refuse(name_of(kernel), "ran for " + std::to_string(seconds) + " s", CL_OUT_OF_RESOURCES);
}

}  // namespace

extern "C" cl_int CL_API_CALL clGetDeviceInfo(cl_device_id device, cl_device_info property, size_t size,
                                              void* value, size_t* size_ret) {
  static auto* const real = next<decltype(clGetDeviceInfo)>("clGetDeviceInfo");
  const cl_int result = real(device, property, size, value, size_ret);
  if (result != CL_SUCCESS) return result;
  if (property == CL_DEVICE_MAX_WORK_GROUP_SIZE) lower<std::size_t>(value, limits().group);
  if (property == CL_DEVICE_LOCAL_MEM_SIZE) lower<cl_ulong>(value, limits().local);
  if (property == CL_DEVICE_MAX_MEM_ALLOC_SIZE) lower<cl_ulong>(value, most_allocated(device));
  if (property == CL_DEVICE_DOUBLE_FP_CONFIG && !limits().has_fp64 && value != nullptr)
    std::memset(value, 0, size);
  if (property == CL_DEVICE_EXTENSIONS && !limits().has_fp64 && value != nullptr) {
    if (char* const found = std::strstr(static_cast<char*>(value), "cl_khr_fp64"))
      std::memcpy(found, "cl_no_fp64_", std::strlen("cl_khr_fp64"));
  }
  return result;
}

extern "C" cl_int CL_API_CALL clGetKernelWorkGroupInfo(cl_kernel kernel, cl_device_id device,
                                                       cl_kernel_work_group_info property, size_t size,
                                                       void* value, size_t* size_ret) {
  static auto* const real = next<decltype(clGetKernelWorkGroupInfo)>("clGetKernelWorkGroupInfo");
  const cl_int result = real(kernel, device, property, size, value, size_ret);
  if (result == CL_SUCCESS && property == CL_KERNEL_WORK_GROUP_SIZE)
    lower<std::size_t>(value, most_of(kernel, static_cast<std::size_t>(-1)));
  return result;
}

extern "C" CL_API_PREFIX__VERSION_1_2_DEPRECATED cl_command_queue CL_API_CALL clCreateCommandQueue(
    cl_context context, cl_device_id device, cl_command_queue_properties properties, cl_int* error) {
  static auto* const real = next<decltype(clCreateCommandQueue)>("clCreateCommandQueue");
  return real(context, device, limits().watchdog > 0 ? properties | CL_QUEUE_PROFILING_ENABLE : properties,
              error);
}

extern "C" cl_mem CL_API_CALL clCreateBuffer(cl_context context, cl_mem_flags flags, size_t size, void* host,
                                             cl_int* error) {
  static auto* const real = next<decltype(clCreateBuffer)>("clCreateBuffer");
  cl_device_id device = nullptr;
  clGetContextInfo(context, CL_CONTEXT_DEVICES, sizeof device, static_cast<void*>(&device), nullptr);
  const cl_ulong most = most_allocated(device);
  if (most == 0 || size <= most) return real(context, flags, size, host, error);
  if (error != nullptr) *error = CL_INVALID_BUFFER_SIZE;
  return nullptr;
}

extern "C" cl_int CL_API_CALL clEnqueueNDRangeKernel(cl_command_queue queue, cl_kernel kernel,
                                                     cl_uint dimensions, const size_t* offset,
                                                     const size_t* global, const size_t* local, cl_uint waits,
                                                     const cl_event* wait_list, cl_event* event) {
  static auto* const real = next<decltype(clEnqueueNDRangeKernel)>("clEnqueueNDRangeKernel");
  {
    const std::scoped_lock lock(mutex);
    if (ended.contains(queue)) return CL_OUT_OF_RESOURCES;
  }
  fail_at(kernel);
  if (const int error = check_launch(queue, kernel, dimensions, local)) return error;
  cl_event launch = nullptr;
  if (const int error = real(queue, kernel, dimensions, offset, global, local, waits, wait_list, &launch))
    return error;
  const int result = watch(queue, kernel, launch);
  if (event != nullptr && result == CL_SUCCESS) {
    *event = launch;
  } else {
    clReleaseEvent(launch);
  }
  return result;
}
