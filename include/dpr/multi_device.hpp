// Many views on several devices: CPU and GPU, several GPUs, or parts of one CPU.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "dpr/export.h"
#include "dpr/image_loss.hpp"
#include "dpr/renderer.hpp"
#include "dpr/vectors.hpp"

namespace dpr {

/// Parts of a device with `compute_units` units each (clCreateSubDevices), each with a context and a queue of
/// its own. Throws InvalidArgument if the device has fewer units, DeviceError if it cannot be divided.
DPR_API std::vector<Device> split_device(const Device& device, unsigned compute_units);

/// Renders the views of one scene on a list of devices.
///
/// The views are dealt in chunks of consecutive ones, each to the device that is free first, so every device
/// gets work according to its speed. What a chunk holds depends on the number of views alone, and the chunks'
/// gradients are added in their order: the result is bitwise the same for any number of devices of one kind,
/// and from run to run. Devices of different kinds round differently, so there the last bits depend on who
/// was free. One thread a device, for the time of a call. Not thread-safe.
class DPR_API MultiDeviceRenderer {
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
  void set_positions(std::size_t mesh, std::span<const vec3> positions);
  void set_colors(std::size_t mesh, std::span<const vec3> colors);
  void set_texels(std::size_t mesh, std::size_t texture, std::span<const vec3> texels);
  void set_texcoords(std::size_t mesh, std::span<const vec2> texcoords);
  void set_lights(const std::optional<Lights>& lights);

  /// The image of every view. Blocks, as the calls below.
  std::vector<Image> render();

  /// Gradients of sum over views and pixels of <grad_images, image>, as Renderer::backward. The images are
  /// rendered again for it: no device keeps the frames of all its chunks.
  SceneGradient gradient(std::span<const Image> grad_images);

  /// One target a view, as ImageLoss. They are uploaded where and when they are needed first, then kept.
  void set_loss(LossWeights weights, std::span<const Image> targets);

  struct Evaluation {
    double loss = 0;               ///< mean over the views
    std::vector<double> per_view;  ///< [view]
    SceneGradient gradient;
  };
  /// Images, loss and gradients in one pass over the views. Throws InvalidArgument before set_loss(), or if
  /// its targets are not one a view.
  Evaluation evaluate();

  /// How many views each device has rendered since the beginning.
  std::vector<std::size_t> views_rendered() const;

 private:
  struct DPR_LOCAL Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dpr
