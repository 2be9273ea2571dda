// A program with OpenCL objects of its own, on the device that open_device("") takes.
#pragma once

#include <doctest/doctest.h>

#include <span>
#include <vector>

#include "device/opencl_bindings.hpp"
#include "dpr/device.hpp"

namespace dpr::test {

struct Caller {
  explicit Caller(cl_command_queue_properties properties = 0) {
    std::vector<cl::Platform> platforms;
    cl::Platform::get(&platforms);
    std::vector<cl::Device> devices;
    for (const cl::Platform& platform : platforms) {
      std::vector<cl::Device> found;
      platform.getDevices(CL_DEVICE_TYPE_ALL, &found);
      devices.insert(devices.end(), found.begin(), found.end());
    }
    device = devices.at(open_device("").info().index);
    context = cl::Context(device);
    queue = cl::CommandQueue(context, device, properties);
  }

  /// A buffer that holds the values.
  template <class T>
  cl::Buffer buffer(std::vector<T> values) const {
    return cl::Buffer(context, CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR, values.size() * sizeof(T),
                      values.data());
  }

  /// Content of a buffer once the events have come and the queue is done.
  template <class T = float>
  std::vector<T> read(const cl::Buffer& buffer, const std::vector<cl::Event>& after = {}) const {
    std::vector<T> values(buffer.getInfo<CL_MEM_SIZE>() / sizeof(T));
    REQUIRE(queue.enqueueReadBuffer(buffer, CL_TRUE, 0, values.size() * sizeof(T), values.data(), &after) ==
            CL_SUCCESS);
    return values;
  }

  /// A kernel of a program of the caller's own.
  cl::Kernel kernel(const char* source, const char* name) const {
    int error = CL_SUCCESS;
    const cl::Program program(context, source, /*build*/ false, &error);
    REQUIRE(error == CL_SUCCESS);
    REQUIRE(program.build() == CL_SUCCESS);
    return cl::Kernel(program, name);
  }

  cl::Device device;
  cl::Context context;
  cl::CommandQueue queue;
};

}  // namespace dpr::test
