// A typed device buffer that only grows, and a read of one that the host need not wait for.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "device/context.hpp"

namespace dpr {

/// Room to make for elements that may become more from frame to frame.
constexpr std::size_t with_headroom(std::size_t count) { return count + count / 4; }

/// Elements of T on a device. Movable. Capacity is rounded up so that a kernel may load a whole vector of
/// lanes at the last element; what lies behind size() is never read as a result.
template <class T>
class Buffer {
 public:
  Buffer() = default;
  Buffer(Device::Impl& device, std::size_t count) { resize(device, count); }
  Buffer(Device::Impl& device, std::span<const T> values) { upload(device, values); }
  ~Buffer() { release(); }
  Buffer(Buffer&& other) noexcept { swap(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    swap(other);
    return *this;
  }

  /// Makes room for `count` elements and forgets the content if it has to grow; growth leaves headroom, so
  /// that sizes that vary from frame to frame settle.
  void resize(Device::Impl& device, std::size_t count) {
    if (count > capacity_) {
      allocate(device, capacity_ == 0 ? count : with_headroom(count));
    }
    size_ = count;
  }

  void upload(Device::Impl& device, std::span<const T> values) {
    resize(device, values.size());
    if (values.empty()) return;
    check_cl(device.queue.enqueueWriteBuffer(buffer_, CL_TRUE, 0, values.size_bytes(), values.data()),
             "clEnqueueWriteBuffer");
  }

  /// Blocks until everything enqueued before has run.
  void download(std::span<T> values, std::size_t first = 0) const {
    if (values.empty()) return;
    ++device_->host_waits;
    check_cl(device_->queue.enqueueReadBuffer(buffer_, CL_TRUE, first * sizeof(T), values.size_bytes(),
                                              values.data()),
             "clEnqueueReadBuffer");
  }
  std::vector<T> download() const {
    std::vector<T> values(size_);
    download(values);
    return values;
  }

  void fill(const T& value) {
    if (size_ == 0) return;
    check_cl(device_->queue.enqueueFillBuffer(buffer_, value, 0, size_ * sizeof(T)), "clEnqueueFillBuffer");
  }

  /// Copies everything on the device; `other` must be as large.
  void copy_to(Buffer& other) const {
    if (size_ == 0) return;
    check_cl(device_->queue.enqueueCopyBuffer(buffer_, other.buffer_, 0, 0, size_ * sizeof(T)),
             "clEnqueueCopyBuffer");
  }

  std::size_t size() const { return size_; }
  /// Elements that it was made for at least, without the rounding.
  std::size_t room() const { return capacity_ - std::min(capacity_, 2 * k_padding); }
  std::size_t capacity_bytes() const { return capacity_ * sizeof(T); }
  const cl::Buffer& cl_buffer() const { return buffer_; }
  Device::Impl* device() const { return device_; }  ///< null while nothing is allocated

 private:
  static constexpr std::size_t k_padding = 16;  // the widest vector

  void allocate(Device::Impl& device, std::size_t count) {
    release();
    const std::size_t capacity = (count / k_padding + 2) * k_padding;
    int error = CL_SUCCESS;
    buffer_ = cl::Buffer(device.context, CL_MEM_READ_WRITE, capacity * sizeof(T), nullptr, &error);
    check_cl(error, "clCreateBuffer of " + std::to_string(capacity * sizeof(T)) + " bytes");
    device_ = &device;
    capacity_ = capacity;
    device.allocated_bytes += capacity_bytes();
    device.peak_allocated_bytes = std::max(device.peak_allocated_bytes, device.allocated_bytes);
  }

  void release() {
    if (device_ != nullptr) {
      device_->allocated_bytes -= capacity_bytes();
      device_->before_release(buffer_);
    }
    buffer_ = cl::Buffer();
    device_ = nullptr;
    capacity_ = size_ = 0;
  }

  void swap(Buffer& other) noexcept {
    std::swap(device_, other.device_);
    std::swap(buffer_, other.buffer_);
    std::swap(capacity_, other.capacity_);
    std::swap(size_, other.size_);
  }

  Device::Impl* device_ = nullptr;
  cl::Buffer buffer_;
  std::size_t capacity_ = 0, size_ = 0;
};

/// One element of a buffer on its way to the host.
template <class T>
class PendingRead {
 public:
  PendingRead() = default;
  ~PendingRead() {
    if (device_ != nullptr) arrived_.wait();  // it writes here
  }
  PendingRead(const PendingRead&) = delete;
  PendingRead& operator=(const PendingRead&) = delete;

  /// Does not block. What an earlier start() was to read is lost.
  void start(const Buffer<T>& buffer, std::size_t index) {
    device_ = buffer.device();
    check_cl(device_->queue.enqueueReadBuffer(buffer.cl_buffer(), CL_FALSE, index * sizeof(T), sizeof(T),
                                              &value_, nullptr, &arrived_),
             "clEnqueueReadBuffer");
    check_cl(device_->queue.flush(), "clFlush");
  }

  bool is_pending() const { return device_ != nullptr; }

  /// Blocks until it has arrived, but not for what was enqueued after it.
  T take() {
    ++device_->host_waits;
    device_ = nullptr;
    check_cl(arrived_.wait(), "clWaitForEvents");
    return value_;
  }

 private:
  Device::Impl* device_ = nullptr;
  cl::Event arrived_;
  T value_{};
};

}  // namespace dpr
