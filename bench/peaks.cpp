#include "peaks.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>

#include "device/kernel.hpp"
#include "device/kernel_sources.hpp"

namespace dpr::bench {
namespace {

constexpr unsigned k_chains = 10;            // DPR_CHAINS
constexpr double k_seconds_per_run = 0.002;  // long against a launch, short against a scheduler's time slice
constexpr int k_flop_runs = 200, k_stream_runs = 20;
constexpr double k_giga = 1e9;

cl::Program build(Device::Impl& device) {
  // In place of the include, the file: a compiler at run time has no folders.
  std::string text(bench_kernel_file("peak.cl"));
  const std::string include = "#include \"lanes.h\"\n";
  text.replace(text.find(include), include.size(), kernel_file("lanes.h"));
  const std::string options = build_options(device, " -DDPR_CHAINS=" + std::to_string(k_chains));
  int error = CL_SUCCESS;
  cl::Program program(device.context, text, false, &error);
  check_cl(error, "clCreateProgramWithSource");
  if (program.build(device.device, options.c_str()) != CL_SUCCESS) {
    throw BuildError("peak.cl", device.info.name, options,
                     program.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device.device));
  }
  return program;
}

/// Seconds of one launch, from before it is enqueued until it has finished.
double time_launch(Device::Impl& device, const cl::Kernel& kernel, std::size_t items) {
  check_cl(device.queue.finish(), "clFinish");
  const auto start = std::chrono::steady_clock::now();
  check_cl(device.queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(items),
                                             cl::NDRange(device.local_size())),
           "kernel " + kernel.getInfo<CL_KERNEL_FUNCTION_NAME>());
  check_cl(device.queue.finish(), "clFinish");
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double measure_flops(Device::Impl& device, const cl::Program& program) {
  // Work for every unit several times over; a GPU's unit wants many work-items.
  const std::size_t per_unit = device.local_size() * (device.info.type == "cpu" ? 4 : 32);
  const std::size_t items = per_unit * device.info.compute_units;
  Buffer<float> result(device, items);
  cl::Kernel kernel(program, "peak_fma");
  kernel.setArg(1, 0.999F);
  kernel.setArg(2, result.cl_buffer());
  const auto time = [&](cl_uint rounds) {
    kernel.setArg(0, rounds);
    return time_launch(device, kernel, items);
  };
  cl_uint rounds = 256;
  time(rounds);  // compiles
  while (time(rounds) < k_seconds_per_run && rounds < (1U << 28U)) rounds *= 2;
  double best = INFINITY;
  for (int run = 0; run < k_flop_runs; ++run) best = std::min(best, time(rounds));
  return 2.0 * rounds * k_chains * device.info.lanes * static_cast<double>(items) / best;
}

double measure_bandwidth(Device::Impl& device, const cl::Program& program) {
  constexpr std::size_t k_cpu_floats = std::size_t{1} << 24U, k_gpu_floats = std::size_t{1} << 26U;
  const std::size_t floats = std::min(device.info.type == "cpu" ? k_cpu_floats : k_gpu_floats,
                                      device.info.max_allocation_bytes / sizeof(float) / 2);
  const std::size_t unit = device.info.lanes * device.local_size();
  const std::size_t items = floats / unit * device.local_size();
  Buffer<float> a(device, floats), b(device, floats), c(device, floats);
  b.fill(1.0F);
  c.fill(2.0F);
  cl::Kernel kernel(program, "peak_triad");
  kernel.setArg(0, 3.0F);
  kernel.setArg(1, b.cl_buffer());
  kernel.setArg(2, c.cl_buffer());
  kernel.setArg(3, a.cl_buffer());
  time_launch(device, kernel, items);
  double best = INFINITY;
  for (int run = 0; run < k_stream_runs; ++run) best = std::min(best, time_launch(device, kernel, items));
  return 3.0 * sizeof(float) * device.info.lanes * static_cast<double>(items) / best;
}

}  // namespace

Peaks measure_peaks(const Device& device) {
  Device::Impl& impl = device.impl();
  const cl::Program program = build(impl);
  return {measure_flops(impl, program) / k_giga, measure_bandwidth(impl, program) / k_giga};
}

}  // namespace dpr::bench
