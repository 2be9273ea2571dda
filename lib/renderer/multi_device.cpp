// Views dealt to devices in chunks; gradients added in the order of the chunks.
#include "dpr/multi_device.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <optional>
#include <thread>

#include "dpr/error.hpp"
#include "loss/image_loss_impl.hpp"
#include "renderer/setter_checks.hpp"

namespace dpr {
namespace {

/// Chunks a batch falls into, if it has as many views: enough for the devices to finish together, few enough
/// for a chunk to fill a device.
constexpr std::size_t k_chunks = 12;

/// Consecutive views [first, last).
struct Chunk {
  std::size_t first, last;
  std::size_t size() const { return last - first; }
};

/// The same whatever devices there are; none with more views than a frame may have.
std::vector<Chunk> make_chunks(std::size_t views, std::size_t most) {
  const std::size_t size = std::min((views + k_chunks - 1) / k_chunks, std::max(most, std::size_t{1}));
  std::vector<Chunk> chunks;
  for (std::size_t first = 0; first < views; first += size)
    chunks.push_back({first, std::min(first + size, views)});
  return chunks;
}

/// sum += factor * term, in double precision.
void add(std::vector<glm::dvec3>& sum, const std::vector<glm::vec3>& term, double factor) {
  sum.resize(term.size(), glm::dvec3(0.0));
  for (std::size_t i = 0; i < term.size(); ++i) sum[i] += factor * glm::dvec3(term[i]);
}

void add(PoseGradient& sum, const PoseGradient& term, double factor) {
  sum.rotation += factor * term.rotation;
  sum.translation += factor * term.translation;
}

ViewGradient scaled(const ViewGradient& term, double factor) {
  ViewGradient view;
  add(view.camera.view, term.camera.view, factor);
  view.camera.fov_y_degrees = factor * term.camera.fov_y_degrees;
  for (std::size_t k = 0; k < term.camera.intrinsics.size(); ++k)
    view.camera.intrinsics[k] = factor * term.camera.intrinsics[k];
  view.transforms.resize(term.transforms.size());
  for (std::size_t m = 0; m < term.transforms.size(); ++m)
    add(view.transforms[m], term.transforms[m], factor);
  return view;
}

/// Adds the gradients of chunks, which come in their order.
class GradientSum {
 public:
  void add_chunk(const SceneGradient& chunk, double factor) {
    meshes_.resize(chunk.meshes.size());
    for (std::size_t m = 0; m < chunk.meshes.size(); ++m) {
      add(meshes_[m].positions, chunk.meshes[m].positions, factor);
      add(meshes_[m].colors, chunk.meshes[m].colors, factor);
    }
    for (const ViewGradient& view : chunk.views) sum_.views.push_back(scaled(view, factor));
    sum_.lights.resize(chunk.lights.size());
    for (std::size_t l = 0; l < chunk.lights.size(); ++l) {
      sum_.lights[l].position += factor * chunk.lights[l].position;
      sum_.lights[l].diffuse += factor * chunk.lights[l].diffuse;
      sum_.lights[l].specular += factor * chunk.lights[l].specular;
    }
    sum_.ambient += factor * chunk.ambient;
    sum_.background += factor * chunk.background;
    sum_.sigma += factor * chunk.sigma;
    sum_.gamma += factor * chunk.gamma;
    sum_.alpha += factor * chunk.alpha;
  }

  SceneGradient finish() {
    for (const MeshSum& mesh : meshes_) {
      sum_.meshes.push_back(
          {{mesh.positions.begin(), mesh.positions.end()}, {mesh.colors.begin(), mesh.colors.end()}});
    }
    return std::move(sum_);
  }

 private:
  struct MeshSum {
    std::vector<glm::dvec3> positions, colors;
  };
  std::vector<MeshSum> meshes_;
  SceneGradient sum_;
};

/// How often each part of the scene has been set.
struct Versions {
  std::uint64_t scene = 0, smoothing = 0;
  std::vector<std::uint64_t> positions, colors;  // [mesh]
};

}  // namespace

/// Setters change what is here. A device's renderer catches up before its next chunk, so that an error of one
/// device leaves no two of them with different scenes.
struct MultiDeviceRenderer::Impl {
  /// A device's renderer, which version of the scene it has, and the losses of the chunks it has met.
  struct Worker {
    explicit Worker(const Device& device) : renderer(device) {}
    Renderer renderer;
    Versions has;
    std::uint64_t losses_of = 0;
    std::vector<std::optional<ImageLoss>> losses;  // [chunk]
    std::size_t views_rendered = 0;
  };

