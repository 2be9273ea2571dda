// A typed device buffer that only grows, and a read of one that the host need not wait for.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>
#include <stdexcept>
#include <vector>

#include "device/context.hpp"

namespace dpr {

/// Room to make for elements that may become more from frame to frame.
constexpr std::size_t with_headroom(std::size_t count) { return count + count / 4; }

/// An index or a count, as kernels take it. Throws std::logic_error for what 32 bits do not hold: the checks
/// of sizes come before.
inline cl_uint to_uint(std::size_t value) {
  if (value > std::numeric_limits<cl_uint>::max()) throw std::logic_error("an index of more than 32 bits");
  return static_cast<cl_uint>(value);
}

/// Elements of the widest vector of lanes.
inline constexpr std::size_t k_widest_vector = 16;

/// Number of a buffer's elements, or an upper bound where so far only the device knows the number; and
/// whether it is likely to be another one in the next frame, by a little.
struct Length {
  Length(std::size_t count_) : count(count_) {}
  static Length at_most(std::size_t count) {
    Length length(count);
    length.is_known = false;
    return length;
  }
  static Length varying(std::size_t count) {
    Length length(count);
    length.varies = true;
    return length;
  }

  /// Elements of a buffer that is allocated for the first time: with headroom for lengths that vary between
  /// frames, so that the next frame, whose capacity includes that headroom, finds room.
  std::size_t first_room() const { return varies || !is_known ? with_headroom(count) : count; }

  std::size_t count;
  bool is_known = true, varies = false;
};

/// Elements of T on a device. Movable. Capacity is rounded up so that a kernel may load a whole vector of
/// lanes at the last element; what lies behind size() cannot be read. A buffer whose length only the device
/// knows has no size() and cannot be read before settle().
template <class T>
class Buffer {
 public:
  using Element = T;

  Buffer() = default;
  Buffer(Device::Impl& device, std::size_t count) { resize(device, count); }
  Buffer(Device::Impl& device, std::span<const T> values) { upload(device, values); }
  ~Buffer() { release(); }
  Buffer(Buffer&& other) noexcept { swap(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    swap(other);
    return *this;
  }

  /// Makes room and forgets the content if it has to grow; growth leaves headroom, so that sizes that vary
  /// from frame to frame settle. Where it throws, the buffer is empty.
  void resize(Device::Impl& device, Length length) {
    if (length.count > 0 && length.count + k_padding > capacity_)
      allocate(device, capacity_ == 0 ? length.first_room() : with_headroom(length.count));
    length_ = length;
  }

  /// The length, now that the device's count is known. Nothing where the length was known.
  void settle(std::size_t count) {
    if (length_.is_known) return;
    if (count > length_.count) throw std::logic_error("a buffer holds more than there is room for");
    length_ = count;
  }

  void upload(Device::Impl& device, std::span<const T> values) {
    resize(device, values.size());
    if (values.empty()) return;
    device.write(buffer_, 0, std::as_bytes(values));
  }

  /// Blocks until everything enqueued before has run. Throws std::logic_error for elements that are not
  /// there.
  void download(std::span<T> values, std::size_t first = 0) const {
    check_read(values.size(), first);
    if (!values.empty()) device_->read(buffer_, first * sizeof(T), std::as_writable_bytes(values));
  }
  /// The same as one of several reads, which does not block.
  void download(std::span<T> values, std::size_t first, PendingReads& reads) const {
    check_read(values.size(), first);
    if (!values.empty()) reads.start(buffer_, first * sizeof(T), std::as_writable_bytes(values));
  }
  std::vector<T> download() const {
    std::vector<T> values(size());
    download(values);
    return values;
  }

  void fill(const T& value) {
    if (size() == 0) return;
    check_cl(device_->queue.enqueueFillBuffer(buffer_, value, 0, size() * sizeof(T)), "clEnqueueFillBuffer");
  }

  /// Copies everything on the device, to where `other` has room for it from element `first` on.
  void copy_to(Buffer& other, std::size_t first = 0) const {
    if (size() == 0) return;
    check_cl(
        device_->queue.enqueueCopyBuffer(buffer_, other.buffer_, 0, first * sizeof(T), size() * sizeof(T)),
        "clEnqueueCopyBuffer");
  }

  /// Throws std::logic_error where only the device knows.
  std::size_t size() const {
    if (!length_.is_known) throw std::logic_error("a buffer's length is asked for before it is known");
    return length_.count;
  }
  Length length() const { return length_; }
  /// Number of elements that fit without growing.
  std::size_t capacity() const { return capacity_ - std::min(capacity_, 2 * k_padding); }
  std::size_t capacity_bytes() const { return capacity_ * sizeof(T); }
  const cl::Buffer& cl_buffer() const { return buffer_; }
  Device::Impl* device() const { return device_; }  ///< null while nothing is allocated

 private:
  static constexpr std::size_t k_padding = k_widest_vector;

  void check_read(std::size_t count, std::size_t first) const {
    if (first > size() || count > size() - first)
      throw std::logic_error("more is read of a buffer than it holds");
  }

  void allocate(Device::Impl& device, std::size_t count) {
    release();  // before there is a new one, so that both need not fit
    const std::size_t capacity = (count / k_padding + 2) * k_padding;
    int error = CL_SUCCESS;
    cl::Buffer buffer(device.context, CL_MEM_READ_WRITE, capacity * sizeof(T), nullptr, &error);
    if (error != CL_SUCCESS) throw DeviceError(error, allocation_name(device.info, capacity * sizeof(T)));
    buffer_ = std::move(buffer);
    device_ = &device;
    capacity_ = capacity;
    device.count_allocated(capacity_bytes());
  }

  void release() noexcept {
    if (device_ != nullptr) {
      device_->allocated_bytes -= capacity_bytes();
      device_->before_release(buffer_);
    }
    buffer_ = cl::Buffer();
    device_ = nullptr;
    capacity_ = 0;
    length_ = 0;
  }

  void swap(Buffer& other) noexcept {
    std::swap(device_, other.device_);
    std::swap(buffer_, other.buffer_);
    std::swap(capacity_, other.capacity_);
    std::swap(length_, other.length_);
  }

  Device::Impl* device_ = nullptr;
  cl::Buffer buffer_;
  std::size_t capacity_ = 0;
  Length length_ = 0;
};

/// All elements of a buffer in the host's memory; see Mapping.
template <class T>
class MappedRead {
 public:
  explicit MappedRead(const Buffer<T>& buffer)
      : size_(buffer.size()),
        mapping_(*buffer.device(), buffer.cl_buffer(), size_ * sizeof(T), CL_MAP_READ) {}

