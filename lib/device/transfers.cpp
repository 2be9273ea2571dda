// Transfers between host and device, counted; small writes do not make the host wait.
#include "device/context.hpp"

namespace dpr {

bool Device::Impl::PendingWrite::has_run() const {
  cl_int status = CL_QUEUED;
  return finished.getInfo(CL_EVENT_COMMAND_EXECUTION_STATUS, &status) == CL_SUCCESS && status <= CL_COMPLETE;
}

Device::Impl::~Impl() {
  if (!writes_.empty()) writes_.back().finished.wait();  // the queue is in order: the others have run by then
}

void Device::Impl::write(const cl::Buffer& buffer, std::size_t first, std::span<const std::byte> bytes) {
  constexpr std::size_t k_most_copied = std::size_t{1} << 20;
  constexpr const char* k_call = "clEnqueueWriteBuffer";
  bytes_to_device += bytes.size();
  if (bytes.size() > k_most_copied) {
    ++host_waits;
    check_cl(queue.enqueueWriteBuffer(buffer, CL_TRUE, first, bytes.size(), bytes.data()), k_call);
    return;
  }
  const std::scoped_lock lock(writes_mutex_);
  std::erase_if(writes_, [](const PendingWrite& write) { return write.has_run(); });
  writes_.push_back({std::vector(bytes.begin(), bytes.end()), cl::Event()});
  PendingWrite& write = writes_.back();
  const int error = queue.enqueueWriteBuffer(buffer, CL_FALSE, first, bytes.size(), write.bytes.data(),
                                             nullptr, &write.finished);
  if (error != CL_SUCCESS) writes_.pop_back();
  check_cl(error, k_call);
}

void Device::Impl::read(const cl::Buffer& buffer, std::size_t first, std::span<std::byte> bytes) {
  ++host_waits;
  bytes_from_device += bytes.size();
  check_cl(queue.enqueueReadBuffer(buffer, CL_TRUE, first, bytes.size(), bytes.data()),
           "clEnqueueReadBuffer");
}

}  // namespace dpr
