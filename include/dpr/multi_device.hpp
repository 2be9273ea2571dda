// Many views on several devices: CPU and GPU, several GPUs, or parts of one CPU.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "dpr/export.h"
#include "dpr/image_loss.hpp"
#include "dpr/mesh_loss.hpp"
#include "dpr/renderer.hpp"
#include "dpr/vectors.hpp"

namespace dpr {

/// Parts of a device (clCreateSubDevices) with `compute_units` units each, with contexts and queues of their
/// own. Throws InvalidArgument if it has fewer units, DeviceError if it cannot be divided (PoCL 7 in Debian).
DPR_API std::vector<Device> split_device(const Device& device, unsigned compute_units);

/// Opens a list of devices: selectors as open_device() takes them, separated by commas. Each takes the first
/// that matches and that none before it has taken, so that "gpu,gpu" are the first two GPUs. "cpu/2" are two
/// equal parts of the CPU, by split_device(). A name may hold a comma or a slash: what names a device as it
/// stands is that device. "" is open_device(""), or the list that DPR_DEVICE holds. Throws as open_device(),
/// and as split_device() with more parts than units.
DPR_API std::vector<Device> open_devices(const std::string& selectors);

/// Renders the views of one scene on a list of devices.
///
/// The views are dealt in chunks of consecutive ones, each to the device that is free first. A device so slow
/// that the others would be done with all that is left before it is with one chunk gets none, as its times so
/// far have it. What a chunk holds depends on the number of views and on set_chunk() alone, and the chunks'
/// gradients are added in their order: the result is bitwise the same for any number of devices of one kind,
/// whatever their speeds and whichever of them are lost, and from run to run. Devices are of one kind if each
/// alone gives the same bits. Others round differently, so there the last bits depend on who was free.
///
/// A device on which a call fails, with DeviceError or BuildError, is lost: the others do its chunks, and it
/// gets none any more. Where all are, the error of the first is thrown, and the next call tries all again. A
/// device that neither answers nor fails is waited for.
///
/// One thread a device, for the time of a call. Not thread-safe.
class DPR_API MultiDeviceRenderer : public ArraySetters<MultiDeviceRenderer> {
 public:
  /// Throws InvalidArgument if there is no device, or the same Device twice: each needs a queue of its own.
  explicit MultiDeviceRenderer(std::vector<Device> devices);
  ~MultiDeviceRenderer();
  MultiDeviceRenderer(MultiDeviceRenderer&&) noexcept;
  MultiDeviceRenderer& operator=(MultiDeviceRenderer&&) noexcept;

  /// As Renderer's, and checked as there; what fails on a device is thrown by the call that renders there.
  void set_scene(const Scene& scene);
  void set_views(std::span<const View> views);
  void set_smoothing(const Smoothing& smoothing);
  void set_array(const ArrayRef& array, const ArrayValues& values);
  void set_lights(const std::optional<Lights>& lights);

  /// Views that a device renders together; 0, as at the beginning: a twelfth of them. Small chunks keep
  /// all devices busy to the end, large ones keep a large device busy. Sums over views round as the chunks
  /// are cut.
  void set_chunk(std::size_t views);

  /// The image of every view. Blocks, as the calls below.
  std::vector<Image> render();

  /// Gradients of sum over views and pixels of <grad_images, image>, as Renderer::backward. The images are
  /// rendered again for it: no device keeps the frames of all its chunks.
  SceneGradient gradient(std::span<const Image> grad_images);

  /// One target a view, as ImageLoss, of attributes too. They are uploaded where and when they are needed
  /// first, then kept until the next set_loss(), or until views are dealt in other chunks that share some
  /// with theirs. Each device may come to hold those of all views, once: plan as for an ImageLoss of all on
  /// each.
  void set_loss(const LossOptions& options, std::span<const Image> targets);
  void set_loss(LossWeights weights, std::span<const Image> targets);
  /// A loss of a mesh's shape alone, as MeshLoss, until the next set_scene(): its gradient joins that of the
  /// images. Throws InvalidArgument if there is no such mesh, or no gradient of positions in the scene.
  void set_mesh_loss(const MeshLossWeights& weights, std::size_t mesh = 0);

  struct Evaluation {
    double loss = 0;               ///< of the images: mean over the views
    double mesh_loss = 0;          ///< of set_mesh_loss()
    std::vector<double> per_view;  ///< [view]
    SceneGradient gradient;
  };
  /// Images, losses and gradients in one pass over the views; no image leaves its device. Throws
  /// InvalidArgument before set_loss(), or if its targets are not one a view.
  Evaluation evaluate();
  /// The same of the views [first, first + count), as if there were no others: a batch of a descent. Throws
  /// InvalidArgument if they are none, or not among the views.
  Evaluation evaluate(std::size_t first, std::size_t count);

  /// Number of views that each device has rendered since the beginning.
  std::vector<std::size_t> views_rendered() const;
  /// A sentence for every device that was lost since this was last called.
  std::vector<std::string> take_notes();

 private:
  struct DPR_LOCAL Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dpr
