// Transfers between host and device, counted; writes do not make the host wait while few bytes are pending.
#include <utility>

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
  constexpr const char* k_call = "clEnqueueWriteBuffer";
  bytes_to_device += bytes.size();
  const std::scoped_lock lock(writes_mutex_);
  std::erase_if(writes_, [](const PendingWrite& write) { return write.has_run(); });
  std::size_t pending = bytes.size();
  for (const PendingWrite& write : writes_) pending += write.bytes.size();
  if (pending > k_most_pending_bytes) {
    ++host_waits;
    check_cl(queue.enqueueWriteBuffer(buffer, CL_TRUE, first, bytes.size(), bytes.data()), k_call);
    return;
  }
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
  const std::scoped_lock lock(writes_mutex_);
  std::erase_if(writes_, [](const PendingWrite& write) { return write.has_run(); });
}

LentWrite::LentWrite(Device::Impl& device, const cl::Buffer& buffer, std::span<const std::byte> bytes)
    : device_(device) {
  check_cl(device.queue.enqueueWriteBuffer(buffer, CL_FALSE, 0, bytes.size(), bytes.data(), nullptr, &run_),
           "clEnqueueWriteBuffer");
  device.bytes_to_device += bytes.size();
}

LentWrite::~LentWrite() {
  if (run_.wait() != CL_SUCCESS) device_.queue.finish();
}

Mapping::Mapping(Device::Impl& device, const cl::Buffer& buffer, std::size_t bytes, cl_map_flags access)
    : device_(device), buffer_(buffer) {
  if (bytes == 0) return;
  int error = CL_SUCCESS;
  ++device.host_waits;
  data_ = device.queue.enqueueMapBuffer(buffer, CL_TRUE, access, 0, bytes, nullptr, nullptr, &error);
  check_cl(error, "clEnqueueMapBuffer");
  (access == CL_MAP_READ ? device.bytes_from_device : device.bytes_to_device) += bytes;
}

Mapping::~Mapping() {
  if (data_ != nullptr) device_.queue.enqueueUnmapMemObject(buffer_, data_);
}

void Mapping::give_back() {
  if (data_ == nullptr) return;
  check_cl(device_.queue.enqueueUnmapMemObject(buffer_, std::exchange(data_, nullptr)),
           "clEnqueueUnmapMemObject");
}

PendingReads::~PendingReads() {
  if (is_pending_ && last_.wait() != CL_SUCCESS) device_.queue.finish();  // they write to the host's memory
}

void PendingReads::start(const cl::Buffer& buffer, std::size_t first, std::span<std::byte> bytes) {
  check_cl(
      device_.queue.enqueueReadBuffer(buffer, CL_FALSE, first, bytes.size(), bytes.data(), nullptr, &last_),
      "clEnqueueReadBuffer");
  is_pending_ = true;
  device_.bytes_from_device += bytes.size();
}

void PendingReads::finish() {
  if (!is_pending_) return;
  ++device_.host_waits;
  check_cl(last_.wait(), "clWaitForEvents");
  is_pending_ = false;
}

}  // namespace dpr
