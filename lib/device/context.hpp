// State of a Device: its OpenCL context and queue, the programs built for it, and the count of its memory.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/internals.hpp"
#include "device/opencl_bindings.hpp"
#include "dpr/device.hpp"
#include "dpr/error.hpp"

namespace dpr {

class Profile;

/// Throws DeviceError unless `code` is CL_SUCCESS. `where` is the call.
inline void check_cl(int code, std::string_view where) {
  if (code != CL_SUCCESS) throw DeviceError(code, std::string(where));
}

/// Bytes between host and device, and how often the host waits.
struct TransferCounts {
  std::size_t bytes_to_device = 0, bytes_from_device = 0;
  std::size_t host_waits = 0;  ///< blocking calls
};

/// May be used from several threads, except for `profile` and `before_work`.
struct Device::Impl {
  Impl() = default;
  /// Waits for the writes that are still under way.
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  cl::Device device;
  cl::Context context;
  cl::CommandQueue queue;
  DeviceInfo info;
  Profile* profile = nullptr;  ///< where launches are timed
  /// Called before a program is built, with its file, and before a kernel is launched, with its name, when
  /// everything before has run: how a trial (trial.hpp) knows what ended it.
  std::function<void(std::string_view)> before_work;
  /// True if binaries of programs are remembered (store.hpp).
  bool keeps_binaries = false;

  /// The program that holds a kernel file, built once for each set of options; or its binary, where it is
  /// remembered. Throws BuildError.
  const cl::Program& program(std::string_view name, const std::string& options);

  /// Work-items of a work-group, for kernels without barriers. Constant, because PoCL compiles a kernel anew
  /// for each work-group size.
  std::size_t local_size() const { return info.type == "cpu" ? 32 : 128; }

  /// Work-items of the groups that kernels with barriers run in: DPR_GROUP, or as many as the device allows.
  unsigned group_size = 0;

  /// To be called before a buffer is let go. oclgrind 21.10 takes a new buffer for initialised as far as an
  /// old one of the same number was, so there none is ever released.
  void before_release(const cl::Buffer& buffer) const noexcept {
    if (info.platform == "Oclgrind") clRetainMemObject(buffer());
  }

  /// Host memory that writes may hold until they have run.
  static constexpr std::size_t k_most_pending_bytes = std::size_t{1} << 24;

  /// Enqueues a write to a buffer, from a byte on. The bytes are copied, so that the host need not wait: over
  /// a network a wait costs more than the copy. Beyond k_most_pending_bytes it waits, and nothing is copied.
  void write(const cl::Buffer& buffer, std::size_t first, std::span<const std::byte> bytes);
  /// Blocks until everything enqueued before has run, and the bytes are here.
  void read(const cl::Buffer& buffer, std::size_t first, std::span<std::byte> bytes);
  /// Since the device was opened.
  TransferCounts transfers() const { return {bytes_to_device, bytes_from_device, host_waits}; }

  void count_allocated(std::size_t bytes) noexcept {
    const std::size_t now = allocated_bytes += bytes;
    std::size_t peak = peak_allocated_bytes;
    while (peak < now && !peak_allocated_bytes.compare_exchange_weak(peak, now)) {
    }
  }

  std::atomic<std::size_t> allocated_bytes = 0, peak_allocated_bytes = 0;
  std::atomic<std::size_t> bytes_to_device = 0, bytes_from_device = 0, host_waits = 0;  ///< TransferCounts
  std::atomic<std::size_t> memory_budget = 0;

 private:
  /// Bytes that a write reads until it has run.
  struct PendingWrite {
    std::vector<std::byte> bytes;
    cl::Event finished;
    bool has_run() const;
  };

  cl::Program build(std::string_view file, const std::string& options) const;

  std::mutex mutex_;
  std::map<std::string, cl::Program> programs_;
  std::mutex writes_mutex_;
  std::list<PendingWrite> writes_;
};

/// A write that reads the caller's memory, not a copy, and waits for that as it is destroyed.
class LentWrite {
 public:
  LentWrite(Device::Impl& device, const cl::Buffer& buffer, std::span<const std::byte> bytes);
  ~LentWrite();
  LentWrite(const LentWrite&) = delete;
  LentWrite& operator=(const LentWrite&) = delete;

 private:
  Device::Impl& device_;
  cl::Event run_;
};

/// Bytes from the start of a buffer in the host's memory, after everything enqueued before: where memory is shared they
/// are not copied.
class Mapping {
 public:
  /// `access`: CL_MAP_READ, or CL_MAP_WRITE_INVALIDATE_REGION, by which all of them are written anew.
  Mapping(Device::Impl& device, const cl::Buffer& buffer, std::size_t bytes, cl_map_flags access);
  ~Mapping();
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;

  void* data() const { return data_; }  ///< null where there are none
  /// Ends it. What was written is there for what is enqueued from now on.
  void give_back();

 private:
  Device::Impl& device_;
  const cl::Buffer& buffer_;
  void* data_ = nullptr;
};

/// Reads that the host waits for together. Not thread-safe.
class PendingReads {
 public:
  explicit PendingReads(Device::Impl& device) : device_(device) {}
  ~PendingReads();
  PendingReads(const PendingReads&) = delete;
  PendingReads& operator=(const PendingReads&) = delete;

  /// Does not block. The memory has to stay there until finish().
  void start(const cl::Buffer& buffer, std::size_t first, std::span<std::byte> bytes);
  /// Blocks until everything that was started is here.
  void finish();

 private:
  Device::Impl& device_;
  cl::Event last_;  // the queue is in order
  bool is_pending_ = false;
};

/// The call that allocates a buffer, as its error names it: where the device has no buffers so large, with
/// what helps.
std::string allocation_name(const DeviceInfo& info, std::size_t bytes);

/// Describes a device of a platform; index, default and lanes are filled in by list_devices().
DeviceInfo describe(const cl::Platform& platform, const cl::Device& device);

/// The text of a kernel file that is built: with what it includes in place.
std::string program_source(std::string_view file);

/// The file that holds the kernels of a frame.
constexpr std::string_view k_frame_file = "frame.cl";

/// A Device around the caller's own objects, see dpr/opencl_handles.hpp.
Device make_device(const cl::Device& device, const cl::Context& context, const cl::CommandQueue& queue);

}  // namespace dpr
