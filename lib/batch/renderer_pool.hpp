// Renderers of a device, lent to frames and kept for frames to come.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "batch/named_arrays.hpp"
#include "dpr/attribute_images.hpp"
#include "dpr/renderer.hpp"
#include "dpr/texture.hpp"

namespace dpr::batch {

using Faces = std::vector<glm::uvec3>;

/// A texture without its texels.
struct TextureForm {
  int width = 0, height = 0;
  Wrap wrap = Wrap::repeat;
  Filter filter = Filter::bilinear;
  bool has_opacities = false;

  bool operator==(const TextureForm&) const = default;
};

/// Textures, materials and opacities without their numbers, as a Mesh (dpr/mesh.hpp) has them; empty: none.
struct Surface {
  std::size_t texcoords = 0, materials = 0, vertex_opacities = 0, face_opacities = 0;  ///< how many there are
  Faces face_texcoords;
  std::vector<TextureForm> textures;
  std::vector<std::uint32_t> face_textures, face_materials;
};

/// Makes room in a mesh without: numbers are yet to come.
void add_surface(Mesh& mesh, const Surface& surface);

/// Contents of the device that a renderer keeps from one batch to the next. Valid as long as the caller's
/// array of faces is.
struct Topology {
  NamedArray faces;
  std::size_t views_of_faces = 1;  ///< see Renderer::Impl::set_scene()
  std::size_t vertices = 0;        ///< of a view
  bool face_colors = false;
  int width = 0, height = 0;
  Surface surface;

  /// True if this is the topology of a renderer's scene, which set() has set. Copies nothing.
  bool is_of(const Renderer& renderer) const;
  /// Sets a renderer's scene; numbers are yet to come. Throws InvalidArgument for what is no index.
  void set(Renderer& renderer) const;
};

/// Opens a device, as dpr::open_device(). OpenCL does not survive fork(): in a process that was forked from
/// the one that opened a device this throws InvalidArgument, as RendererPool::take() does.
Device open_device_of_process(const std::string& selector);

/// A renderer, and those of the attributes that were asked of its frames.
struct PooledRenderer {
  Renderer renderer;
  std::map<Attribute, AttributeImages> attributes = {};
};

/// Lends renderers whose scene is of a topology. Kept are those given back last: as many as were ever lent at
/// once, but at least k_least. Safe to use from several threads.
class RendererPool {
 public:
  explicit RendererPool(Device device) : state_(std::make_unique<State>(std::move(device))) {}
  ~RendererPool();
  RendererPool(const RendererPool&) = delete;
  RendererPool& operator=(const RendererPool&) = delete;

  PooledRenderer take(const Topology& topology);
  void put_back(PooledRenderer renderer);
  /// Waits for what the device is doing, and forgets the renderers that are kept, with what they hold there.
  void clear();

 private:
  static constexpr std::size_t k_least = 8;

  struct State {
    explicit State(Device device_) : device(std::move(device_)) {}
    Device device;
    std::list<PooledRenderer> free;  // the last one was given back last
    std::size_t lent = 0, most_lent = k_least;
  };

  std::mutex mutex_;
  std::unique_ptr<State> state_;
};

/// Renderers by the name of their device, for as long as the process lives: OpenCL may be gone before objects
/// that the process destroys as it ends. Safe to use from several threads.
class RendererPools {
 public:
  static RendererPools& of_process();

  /// Opens the device at first, as open_device_of_process().
  std::shared_ptr<RendererPool> get(const std::string& device);
  /// Clears all pools.
  void clear();

 private:
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<RendererPool>> pools_;
};

/// A rendered batch: the renderer whose buffers hold what the backward pass differentiates, until it is given
/// back.
class Frame {
 public:
  Frame(std::shared_ptr<RendererPool> pool, const Topology& topology);
  ~Frame();
  Frame(const Frame&) = delete;
  Frame& operator=(const Frame&) = delete;

  /// Throws InvalidArgument in a process that was forked.
  Renderer& renderer();
  /// Images of that renderer's device, made when first asked for. Throws as renderer().
  AttributeImages& attribute_images(Attribute attribute);

 private:
  std::shared_ptr<RendererPool> pool_;
  std::unique_ptr<PooledRenderer> pooled_;
};

}  // namespace dpr::batch