  const T& operator[](std::size_t i) const { return static_cast<const T*>(mapping_.data())[i]; }
  std::size_t size() const { return size_; }

 private:
  std::size_t size_;
  Mapping mapping_;
};

/// Writes all elements of a buffer: `write(std::span<T>)` is called once.
template <class T, class Write>
void overwrite(const Buffer<T>& buffer, const Write& write) {
  if (buffer.size() == 0) return;
  Mapping mapping(*buffer.device(), buffer.cl_buffer(), buffer.size() * sizeof(T),
                  CL_MAP_WRITE_INVALIDATE_REGION);
  write(std::span(static_cast<T*>(mapping.data()), buffer.size()));
  mapping.give_back();
}

/// A buffer as the argument of a kernel: one of ours, or a caller's that holds as many elements. Valid as
/// long as that.
template <class T>
class BufferRef {
 public:
  BufferRef(const Buffer<T>& buffer) : handle_(buffer.cl_buffer()()) {}
  explicit BufferRef(cl_mem handle) : handle_(handle) {}

  cl_mem handle() const { return handle_; }

 private:
  cl_mem handle_;
};

/// One element of a buffer on its way to the host.
template <class T>
class PendingRead {
 public:
  PendingRead() = default;
  ~PendingRead() {
    // It writes here.
    if (device_ != nullptr && arrived_.wait() != CL_SUCCESS) device_->queue.finish();
  }
  PendingRead(const PendingRead&) = delete;
  PendingRead& operator=(const PendingRead&) = delete;

  bool is_started() const { return device_ != nullptr; }

  /// Does not block. What an earlier start() was to read is lost.
  void start(const Buffer<T>& buffer, std::size_t index) {
    Device::Impl* const device = buffer.device();
    check_cl(device->queue.enqueueReadBuffer(buffer.cl_buffer(), CL_FALSE, index * sizeof(T), sizeof(T),
                                             &value_, nullptr, &arrived_),
             "clEnqueueReadBuffer");
    device_ = device;
    device->bytes_from_device += sizeof(T);
    check_cl(device->queue.flush(), "clFlush");
  }

  /// Blocks until it has arrived, but not for what was enqueued after it. Where it throws, it may be called
  /// again.
  T take() {
    ++device_->host_waits;
    check_cl(arrived_.wait(), "clWaitForEvents");
    device_ = nullptr;
    return value_;
  }

  /// Whether take_arrived() may be called. Does not block.
  bool has_arrived() const {
    return is_started() && arrived_.getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>() <= CL_COMPLETE;
  }

  /// Does not block. Throws DeviceError for a read that failed, which is then as if it had not been started.
  T take_arrived() {
    device_ = nullptr;
    check_cl(std::min(arrived_.getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>(), CL_COMPLETE),
             "clEnqueueReadBuffer");
    return value_;
  }

 private:
  Device::Impl* device_ = nullptr;
  cl::Event arrived_;
  T value_{};
};

}  // namespace dpr
