#include "device/profile.hpp"

namespace dpr {

Profile::Profile(const Device& device) : device_(device), replaced_(impl_of(device).queue) {
  Device::Impl& impl = impl_of(device_);
  int error = CL_SUCCESS;
  const cl::CommandQueue queue(impl.context, impl.device,
                               cl_command_queue_properties{CL_QUEUE_PROFILING_ENABLE}, &error);
  check_cl(error, "clCreateCommandQueue with profiling");
  check_cl(replaced_.finish(), "clFinish");
  impl.queue = queue;
  impl.profile = this;
}

Profile::~Profile() {
  Device::Impl& impl = impl_of(device_);
  impl.queue.finish();
  impl.profile = nullptr;
  impl.queue = replaced_;
}

void Profile::record(const std::string& file, const std::string& kernel, const cl::Event& finished) {
  pending_.push_back({file, kernel, finished});
}

std::vector<Profile::Launch> Profile::take() {
  check_cl(impl_of(device_).queue.finish(), "clFinish");
  constexpr double k_milliseconds = 1e-6;  // events count nanoseconds
  std::vector<Launch> launches;
  for (const Pending& launch : pending_) {
    cl_ulong start = 0, end = 0;
    check_cl(launch.finished.getProfilingInfo(CL_PROFILING_COMMAND_START, &start), "clGetEventProfilingInfo");
    check_cl(launch.finished.getProfilingInfo(CL_PROFILING_COMMAND_END, &end), "clGetEventProfilingInfo");
    launches.push_back({launch.file, launch.kernel, static_cast<double>(end - start) * k_milliseconds});
  }
  pending_.clear();
  return launches;
}

}  // namespace dpr
