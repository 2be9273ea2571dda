#include "renderer/buffer_span.hpp"

#include <string>

#include "base/checks.hpp"
#include "device/info.hpp"

namespace dpr {
namespace {

constexpr const char* k_buffer_info = "clGetMemObjectInfo";

/// Kinds of memory and what kernels may do with it.
void require_usable(const Device::Impl& device, const cl::Memory& memory, Access access,
                    const std::string& name) {
  if (cl_info<CL_MEM_TYPE>(memory, k_buffer_info) != CL_MEM_OBJECT_BUFFER)
    throw InvalidArgument(name, "an image", "a buffer");
  if (cl_info<CL_MEM_CONTEXT>(memory, k_buffer_info)() != device.context())
    throw InvalidArgument(name, "a buffer of another context", "one of the device's own");
  const cl_mem_flags flags = cl_info<CL_MEM_FLAGS>(memory, k_buffer_info);
  if (access == Access::read && (flags & CL_MEM_WRITE_ONLY) != 0)
    throw InvalidArgument(name, "a buffer that kernels may only write", "one that they may read");
  if (access == Access::write && (flags & CL_MEM_READ_ONLY) != 0)
    throw InvalidArgument(name, "a buffer that kernels may only read", "one that they may write");
}

/// Throws unless the bytes are a whole number of floats, which can be counted.
void require_floats(std::size_t bytes, const std::string& name) {
  constexpr std::size_t k_most = std::size_t{1} << 34U;
  if (bytes % sizeof(float) == 0 && bytes < k_most) return;
  throw InvalidArgument(name, std::to_string(bytes) + " bytes", "a multiple of 4 below 2^34");
}

}  // namespace

FloatVectors require_vectors(const Device::Impl& device, const BufferSpan& span, const VectorShape& shape,
                             Access access, const char* name) {
  if (span.buffer == nullptr) throw InvalidArgument(name, "no buffer", "one of the device's context");
  const cl::Memory memory(span.buffer, true);
  require_usable(device, memory, access, name);
  require_floats(span.offset, std::string("offset (") + name + ")");
  require_floats(span.stride, std::string("stride (") + name + ")");
  const std::size_t vector = shape.components * shape.rows * sizeof(float);
  const std::size_t stride = span.stride == 0 ? vector : span.stride;
  if (stride < vector) {
    throw InvalidArgument(std::string("stride (") + name + ")", std::to_string(stride) + " bytes",
                          "at least " + std::to_string(vector) + ", or 0 for packed vectors");
  }
  const std::size_t size = cl_info<CL_MEM_SIZE>(memory, k_buffer_info);
  const bool has_first = span.offset <= size && vector <= size - span.offset;
  if (shape.count > 0 && !(has_first && shape.count - 1 <= (size - span.offset - vector) / stride)) {
    throw InvalidArgument(name, std::to_string(size) + " bytes",
                          "room for " + std::to_string(shape.count) + " vectors of " +
                              std::to_string(vector) + " bytes, " + std::to_string(stride) +
                              " apart, from byte " + std::to_string(span.offset) + " on");
  }
  return {span.buffer, span.offset / sizeof(float), stride / sizeof(float), shape.components, shape.rows};
}

void require_events(const Device::Impl& device, const Events& events) {
  for (std::size_t i = 0; i < events.wait.size(); ++i) {
    const std::string name = checks::element("wait", i);
    if (events.wait[i] == nullptr) throw InvalidArgument(name, "no event", "one of the device's context");
    const cl::Event event(events.wait[i], true);
    if (cl_info<CL_EVENT_CONTEXT>(event, "clGetEventInfo")() != device.context())
      throw InvalidArgument(name, "an event of another context", "one of the device's own");
    const cl_int status = cl_info<CL_EVENT_COMMAND_EXECUTION_STATUS>(event, "clGetEventInfo");
    if (status < 0)  // what waits for it never runs
      throw InvalidArgument(name, "an event that has failed with " + std::to_string(status),
                            "one of work that runs, or has run");
  }
}

void begin(const Device::Impl& device, const Events& events) {
  if (events.wait.empty()) return;
  check_cl(clEnqueueBarrierWithWaitList(device.queue(), static_cast<cl_uint>(events.wait.size()),
                                        events.wait.data(), nullptr),
           "clEnqueueBarrierWithWaitList");
}

void end(const Device::Impl& device, const Events& events) {
  if (events.done != nullptr) {
    check_cl(clEnqueueMarkerWithWaitList(device.queue(), 0, nullptr, events.done),
             "clEnqueueMarkerWithWaitList");
  }
  static_cast<void>(
      device.queue.flush());  // all is enqueued; whoever waits learns what is wrong with the queue
}

}  // namespace dpr