  std::vector<Worker> workers;
  Scene scene;
  Versions now;
  std::vector<View> views;
  std::vector<Chunk> chunks;
  LossWeights weights;
  std::vector<Image> targets;
  std::uint64_t losses = 0;  // how often chunks or targets have changed

  void catch_up(Worker& worker) const {
    Renderer& renderer = worker.renderer;
    if (worker.has.scene != now.scene) {
      Versions all = now;
      renderer.set_scene(scene);
      std::swap(worker.has, all);
      return;
    }
    if (worker.has.smoothing != now.smoothing) {
      renderer.set_smoothing(scene.smoothing);
      worker.has.smoothing = now.smoothing;
    }
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      if (worker.has.positions[m] != now.positions[m]) {
        renderer.set_positions(m, scene.meshes[m].mesh.positions);
        worker.has.positions[m] = now.positions[m];
      }
      if (worker.has.colors[m] != now.colors[m]) {
        renderer.set_colors(m, colors_of(scene.meshes[m].mesh));
        worker.has.colors[m] = now.colors[m];
      }
    }
  }

  void require_views(const char* caller) const {
    if (views.empty()) throw InvalidArgument(caller, "no scene", "set_scene() first");
  }

  std::span<const View> views_of(const Chunk& chunk) const {
    return std::span(views).subspan(chunk.first, chunk.size());
  }

  using Work = std::function<void(Worker&, std::size_t chunk)>;

  /// Renders every chunk on the device that is free first, then does `work` there. The first error, in the
  /// order of the chunks, is thrown when all devices are done.
  void for_each_chunk(const Work& work) {
    std::atomic<std::size_t> next = 0;
    std::vector<std::exception_ptr> errors(chunks.size());
    const auto run = [&](Worker& worker) {
      for (std::size_t c = next++; c < chunks.size(); c = next++) {
        try {
          catch_up(worker);
          worker.renderer.set_views(views_of(chunks[c]), chunks[c].first);
          worker.renderer.forward();
          work(worker, c);
          worker.views_rendered += chunks[c].size();
        } catch (...) {
          errors[c] = std::current_exception();
        }
      }
    };
    {
      std::vector<std::jthread> threads;
      for (std::size_t w = 1; w < workers.size(); ++w)
        threads.emplace_back([&run, &worker = workers[w]] { run(worker); });
      run(workers.front());
    }
    for (const std::exception_ptr& error : errors) {
      if (error) std::rethrow_exception(error);
    }
  }

  ImageLoss& loss_of(Worker& worker, std::size_t chunk) const {
    if (worker.losses_of != losses) {
      worker.losses.clear();
      worker.losses.resize(chunks.size());
      worker.losses_of = losses;
    }
    std::optional<ImageLoss>& loss = worker.losses[chunk];
    if (!loss) {
      loss.emplace(worker.renderer.device(), weights,
                   std::span(targets).subspan(chunks[chunk].first, chunks[chunk].size()));
    }
    return *loss;
  }
};

MultiDeviceRenderer::MultiDeviceRenderer(std::vector<Device> devices) : impl_(std::make_unique<Impl>()) {
  if (devices.empty()) throw InvalidArgument("devices", "none", "at least one");
  for (std::size_t d = 0; d < devices.size(); ++d) {
    for (std::size_t other = 0; other < d; ++other) {
      if (&devices[d].impl() != &devices[other].impl()) continue;
      throw InvalidArgument("devices[" + std::to_string(d) + "]",
                            "the same Device as devices[" + std::to_string(other) + "]",
                            "one with a queue of its own, open_device() or split_device()");
    }
    impl_->workers.emplace_back(devices[d]);
  }
}

MultiDeviceRenderer::~MultiDeviceRenderer() = default;
MultiDeviceRenderer::MultiDeviceRenderer(MultiDeviceRenderer&&) noexcept = default;
MultiDeviceRenderer& MultiDeviceRenderer::operator=(MultiDeviceRenderer&&) noexcept = default;

void MultiDeviceRenderer::set_scene(const Scene& scene) {
  validate(scene);
  Impl& m = *impl_;
  Scene new_scene = scene;
  std::vector<View> only{own_view(scene)};
  std::vector<Chunk> chunks = make_chunks(1, 1);
  Versions versions{m.now.scene + 1, 0, std::vector<std::uint64_t>(scene.meshes.size()),
                    std::vector<std::uint64_t>(scene.meshes.size())};
  std::swap(m.scene, new_scene);
  std::swap(m.views, only);
  std::swap(m.chunks, chunks);
  std::swap(m.now, versions);
  ++m.losses;
}

