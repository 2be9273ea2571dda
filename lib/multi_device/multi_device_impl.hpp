// State of a MultiDeviceRenderer: the scene, a renderer for each device, and the devices' measured speeds.
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include "dpr/multi_device.hpp"
#include "multi_device/chunk_dealer.hpp"
#include "renderer/mesh_arrays.hpp"

namespace dpr {

/// Number of times that each part of the scene has been set.
struct Versions {
  std::uint64_t scene = 0, smoothing = 0, lights = 0;
  std::map<ArrayRef, std::uint64_t> arrays = {};  // since the scene
};

/// A LossOptions that has what it speaks of.
struct OwnLoss {
  struct Attributes {
    Attribute attribute;
    LossWeights weights;
    std::vector<Image> targets;  // [view]
  };

  static OwnLoss of(const LossOptions& options, std::span<const Image> targets);
  LossWeights weights;
  std::vector<unsigned char> has_alpha;  // [view] or none
  std::vector<Image> masks, targets;     // [view] or none; [view]
  unsigned levels = 1;
  std::vector<Attributes> attributes;

  /// Makes the loss of a chunk's views.
  ImageLoss make(const Device& device, const Chunk& chunk) const;
};
struct OwnMeshLoss {
  MeshLossWeights weights;
  std::size_t mesh;
};

/// Setters change what is here. A device's renderer catches up before its next chunk, so that an error of one
/// device leaves no two of them with different scenes.
struct MultiDeviceRenderer::Impl {
  /// A device's renderer, which version of the scene it has, and the losses of the chunks it has met.
  struct Worker {
    explicit Worker(const Device& device) : renderer(device) {}
    Renderer renderer;
    Versions has;
    std::uint64_t losses_of = 0, mesh_loss_of = 0;
    std::map<std::pair<std::size_t, std::size_t>, ImageLoss> losses;  // by the chunk's first and last view
    std::optional<MeshLoss> mesh_loss;
    std::size_t views_rendered = 0;
  };

  std::vector<Worker> workers;
  std::vector<Pace> paces;  // [worker]
  std::vector<bool> lost;   // [worker]
  std::vector<std::string> notes;
  Scene scene;
  Versions now;
  std::vector<View> views;
  std::size_t chunk_views = 0;  // of set_chunk()
  OwnLoss loss;
  std::optional<OwnMeshLoss> mesh_loss;
  std::uint64_t losses = 0, mesh_losses = 0;  // how often they have been set

  /// Brings a device's renderer up to what has been set, with those views, the first of that number.
  void catch_up(Worker& worker, std::span<const View> its_views, std::size_t first_view);

  void require_views(const char* caller) const;

  /// Chunks of `count` views, the same for every list of devices. No chunk exceeds a frame's limit of views.
  std::vector<Chunk> chunks_of(std::size_t count) const;

  /// Some of the views, in chunks.
  struct Batch {
    std::size_t first;
    std::vector<Chunk> chunks;  // counted from `first`

    Chunk views_of(std::size_t chunk) const {
      return {first + chunks[chunk].first, first + chunks[chunk].last};
    }
  };
  Batch batch(std::size_t first, std::size_t count) const { return {first, chunks_of(count)}; }
  Batch all_views() const { return batch(0, views.size()); }

  using Work = std::function<void(Worker&, std::size_t chunk)>;

  /// Renders every chunk of a batch on the device that it is dealt to, then does `work` there. Errors that
  /// are not a device's are thrown when all are done, the first in the order of the chunks.
  void for_each_chunk(const Batch& of, const Work& work);

  void render(Worker& worker, const Batch& of, std::size_t chunk);

  /// Notes which devices are lost; where all are, throws what the first has met and forgets that.
  void settle_losses(const ChunkDealer& dealer, const std::vector<std::exception_ptr>& met);

  /// The losses of a chunk and of the mesh, as a device has them. Of chunks that overlap it keeps one, so
  /// that no target is there twice.
  ImageLoss& loss_of(Worker& worker, const Batch& of, std::size_t chunk) const;

  MeshLoss& mesh_loss_of(Worker& worker) const;
};

}  // namespace dpr
