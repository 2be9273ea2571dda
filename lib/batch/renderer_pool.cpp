#include "batch/renderer_pool.hpp"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <utility>

#include "device/context.hpp"
#include "dpr/error.hpp"
#include "renderer/renderer_impl.hpp"

namespace dpr::batch {
namespace {

/// The process that opened the first device, 0 before. A fork has what an OpenCL implementation left in
/// memory, but none of its threads: whoever calls it there waits for ever, also to release what there is.
std::atomic<pid_t> opener{0};

bool is_forked() {
  const pid_t process = opener;
  return process != 0 && process != getpid();
}

void require_own_process() {
  if (!is_forked()) return;
  throw InvalidArgument("process (OpenCL)", "a fork of one that had opened the device",
                        "the start method \"spawn\", or a parent that renders nothing before it forks");
}

bool has_surface(const Mesh& mesh, const Surface& surface) {
  const auto has_form = [](const Texture& texture, const TextureForm& form) {
    return texture.width == form.width && texture.height == form.height && texture.wrap == form.wrap &&
           texture.filter == form.filter && texture.opacities.empty() != form.has_opacities;
  };
  return mesh.texcoords.size() == surface.texcoords && mesh.materials.size() == surface.materials &&
         mesh.vertex_opacities.size() == surface.vertex_opacities &&
         mesh.face_opacities.size() == surface.face_opacities &&
         std::ranges::equal(mesh.textures, surface.textures, has_form) &&
         mesh.face_texcoords == surface.face_texcoords && mesh.face_textures == surface.face_textures &&
         mesh.face_materials == surface.face_materials;
}

}  // namespace

void add_surface(Mesh& mesh, const Surface& surface) {
  mesh.texcoords.resize(surface.texcoords);
  mesh.face_texcoords = surface.face_texcoords;
  for (const TextureForm& form : surface.textures) {
    const std::size_t texels = static_cast<std::size_t>(form.width) * static_cast<std::size_t>(form.height);
    mesh.textures.push_back({form.width, form.height, std::vector<glm::vec3>(texels), form.wrap, form.filter,
                             std::vector<float>(form.has_opacities ? texels : 0, 1.0F)});
  }
  mesh.face_textures = surface.face_textures;
  mesh.materials.resize(surface.materials);
  mesh.face_materials = surface.face_materials;
  mesh.vertex_opacities.assign(surface.vertex_opacities, 1.0F);  // which suits every smoothing
  mesh.face_opacities.assign(surface.face_opacities, 1.0F);
}

bool Topology::is_of(const Renderer& renderer) const {
  const Scene& scene = renderer.scene();
  const Mesh& mesh = scene.meshes[0].mesh;
  return scene.width == width && scene.height == height && mesh.positions.size() == vertices &&
         impl_of(renderer).geometry->views_of_faces == views_of_faces &&
         mesh.vertex_colors.empty() == face_colors && has_surface(mesh, surface) && holds(faces, mesh.faces);
}

void Topology::set(Renderer& renderer) const {
  Scene scene;
  scene.width = width;
  scene.height = height;
  Mesh mesh;
  mesh.positions.resize(vertices);
  mesh.faces = read_triples(faces, views_of_faces);
  (face_colors ? mesh.face_colors : mesh.vertex_colors).resize(face_colors ? mesh.faces.size() : vertices);
  add_surface(mesh, surface);
  scene.meshes.push_back({std::move(mesh)});
  if (views_of_faces == 1) return renderer.set_scene(scene);
  std::vector<float>& of_vertices = scene.meshes[0].mesh.vertex_opacities;
  std::vector<float> of_all_views = std::exchange(of_vertices, {});  // more than a mesh has
  validate(scene);
  std::swap(of_vertices, of_all_views);
  impl_of(renderer).set_scene(scene, views_of_faces);
}

Device open_device_of_process(const std::string& selector) {
  require_own_process();
  Device device = open_device(selector);
  opener = getpid();
  return device;
}

RendererPool::~RendererPool() {
  if (is_forked()) (void)state_.release();  // which is the parent's to release
}

PooledRenderer RendererPool::take(const Topology& topology) {
  require_own_process();
  {
    const std::lock_guard lock(mutex_);
    State& state = *state_;
    const auto found = std::find_if(state.free.rbegin(), state.free.rend(), [&](const PooledRenderer& free) {
      return topology.is_of(free.renderer);
    });
    if (found != state.free.rend()) {
      PooledRenderer renderer = std::move(*found);
      state.free.erase(std::next(found).base());
      state.most_lent = std::max(state.most_lent, ++state.lent);
      return renderer;
    }
  }
  PooledRenderer renderer{Renderer(state_->device)};
  topology.set(renderer.renderer);
  const std::lock_guard lock(mutex_);
  state_->most_lent = std::max(state_->most_lent, ++state_->lent);
  return renderer;
}

void RendererPool::put_back(PooledRenderer renderer) {
  std::list<PooledRenderer> dropped;  // which outlives the lock: releasing buffers takes its time
  const std::lock_guard lock(mutex_);
  State& state = *state_;
  --state.lent;
  state.free.push_back(std::move(renderer));
  if (state.free.size() > state.most_lent) dropped.splice(dropped.end(), state.free, state.free.begin());
}

void RendererPool::clear() {
  require_own_process();
  impl_of(state_->device).queue.finish();
  std::list<PooledRenderer> dropped;
  const std::lock_guard lock(mutex_);
  dropped.swap(state_->free);
}

RendererPools& RendererPools::of_process() {
  static auto* const pools = new RendererPools;
  return *pools;
}

std::shared_ptr<RendererPool> RendererPools::get(const std::string& device) {
  const std::lock_guard lock(mutex_);
  std::shared_ptr<RendererPool>& pool = pools_[device];
  if (!pool) pool = std::make_shared<RendererPool>(open_device_of_process(device));
  return pool;
}

void RendererPools::clear() {
  const std::lock_guard lock(mutex_);
  for (const auto& [device, pool] : pools_) {
    if (pool) pool->clear();
  }
}

Frame::Frame(std::shared_ptr<RendererPool> pool, const Topology& topology)
    : pool_(std::move(pool)), pooled_(std::make_unique<PooledRenderer>(pool_->take(topology))) {}

Frame::~Frame() {
  if (is_forked()) {
    (void)pooled_.release();
    return;
  }
  try {
    pool_->put_back(std::move(*pooled_));
  } catch (...) {
    // Without memory to keep the renderer it is let go.
  }
}

Renderer& Frame::renderer() {
  require_own_process();
  return pooled_->renderer;
}

AttributeImages& Frame::attribute_images(Attribute attribute) {
  return pooled_->attributes.try_emplace(attribute, renderer().device(), attribute).first->second;
}

}  // namespace dpr::batch