void MultiDeviceRenderer::set_views(std::span<const View> views) {
  Impl& m = *impl_;
  m.require_views("MultiDeviceRenderer::set_views");
  check_views(m.scene, views);
  std::vector<View> new_views(views.begin(), views.end());
  std::vector<Chunk> chunks = make_chunks(views.size(), most_views(m.scene));
  std::swap(m.views, new_views);
  std::swap(m.chunks, chunks);
  ++m.losses;
}

void MultiDeviceRenderer::set_smoothing(const Smoothing& smoothing) {
  impl_->require_views("MultiDeviceRenderer::set_smoothing");
  validate(smoothing);
  impl_->scene.smoothing = smoothing;
  ++impl_->now.smoothing;
}

void MultiDeviceRenderer::set_positions(std::size_t mesh, std::span<const glm::vec3> positions) {
  impl_->require_views("MultiDeviceRenderer::set_positions");
  check_positions(impl_->scene, mesh, positions);
  std::ranges::copy(positions, impl_->scene.meshes[mesh].mesh.positions.begin());
  ++impl_->now.positions[mesh];
}

void MultiDeviceRenderer::set_colors(std::size_t mesh, std::span<const glm::vec3> colors) {
  impl_->require_views("MultiDeviceRenderer::set_colors");
  check_colors(impl_->scene, mesh, colors);
  std::ranges::copy(colors, colors_of(impl_->scene.meshes[mesh].mesh).begin());
  ++impl_->now.colors[mesh];
}

std::vector<Image> MultiDeviceRenderer::render() {
  Impl& m = *impl_;
  m.require_views("MultiDeviceRenderer::render");
  std::vector<Image> images(m.views.size());
  m.for_each_chunk([&](Impl::Worker& worker, std::size_t c) {
    for (std::size_t v = m.chunks[c].first; v < m.chunks[c].last; ++v)
      images[v] = worker.renderer.image(v - m.chunks[c].first);
  });
  return images;
}

SceneGradient MultiDeviceRenderer::gradient(std::span<const Image> grad_images) {
  Impl& m = *impl_;
  m.require_views("MultiDeviceRenderer::gradient");
  if (grad_images.size() != m.views.size()) {
    throw InvalidArgument("grad_images", std::to_string(grad_images.size()) + " images",
                          "one for each of the " + std::to_string(m.views.size()) + " views");
  }
  std::vector<SceneGradient> parts(m.chunks.size());
  m.for_each_chunk([&](Impl::Worker& worker, std::size_t c) {
    parts[c] = worker.renderer.backward(grad_images.subspan(m.chunks[c].first, m.chunks[c].size()));
  });
  GradientSum sum;
  for (const SceneGradient& part : parts) sum.add_chunk(part, 1.0);
  return sum.finish();
}

void MultiDeviceRenderer::set_loss(LossWeights weights, std::span<const Image> targets) {
  impl_->require_views("MultiDeviceRenderer::set_loss");
  check_loss(weights, targets);
  std::vector<Image> new_targets(targets.begin(), targets.end());
  impl_->weights = weights;
  std::swap(impl_->targets, new_targets);
  ++impl_->losses;
}

MultiDeviceRenderer::Evaluation MultiDeviceRenderer::evaluate() {
  Impl& m = *impl_;
  m.require_views("MultiDeviceRenderer::evaluate");
  if (m.targets.size() != m.views.size()) {
    throw InvalidArgument("targets (loss)", std::to_string(m.targets.size()) + " images",
                          "one for each of the " + std::to_string(m.views.size()) + " views");
  }
  Evaluation result;
  result.per_view.resize(m.views.size());
  std::vector<SceneGradient> parts(m.chunks.size());
  m.for_each_chunk([&](Impl::Worker& worker, std::size_t c) {
    ImageLoss& loss = m.loss_of(worker, c);
    loss.evaluate(worker.renderer);
    std::ranges::copy(loss.per_view(),
                      result.per_view.begin() + static_cast<std::ptrdiff_t>(m.chunks[c].first));
    parts[c] = worker.renderer.backward(loss);
  });
  GradientSum sum;
  for (std::size_t c = 0; c < parts.size(); ++c) {
    // A chunk's loss is the mean over its own views.
    sum.add_chunk(parts[c], static_cast<double>(m.chunks[c].size()) / static_cast<double>(m.views.size()));
  }
  result.gradient = sum.finish();
  for (const double loss : result.per_view) result.loss += loss / static_cast<double>(m.views.size());
  return result;
}

std::vector<std::size_t> MultiDeviceRenderer::views_rendered() const {
  std::vector<std::size_t> counts;
  for (const Impl::Worker& worker : impl_->workers) counts.push_back(worker.views_rendered);
  return counts;
}

}  // namespace dpr
