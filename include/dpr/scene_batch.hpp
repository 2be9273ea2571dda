// Scenes that share nothing but the size of their images, as one batch.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "dpr/device.hpp"
#include "dpr/export.h"
#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/mesh_loss.hpp"
#include "dpr/renderer.hpp"
#include "dpr/scene.hpp"
#include "dpr/vectors.hpp"

namespace dpr {

/// Renders scenes of one image size, each with meshes, textures, lights, cameras, background and smoothing of
/// its own, to images that lie side by side: for a loss and for buffers they are the views of one renderer,
/// the first scene's first. Images and gradients are those of a Renderer for each scene, to the bit; sampled
/// noise too, which each scene counts for itself.
///
/// It is a Renderer for each scene, of which the frames are enqueued without a wait between them, forward and
/// backward: memory and launches grow with the scenes. What shares meshes and lights is faster as the views
/// of one Renderer, in the same launches, and so are shapes of one topology by Renderer::set_shapes(). The
/// device's memory budget bounds the fragments of every scene's frame. Not thread-safe; movable.
class DPR_API SceneBatch {
 public:
  explicit SceneBatch(Device device);
  ~SceneBatch();
  SceneBatch(SceneBatch&&) noexcept;
  SceneBatch& operator=(SceneBatch&&) noexcept;

  /// Validates and uploads the scenes, at least one; each has the view of its own camera. Throws
  /// InvalidArgument, with the number of the scene that cannot be rendered or differs in its images' size,
  /// and keeps the scenes there were; where a device fails there are none.
  void set_scenes(std::span<const Scene> scenes);

  /// Number of scenes, and of the images of all of them.
  std::size_t scenes() const;
  std::size_t views() const;
  /// A scene's own renderer, for its setters, of views, positions, lights and so on, and for losses of its
  /// meshes. What it sets is in force with the batch's next forward(). Its set_scene() is for images of the
  /// same size. Throws InvalidArgument for a scene that is not there.
  Renderer& renderer(std::size_t scene);

  /// Renders every scene. Waits where Renderer::forward() does. Throws InvalidArgument without scenes, or
  /// where a scene's images are of another size now.
  void forward();
  /// An image of the last forward(), counted through all scenes. Blocks. Throws InvalidArgument before, or
  /// after a scene has been set or rendered by its own renderer since, as do the calls below.
  Image image(std::size_t view) const;
  /// All images at once, [view][height][width], RGBA. Blocks.
  void read_pixels(std::span<vec4> pixels) const;

  /// Every scene's gradients of the sum over its images and pixels of <grad_images, image>, RGBA, as
  /// Renderer::backward(). One image a view, of the batch's size. [scene]
  std::vector<SceneGradient> backward(std::span<const Image> grad_images);
  /// The same from [view][height][width], RGBA.
  std::vector<SceneGradient> backward_pixels(std::span<const vec4> grad_pixels);
  /// The same for a loss that was evaluated on the last forward(); its gradient never leaves the device.
  std::vector<SceneGradient> backward(const ImageLoss& loss);
  /// The same, with the gradient of a mesh's own loss added in every scene that has one: [scene], each
  /// evaluated on the scene's own renderer, or nullptr. Throws InvalidArgument if such a scene asks for no
  /// positions' gradient.
  std::vector<SceneGradient> backward(const ImageLoss& loss, std::span<const MeshLoss* const> mesh_losses);

  /// Summed over the scenes, with what the batch holds itself.
  RenderStatistics statistics() const;
  const Device& device() const;

  struct DPR_LOCAL Impl;

 private:
  friend struct Internals;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dpr
