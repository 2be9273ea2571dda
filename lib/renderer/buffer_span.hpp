// Checks of a caller's OpenCL objects when they are passed.
#pragma once

#include <cstddef>

#include "device/context.hpp"
#include "dpr/opencl_handles.hpp"
#include "stages/exchange.hpp"

namespace dpr {

enum class Access { read, write };

/// Place at which kernels find `count` vectors, each of so many rows of floats. Throws InvalidArgument, which
/// calls the buffer `name`, unless kernels may read or write there and all vectors are there.
struct VectorShape {
  std::size_t count, components, rows = 1;
};
FloatVectors require_vectors(const Device::Impl& device, const BufferSpan& span, const VectorShape& shape,
                             Access access, const char* name);

/// Throws InvalidArgument unless the events can be waited for on the device's queue.
void require_events(const Device::Impl& device, const Events& events);

/// Enqueues what begin() is given to wait for; end() gives the event, and sends all to the device.
void begin(const Device::Impl& device, const Events& events);
void end(const Device::Impl& device, const Events& events);

}  // namespace dpr
