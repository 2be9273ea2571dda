// Times of a device's kernels, by OpenCL's own events.
#pragma once

#include <string>
#include <vector>

#include "device/context.hpp"

namespace dpr {

/// Times every launch on a device as long as it lives. Its queue is replaced by one that measures, and put
/// back at the end. Where there is none, a launch costs one comparison more. One at a time for a device; not
/// thread-safe.
class Profile {
 public:
  struct Launch {
    std::string file, kernel;  ///< "rasterize.cl", "rasterize_forward"
    double milliseconds = 0;   ///< from start to end on the device, without the wait in the queue
  };

  /// Throws DeviceError where the device cannot measure.
  explicit Profile(const Device& device);
  virtual ~Profile();
  Profile(const Profile&) = delete;
  Profile& operator=(const Profile&) = delete;

  /// Called by every launch.
  virtual void record(const std::string& file, const std::string& kernel, const cl::Event& finished);

  /// The launches since the last call, in their order. Waits for them.
  std::vector<Launch> take();

 private:
  struct Pending {
    std::string file, kernel;
    cl::Event finished;
  };

  Device device_;
  cl::CommandQueue replaced_;
  std::vector<Pending> pending_;
};

}  // namespace dpr
