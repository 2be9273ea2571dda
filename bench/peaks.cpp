#include "peaks.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>

#include "device/kernel.hpp"
#include "device/kernel_sources.hpp"
#include "kernels/peak.hpp"

namespace dpr::bench {
namespace {

constexpr unsigned k_chains = 10;            // DPR_CHAINS
constexpr double k_seconds_per_run = 0.002;  // long against a launch, short against a scheduler's time slice
constexpr int k_flop_runs = 200, k_stream_runs = 20;

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
template <class K>
double time_launch(Device::Impl& device, const cl::Program& program, std::size_t items, const K& arguments) {
  cl::Kernel kernel(program, K::k_source.name);
  detail::set_arguments(kernel, K::k_source.name, arguments.arguments());
  check_cl(device.queue.finish(), "clFinish");
  const auto start = std::chrono::steady_clock::now();
  check_cl(device.queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(items),
                                             cl::NDRange(device.local_size())),
           std::string("kernel ") + K::k_source.name);
  check_cl(device.queue.finish(), "clFinish");
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double measure_flops(Device::Impl& device, const cl::Program& program) {
  // Work for every unit several times over; a GPU's unit wants many work-items.
  const std::size_t per_unit = device.local_size() * (device.info.type == "cpu" ? 4 : 32);
  const std::size_t items = per_unit * device.info.compute_units;
  Buffer<float> result(device, items);
  const auto time = [&](cl_uint rounds) {
    return time_launch(device, program, items,
                       kernel::peak_fma{.rounds = rounds, .factor = 0.999F, .result = result});
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
  const kernel::peak_triad triad{.scale = 3.0F, .b = b, .c = c, .a = a};
  time_launch(device, program, items, triad);
  double best = INFINITY;
  for (int run = 0; run < k_stream_runs; ++run)
    best = std::min(best, time_launch(device, program, items, triad));
  return 3.0 * sizeof(float) * device.info.lanes * static_cast<double>(items) / best;
}

}  // namespace

Peaks measure_peaks(const Device& device) {
  Device::Impl& impl = impl_of(device);
  const cl::Program program = build(impl);
  return {measure_flops(impl, program) / k_giga, measure_bandwidth(impl, program) / k_giga};
}

}  // namespace dpr::bench
