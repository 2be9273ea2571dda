// State of a SceneBatch: a renderer for each scene, and the images of all in one buffer.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "dpr/scene_batch.hpp"
#include "renderer/frame.hpp"
#include "renderer/renderer_impl.hpp"

namespace dpr {

struct SceneBatch::Impl : OnDevice {
  explicit Impl(Device device_) : OnDevice{std::move(device_)} {}

  /// Throws InvalidArgument unless there are images, of the scenes as they are; `caller` says who wants them.
  /// They are complete and side by side after that: where a frame was too large for its buffers it is
  /// rendered again.
  void require_forward(const char* caller);
  /// The images after require_forward().
  FrameImages images() const;
  /// From [view][height][width] on the device: first all backward passes, then the host reads of them.
  /// `add_to_positions`: [scene], or none.
  std::vector<SceneGradient> backward(const BufferRef<cl_float4>& grad_images,
                                      std::span<const AddToGradient> add_to_positions = {});
  /// Throws InvalidArgument unless all images are of one size and can be counted.
  void require_one_size() const;
  /// Number of all scenes' images.
  std::size_t views() const;
  std::size_t pixels_per_view() const;

  std::vector<Renderer> renderers;    // [scene]
  std::vector<std::uint64_t> frames;  // [scene] of the last forward(); empty: none
  std::uint64_t frame_number = 0;     // of the batch as a whole
  bool is_gathered = false;           // `image` holds it
  Buffer<cl_float4> image;            // [view][height][width] RGBA
  Buffer<cl_float4> host_grad_images;
};

}  // namespace dpr
