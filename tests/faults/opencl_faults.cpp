#include "faults/opencl_faults.hpp"

#include <CL/cl.h>
#include <dlfcn.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <type_traits>

namespace {

/// A function that may fail, and with what.
struct Function {
  std::string_view name;
  int error;
  std::atomic<std::size_t> calls = 0;
  bool failed = false;
};

Function k_functions[] = {
    {"clGetPlatformIDs", CL_OUT_OF_HOST_MEMORY},
    {"clGetPlatformInfo", CL_OUT_OF_HOST_MEMORY},
    {"clGetDeviceIDs", CL_OUT_OF_RESOURCES},
    {"clGetDeviceInfo", CL_OUT_OF_RESOURCES},
    {"clCreateSubDevices", CL_DEVICE_PARTITION_FAILED},
    {"clCreateContext", CL_OUT_OF_RESOURCES},
    {"clCreateCommandQueue", CL_OUT_OF_RESOURCES},
    {"clGetCommandQueueInfo", CL_OUT_OF_RESOURCES},
    {"clCreateBuffer", CL_MEM_OBJECT_ALLOCATION_FAILURE},
    {"clGetMemObjectInfo", CL_OUT_OF_RESOURCES},
    {"clCreateProgramWithSource", CL_OUT_OF_HOST_MEMORY},
    {"clBuildProgram", CL_BUILD_PROGRAM_FAILURE},
    {"clGetProgramInfo", CL_OUT_OF_RESOURCES},
    {"clGetProgramBuildInfo", CL_OUT_OF_RESOURCES},
    {"clCreateKernel", CL_OUT_OF_RESOURCES},
    {"clGetKernelInfo", CL_OUT_OF_RESOURCES},
    {"clGetKernelArgInfo", CL_OUT_OF_RESOURCES},
    {"clGetKernelWorkGroupInfo", CL_OUT_OF_RESOURCES},
    {"clSetKernelArg", CL_OUT_OF_RESOURCES},
    {"clEnqueueNDRangeKernel", CL_OUT_OF_RESOURCES},
    {"clEnqueueReadBuffer", CL_OUT_OF_RESOURCES},
    {"clEnqueueReadBufferRect", CL_OUT_OF_RESOURCES},
    {"clEnqueueWriteBuffer", CL_OUT_OF_RESOURCES},
    {"clEnqueueWriteBufferRect", CL_OUT_OF_RESOURCES},
    {"clEnqueueMapBuffer", CL_OUT_OF_RESOURCES},
    {"clEnqueueBarrierWithWaitList", CL_OUT_OF_RESOURCES},
    {"clEnqueueMarkerWithWaitList", CL_OUT_OF_RESOURCES},
    {"clEnqueueCopyBuffer", CL_OUT_OF_RESOURCES},
    {"clEnqueueFillBuffer", CL_OUT_OF_RESOURCES},
    {"clWaitForEvents", CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST},
    {"clGetEventInfo", CL_OUT_OF_RESOURCES},
    {"clGetEventProfilingInfo", CL_PROFILING_INFO_NOT_AVAILABLE},
    {"clFlush", CL_OUT_OF_RESOURCES},
    {"clFinish", CL_OUT_OF_RESOURCES},
};

bool matches(std::string_view pattern, std::string_view name) {
  if (pattern.ends_with('*')) return name.starts_with(pattern.substr(0, pattern.size() - 1));
  return pattern == name;
}

std::mutex fault_mutex;
std::string armed_name;       // empty: none
std::size_t armed_calls = 0;  // of that name, until one fails
bool has_failed = false;
thread_local int depth = 0;  // of calls, which may call each other

/// Fault of a command queue.
struct QueueFault {
  std::size_t calls_left = 0;  // until it is lost; 0: it is not to be
  bool is_lost = false;
  unsigned delay_microseconds = 0;
};
std::map<void*, QueueFault> queue_faults;  // by fault_mutex
std::size_t queues_made = 0;

/// The environment's wish for the queue that has just been made: two numbers, the first that of the queue.
std::optional<unsigned long long> wish_for_queue(const char* variable, std::size_t number) {
  const char* const wanted = std::getenv(variable);
  if (wanted == nullptr) return std::nullopt;
  char* colon = nullptr;
  if (std::strtoull(wanted, &colon, 10) != number || *colon != ':') return std::nullopt;
  return std::strtoull(colon + 1, nullptr, 10);
}

/// The queue that a call is on: its first argument, or that of the events it waits for.
template <class First, class... Rest>
cl_command_queue queue_of(First first, Rest... rest) {
  if constexpr (std::is_same_v<First, cl_command_queue>) {
    return first;
  } else if constexpr (std::is_same_v<First, const cl_event*>) {
    cl_command_queue queue = nullptr;
    clGetEventInfo(*first, CL_EVENT_COMMAND_QUEUE, sizeof queue, static_cast<void*>(&queue), nullptr);
    return queue;
  } else if constexpr (sizeof...(rest) > 0) {
    return queue_of(rest...);
  } else {
    return nullptr;
  }
}

/// True if the queue's device has vanished; if not, and if the call waits, it takes its time.
bool is_lost(cl_command_queue queue, bool waits) {
  unsigned delay = 0;
  {
    const std::scoped_lock lock(fault_mutex);
    const auto found = queue_faults.find(queue);
    if (found == queue_faults.end()) return false;
    QueueFault& fault = found->second;
    if (fault.calls_left > 0 && --fault.calls_left == 0) fault.is_lost = true;
    if (fault.is_lost) return true;
    if (waits) delay = fault.delay_microseconds;
  }
  std::this_thread::sleep_for(std::chrono::microseconds(delay));
  return false;
}

/// True if a call returns no sooner than the device has done something.
template <class... Args>
bool waits(std::string_view name, Args... args) {
  if (name == "clWaitForEvents" || name == "clFinish") return true;
  if constexpr (sizeof...(Args) > 2) {
    const auto is_blocking = [](auto, auto, auto third, auto...) {
      if constexpr (std::is_same_v<decltype(third), cl_bool>) return third == CL_TRUE;
      return false;
    };
    return name.ends_with("Buffer") && is_blocking(args...);
  }
  return false;
}

/// The environment's wishes, at both ends of the process.
struct Environment {
  Environment() {
    const char* const wanted = std::getenv("DPR_FAULT");
    if (wanted == nullptr) return;
    const std::string_view text = wanted;
    const std::size_t colon = text.find(':');
    if (colon == std::string_view::npos) std::abort();
    dpr::test::dpr_arm_opencl_fault(std::string(text.substr(0, colon)).c_str(),
                                    std::strtoull(wanted + colon + 1, nullptr, 10));
  }
  ~Environment() {
    const char* const log = std::getenv("DPR_FAULT_LOG");
    if (log == nullptr) return;
    std::ofstream out(log);
    for (const Function& f : k_functions) {
      if (f.calls > 0) out << f.name << ' ' << f.calls << (f.failed ? " failed\n" : "\n");
    }
  }
} environment;

/// True if this call is the one to fail.
bool fails(Function& function) {
  ++function.calls;
  const std::scoped_lock lock(fault_mutex);
  if (armed_name.empty() || !matches(armed_name, function.name) || --armed_calls != 0) return false;
  armed_name.clear();
  has_failed = function.failed = true;
  return true;
}

/// Result of a function that fails: an error code, or null and the code where an argument says.
template <class Result, class... Args>
Result failure(int error, Args... args) {
  if constexpr (std::is_same_v<Result, cl_int>) {
    return error;
  } else {
    const auto tell = [&](auto argument) {
      if constexpr (std::is_same_v<decltype(argument), cl_int*>) {
        if (argument != nullptr) *argument = error;
      }
    };
    (tell(args), ...);
    return nullptr;
  }
}

void arm_new_queue(cl_command_queue queue) {
  std::size_t number = 0;
  {
    const std::scoped_lock lock(fault_mutex);
    number = queues_made++;
    queue_faults.erase(queue);  // of one before it at that address
  }
  if (const auto nth = wish_for_queue("DPR_LOST_QUEUE", number)) dpr::test::dpr_lose_queue(queue, *nth);
  if (const auto time = wish_for_queue("DPR_SLOW_QUEUE", number))
    dpr::test::dpr_slow_queue(queue, static_cast<unsigned>(*time));
}

template <class Result, class... Args>
Result call(Function& function, Result (*real)(Args...), Args... args) {
  if (depth == 0 && fails(function)) return failure<Result>(function.error, args...);
  ++depth;
  const cl_command_queue queue = depth == 1 ? queue_of(args...) : nullptr;
  const bool lost = queue != nullptr && is_lost(queue, waits(function.name, args...));
  const Result result = lost ? failure<Result>(CL_DEVICE_NOT_AVAILABLE, args...) : real(args...);
  --depth;
  if constexpr (std::is_same_v<Result, cl_command_queue>) {
    if (depth == 0) arm_new_queue(result);
  }
  return result;
}

/// True if the environment wants that the kernel is not run.
bool is_skipped(cl_kernel kernel) {
  static const char* const skipped = std::getenv("DPR_SKIPPED_KERNEL");
  if (skipped == nullptr) return false;
  char name[128] = {};
  clGetKernelInfo(kernel, CL_KERNEL_FUNCTION_NAME, sizeof name - 1, name, nullptr);
  return std::string_view(name) == skipped;
}

std::size_t index_of(std::string_view name) {
  std::size_t i = 0;
  while (k_functions[i].name != name) ++i;
  return i;
}

template <class F>
F* next(const char* name) {
  return reinterpret_cast<F*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

namespace dpr::test {

void dpr_arm_opencl_fault(const char* name, std::size_t nth) {
  const std::scoped_lock lock(fault_mutex);
  for (Function& f : k_functions) f.calls = 0;
  has_failed = false;
  armed_name = name;
  armed_calls = nth;
}

bool dpr_disarm_opencl_fault() {
  const std::scoped_lock lock(fault_mutex);
  armed_name.clear();
  return has_failed;
}

std::size_t dpr_opencl_calls(const char* name) {
  std::size_t calls = 0;
  for (const Function& f : k_functions) calls += matches(name, f.name) ? f.calls.load() : 0;
  return calls;
}

void dpr_lose_queue(void* queue, std::size_t nth) {
  const std::scoped_lock lock(fault_mutex);
  queue_faults[queue].calls_left = nth;
  queue_faults[queue].is_lost = false;
}

void dpr_slow_queue(void* queue, unsigned microseconds) {
  const std::scoped_lock lock(fault_mutex);
  queue_faults[queue].delay_microseconds = microseconds;
}

bool dpr_is_within_opencl() { return depth > 0; }

}  // namespace dpr::test

// The functions themselves: parameters with their names, then the names alone.
#define DPR_FAULTY(result, name, parameters, ...)             \
  extern "C" result CL_API_CALL name parameters {             \
    static auto* const real = next<decltype(name)>(#name);    \
    static Function& function = k_functions[index_of(#name)]; \
    return call(function, real, __VA_ARGS__);                 \
  }
/// Those that cannot fail: only known to be OpenCL's.
#define DPR_KNOWN(name, type)                              \
  extern "C" cl_int CL_API_CALL name(type object) {        \
    static auto* const real = next<decltype(name)>(#name); \
    ++depth;                                               \
    const cl_int result = real(object);                    \
    --depth;                                               \
    return result;                                         \
  }

DPR_FAULTY(cl_int, clGetPlatformIDs, (cl_uint num_entries, cl_platform_id* platforms, cl_uint* num_platforms),
           num_entries, platforms, num_platforms)
DPR_FAULTY(cl_int, clGetPlatformInfo,
           (cl_platform_id platform, cl_platform_info param_name, size_t param_value_size, void* param_value,
            size_t* param_value_size_ret),
           platform, param_name, param_value_size, param_value, param_value_size_ret)
DPR_FAULTY(cl_int, clGetDeviceIDs,
           (cl_platform_id platform, cl_device_type device_type, cl_uint num_entries, cl_device_id* devices,
            cl_uint* num_devices),
           platform, device_type, num_entries, devices, num_devices)
DPR_FAULTY(cl_int, clGetDeviceInfo,
           (cl_device_id device, cl_device_info param_name, size_t param_value_size, void* param_value,
            size_t* param_value_size_ret),
           device, param_name, param_value_size, param_value, param_value_size_ret)
DPR_FAULTY(cl_int, clCreateSubDevices,
           (cl_device_id in_device, const cl_device_partition_property* properties, cl_uint num_devices,
            cl_device_id* out_devices, cl_uint* num_devices_ret),
           in_device, properties, num_devices, out_devices, num_devices_ret)
DPR_FAULTY(cl_context, clCreateContext,
           (const cl_context_properties* properties, cl_uint num_devices, const cl_device_id* devices,
            void(CL_CALLBACK* pfn_notify)(const char* errinfo, const void* private_info, size_t cb,
                                          void* user_data),
            void* user_data, cl_int* errcode_ret),
           properties, num_devices, devices, pfn_notify, user_data, errcode_ret)
DPR_FAULTY(CL_API_PREFIX__VERSION_1_2_DEPRECATED cl_command_queue, clCreateCommandQueue,
           (cl_context context, cl_device_id device, cl_command_queue_properties properties,
            cl_int* errcode_ret),
           context, device, properties, errcode_ret)
DPR_FAULTY(cl_int, clGetCommandQueueInfo,
           (cl_command_queue command_queue, cl_command_queue_info param_name, size_t param_value_size,
            void* param_value, size_t* param_value_size_ret),
           command_queue, param_name, param_value_size, param_value, param_value_size_ret)
DPR_FAULTY(cl_mem, clCreateBuffer,
           (cl_context context, cl_mem_flags flags, size_t size, void* host_ptr, cl_int* errcode_ret),
           context, flags, size, host_ptr, errcode_ret)
DPR_FAULTY(cl_int, clGetMemObjectInfo,
           (cl_mem memobj, cl_mem_info param_name, size_t param_value_size, void* param_value,
            size_t* param_value_size_ret),
           memobj, param_name, param_value_size, param_value, param_value_size_ret)
DPR_FAULTY(cl_program, clCreateProgramWithSource,
           (cl_context context, cl_uint count, const char** strings, const size_t* lengths,
            cl_int* errcode_ret),
           context, count, strings, lengths, errcode_ret)
DPR_FAULTY(cl_int, clBuildProgram,
           (cl_program program, cl_uint num_devices, const cl_device_id* device_list, const char* options,
            void(CL_CALLBACK* pfn_notify)(cl_program program, void* user_data), void* user_data),
           program, num_devices, device_list, options, pfn_notify, user_data)
DPR_FAULTY(cl_int, clGetProgramInfo,
           (cl_program program, cl_program_info param_name, size_t param_value_size, void* param_value,
            size_t* param_value_size_ret),
           program, param_name, param_value_size, param_value, param_value_size_ret)
DPR_FAULTY(cl_int, clGetProgramBuildInfo,
           (cl_program program, cl_device_id device, cl_program_build_info param_name,
            size_t param_value_size, void* param_value, size_t* param_value_size_ret),
           program, device, param_name, param_value_size, param_value, param_value_size_ret)
DPR_FAULTY(cl_kernel, clCreateKernel, (cl_program program, const char* kernel_name, cl_int* errcode_ret),
           program, kernel_name, errcode_ret)
DPR_FAULTY(cl_int, clGetKernelInfo,
           (cl_kernel kernel, cl_kernel_info param_name, size_t param_value_size, void* param_value,
            size_t* param_value_size_ret),
           kernel, param_name, param_value_size, param_value, param_value_size_ret)
DPR_FAULTY(cl_int, clGetKernelArgInfo,
           (cl_kernel kernel, cl_uint arg_indx, cl_kernel_arg_info param_name, size_t param_value_size,
            void* param_value, size_t* param_value_size_ret),
           kernel, arg_indx, param_name, param_value_size, param_value, param_value_size_ret)
DPR_FAULTY(cl_int, clGetKernelWorkGroupInfo,
           (cl_kernel kernel, cl_device_id device, cl_kernel_work_group_info param_name,
            size_t param_value_size, void* param_value, size_t* param_value_size_ret),
           kernel, device, param_name, param_value_size, param_value, param_value_size_ret)
DPR_FAULTY(cl_int, clSetKernelArg,
           (cl_kernel kernel, cl_uint arg_index, size_t arg_size, const void* arg_value), kernel, arg_index,
           arg_size, arg_value)
DPR_FAULTY(cl_int, clEnqueueReadBuffer,
           (cl_command_queue command_queue, cl_mem buffer, cl_bool blocking_read, size_t offset, size_t size,
            void* ptr, cl_uint num_events_in_wait_list, const cl_event* event_wait_list, cl_event* event),
           command_queue, buffer, blocking_read, offset, size, ptr, num_events_in_wait_list, event_wait_list,
           event)
DPR_FAULTY(cl_int, clEnqueueWriteBuffer,
           (cl_command_queue command_queue, cl_mem buffer, cl_bool blocking_write, size_t offset, size_t size,
            const void* ptr, cl_uint num_events_in_wait_list, const cl_event* event_wait_list,
            cl_event* event),
           command_queue, buffer, blocking_write, offset, size, ptr, num_events_in_wait_list, event_wait_list,
           event)
DPR_FAULTY(cl_int, clEnqueueCopyBuffer,
           (cl_command_queue command_queue, cl_mem src_buffer, cl_mem dst_buffer, size_t src_offset,
            size_t dst_offset, size_t size, cl_uint num_events_in_wait_list, const cl_event* event_wait_list,
            cl_event* event),
           command_queue, src_buffer, dst_buffer, src_offset, dst_offset, size, num_events_in_wait_list,
           event_wait_list, event)
DPR_FAULTY(cl_int, clEnqueueFillBuffer,
           (cl_command_queue command_queue, cl_mem buffer, const void* pattern, size_t pattern_size,
            size_t offset, size_t size, cl_uint num_events_in_wait_list, const cl_event* event_wait_list,
            cl_event* event),
           command_queue, buffer, pattern, pattern_size, offset, size, num_events_in_wait_list,
           event_wait_list, event)
DPR_FAULTY(cl_int, clEnqueueReadBufferRect,
           (cl_command_queue command_queue, cl_mem buffer, cl_bool blocking_read, const size_t* buffer_origin,
            const size_t* host_origin, const size_t* region, size_t buffer_row_pitch,
            size_t buffer_slice_pitch, size_t host_row_pitch, size_t host_slice_pitch, void* ptr,
            cl_uint num_events_in_wait_list, const cl_event* event_wait_list, cl_event* event),
           command_queue, buffer, blocking_read, buffer_origin, host_origin, region, buffer_row_pitch,
           buffer_slice_pitch, host_row_pitch, host_slice_pitch, ptr, num_events_in_wait_list,
           event_wait_list, event)
DPR_FAULTY(cl_int, clEnqueueWriteBufferRect,
           (cl_command_queue command_queue, cl_mem buffer, cl_bool blocking_write,
            const size_t* buffer_origin, const size_t* host_origin, const size_t* region,
            size_t buffer_row_pitch, size_t buffer_slice_pitch, size_t host_row_pitch,
            size_t host_slice_pitch, const void* ptr, cl_uint num_events_in_wait_list,
            const cl_event* event_wait_list, cl_event* event),
           command_queue, buffer, blocking_write, buffer_origin, host_origin, region, buffer_row_pitch,
           buffer_slice_pitch, host_row_pitch, host_slice_pitch, ptr, num_events_in_wait_list,
           event_wait_list, event)
DPR_FAULTY(void*, clEnqueueMapBuffer,
           (cl_command_queue command_queue, cl_mem buffer, cl_bool blocking_map, cl_map_flags map_flags,
            size_t offset, size_t size, cl_uint num_events_in_wait_list, const cl_event* event_wait_list,
            cl_event* event, cl_int* errcode_ret),
           command_queue, buffer, blocking_map, map_flags, offset, size, num_events_in_wait_list,
           event_wait_list, event, errcode_ret)
DPR_FAULTY(cl_int, clEnqueueBarrierWithWaitList,
           (cl_command_queue command_queue, cl_uint num_events_in_wait_list, const cl_event* event_wait_list,
            cl_event* event),
           command_queue, num_events_in_wait_list, event_wait_list, event)
DPR_FAULTY(cl_int, clEnqueueMarkerWithWaitList,
           (cl_command_queue command_queue, cl_uint num_events_in_wait_list, const cl_event* event_wait_list,
            cl_event* event),
           command_queue, num_events_in_wait_list, event_wait_list, event)
DPR_FAULTY(cl_int, clWaitForEvents, (cl_uint num_events, const cl_event* event_list), num_events, event_list)
DPR_FAULTY(cl_int, clGetEventInfo,
           (cl_event event, cl_event_info param_name, size_t param_value_size, void* param_value,
            size_t* param_value_size_ret),
           event, param_name, param_value_size, param_value, param_value_size_ret)
DPR_FAULTY(cl_int, clGetEventProfilingInfo,
           (cl_event event, cl_profiling_info param_name, size_t param_value_size, void* param_value,
            size_t* param_value_size_ret),
           event, param_name, param_value_size, param_value, param_value_size_ret)
DPR_FAULTY(cl_int, clFlush, (cl_command_queue command_queue), command_queue)
DPR_FAULTY(cl_int, clFinish, (cl_command_queue command_queue), command_queue)
DPR_KNOWN(clRetainContext, cl_context)
DPR_KNOWN(clReleaseContext, cl_context)
DPR_KNOWN(clRetainCommandQueue, cl_command_queue)
DPR_KNOWN(clReleaseCommandQueue, cl_command_queue)
DPR_KNOWN(clRetainMemObject, cl_mem)
DPR_KNOWN(clReleaseMemObject, cl_mem)
DPR_KNOWN(clRetainProgram, cl_program)
DPR_KNOWN(clReleaseProgram, cl_program)
DPR_KNOWN(clRetainKernel, cl_kernel)
DPR_KNOWN(clReleaseKernel, cl_kernel)
DPR_KNOWN(clRetainEvent, cl_event)
DPR_KNOWN(clReleaseEvent, cl_event)
DPR_KNOWN(clRetainDevice, cl_device_id)
DPR_KNOWN(clReleaseDevice, cl_device_id)

extern "C" cl_int CL_API_CALL clEnqueueNDRangeKernel(cl_command_queue command_queue, cl_kernel kernel,
                                                     cl_uint work_dim, const size_t* global_work_offset,
                                                     const size_t* global_work_size,
                                                     const size_t* local_work_size,
                                                     cl_uint num_events_in_wait_list,
                                                     const cl_event* event_wait_list, cl_event* event) {
  static auto* const real = next<decltype(clEnqueueNDRangeKernel)>("clEnqueueNDRangeKernel");
  static Function& function = k_functions[index_of("clEnqueueNDRangeKernel")];
  if (depth == 0 && is_skipped(kernel))
    return clEnqueueMarkerWithWaitList(command_queue, num_events_in_wait_list, event_wait_list, event);
  return call(function, real, command_queue, kernel, work_dim, global_work_offset, global_work_size,
              local_work_size, num_events_in_wait_list, event_wait_list, event);
}
