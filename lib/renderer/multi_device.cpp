// Views dealt to devices in chunks; gradients added in the order of the chunks.
#include "dpr/multi_device.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <iterator>
#include <optional>
#include <thread>

#include "dpr/error.hpp"
#include "loss/image_loss_impl.hpp"
#include "renderer/setter_checks.hpp"
#include "scene/gradient_table.hpp"

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

/// Adds the gradients of chunks, which come in their order, in double precision.
class GradientSum {
 public:
  void add_chunk(SceneGradient&& chunk, double factor) {
    std::size_t next = 0;
    for_each_array(chunk, [&](const GradientRow& row, GradientIndex, const GradientArray& array) {
      if (is_per_view(row.of)) {
        transform_numbers(array, [&](double value) { return 0.0 + factor * value; });
      } else {
        if (next == sums_.size()) sums_.emplace_back();
        add(sums_[next++], array, factor);
      }
    });
    std::ranges::move(chunk.views, std::back_inserter(views_));
    last_ = std::move(chunk);
  }

  SceneGradient finish() {
    std::size_t next = 0;
    for_each_array(last_, [&](const GradientRow& row, GradientIndex, const GradientArray& array) {
      if (is_per_view(row.of)) return;
      auto value = sums_[next++].begin();
      transform_numbers(array, [&](double) { return *value++; });
    });
    last_.views = std::move(views_);
    return std::move(last_);
  }

 private:
  static void add(std::vector<double>& sum, const GradientArray& array, double factor) {
    std::size_t i = 0;
    transform_numbers(array, [&](double value) {
      if (i == sum.size()) sum.push_back(0.0);
      sum[i++] += factor * value;
      return value;
    });
  }

  std::vector<std::vector<double>> sums_;  // [array that is a sum over the views]
  std::vector<ViewGradient> views_;
  SceneGradient last_;
};

/// How often each part of the scene has been set.
struct Versions {
  std::uint64_t scene = 0, smoothing = 0, lights = 0;
  std::vector<std::uint64_t> positions, colors, texcoords;  // [mesh]
  std::vector<std::vector<std::uint64_t>> texels;           // [mesh][texture]

  explicit Versions(const Scene& of = {}, std::uint64_t number = 0)
      : scene(number), positions(of.meshes.size()), colors(of.meshes.size()), texcoords(of.meshes.size()) {
    for (const Instance& instance : of.meshes) texels.emplace_back(instance.mesh.textures.size());
  }
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
    if (worker.has.lights != now.lights) {
      renderer.set_lights(scene.lights);
      worker.has.lights = now.lights;
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
      if (worker.has.texcoords[m] != now.texcoords[m]) {
        renderer.set_texcoords(m, scene.meshes[m].mesh.texcoords);
        worker.has.texcoords[m] = now.texcoords[m];
      }
      for (std::size_t t = 0; t < now.texels[m].size(); ++t) {
        if (worker.has.texels[m][t] == now.texels[m][t]) continue;
        renderer.set_texels(m, t, scene.meshes[m].mesh.textures[t].texels);
        worker.has.texels[m][t] = now.texels[m][t];
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
  Versions versions(scene, m.now.scene + 1);
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

void MultiDeviceRenderer::set_texels(std::size_t mesh, std::size_t texture,
                                     std::span<const glm::vec3> texels) {
  impl_->require_views("MultiDeviceRenderer::set_texels");
  check_texels(impl_->scene, mesh, texture, texels);
  std::ranges::copy(texels, impl_->scene.meshes[mesh].mesh.textures[texture].texels.begin());
  ++impl_->now.texels[mesh][texture];
}

void MultiDeviceRenderer::set_texcoords(std::size_t mesh, std::span<const glm::vec2> texcoords) {
  impl_->require_views("MultiDeviceRenderer::set_texcoords");
  check_texcoords(impl_->scene, mesh, texcoords);
  std::ranges::copy(texcoords, impl_->scene.meshes[mesh].mesh.texcoords.begin());
  ++impl_->now.texcoords[mesh];
}

void MultiDeviceRenderer::set_lights(const std::optional<Lights>& lights) {
  impl_->require_views("MultiDeviceRenderer::set_lights");
  check_lights(impl_->scene, impl_->views, lights);
  impl_->scene.lights = lights;
  ++impl_->now.lights;
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
  for (SceneGradient& part : parts) sum.add_chunk(std::move(part), 1.0);
  return sum.finish();
}

void MultiDeviceRenderer::set_loss(LossWeights weights, std::span<const Image> targets) {
  impl_->require_views("MultiDeviceRenderer::set_loss");
  check_loss({.weights = weights}, targets);
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
    sum.add_chunk(std::move(parts[c]),
                  static_cast<double>(m.chunks[c].size()) / static_cast<double>(m.views.size()));
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
