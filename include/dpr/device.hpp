// Choosing an OpenCL device.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "dpr/export.h"

namespace dpr {

struct DeviceInfo {
  std::size_t index = 0;  ///< position in list_devices()
  std::string platform, name, vendor, version, driver;
  std::string type;  ///< "cpu", "gpu" or "accelerator"
  unsigned compute_units = 0;
  std::size_t memory_bytes = 0;
  std::size_t max_allocation_bytes = 0;
  unsigned lanes = 1;               ///< width of the vectors the kernels are built with
  bool shares_host_memory = false;  ///< as CPUs and integrated GPUs do
  /// Time of a small frame and its gradients, as remembered from the device's first use; 0: not known.
  double frame_milliseconds = 0;
  bool is_default = false;     ///< what open_device("") takes, if it can be used
  std::string default_reason;  ///< why it is the default; empty for the others
  /// Devices that were preferred to an opened default and could not be used, each with its reason, a
  /// sentence.
  std::vector<std::string> passed_over;
};

/// Every OpenCL device of every platform, in the order of the ICD loader; empty where there is none. Devices
/// that do not say what they are, and those of platforms that do not answer, are left out. Throws DeviceError
/// if for that reason no device is left.
DPR_API std::vector<DeviceInfo> list_devices();

/// A device with its context, its queue and its cache of built kernels. A cheap handle: copies share them,
/// and they live as long as the last copy. One Device may serve several renderers, each on a thread of its
/// own; their work shares its queue.
class DPR_API Device {
 public:
  /// The device's state; lib/device/context.hpp, and opencl.hpp for embedding.
  struct DPR_LOCAL Impl;

  explicit Device(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}

  const DeviceInfo& info() const;
  /// Bytes held in buffers by everything that uses this device, now and at the most.
  std::size_t allocated_bytes() const;
  std::size_t peak_allocated_bytes() const;

  /// Memory for the fragments of a frame and, with noise on the pixel, for its samples, bytes. Unless set: a quarter
  /// of the device's; of a CPU's, which is the whole machine's, an eighth and at most 1 GiB. A frame with more of
  /// either is rendered in bands of tile rows, or of parts of one, forward and backward, with the same results bit by
  /// bit. In bands of samples each have half of the budget; samples no less than 144 lines of the raster take, at 147
  /// to 167 bytes a sample: so 512x512 pixels of 4x4 samples fit less than 100 MB. All samples are held, whatever the
  /// budget, for auxiliary outputs, tangents, Renderer::samples() and resolve(), and Monte Carlo noise of the pixel.
  /// What grows with the scene, the image and the number of triangles in each tile comes on top.
  std::size_t memory_budget() const;
  /// Sets the budget of all renderers on the device. Their next forward() throws InvalidArgument if one tile
  /// of 8x8 pixels does not fit. Throws InvalidArgument for 0.
  void set_memory_budget(std::size_t bytes);

 private:
  friend struct Internals;
  std::shared_ptr<Impl> impl_;
};

/// Opens a device: "" takes the environment variable DPR_DEVICE, or else the best that can be used: a GPU,
/// one with memory of its own before others, or else an accelerator, or else a CPU; "cpu" and "gpu" take the
/// first of that type; a number the index in list_devices(); anything else the first whose platform, name or
/// version contains it, ignoring case. Of several devices the best are tried with a small kernel first: one
/// that cannot be used is passed over, and the DeviceInfo of the device opened says so. Among equals the
/// fastest is taken. The first use of a driver tries the kernels of a frame in a process of its own, the dpr
/// command, if that is installed with the library, and remembers how they fared: a driver that aborts does
/// not end this process, narrower lanes or the next device are used instead (DPR_TRIAL=off: no trial;
/// DPR_CACHE_DIR: where it is remembered). Results are bitwise the same on one device only: others round
/// differently. Throws InvalidArgument if none matches, DeviceError if none exists or the driver fails at
/// every width.
DPR_API Device open_device(const std::string& selector = "");

}  // namespace dpr
