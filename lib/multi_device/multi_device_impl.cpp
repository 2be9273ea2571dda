// The work of several devices on one batch.
#include "multi_device/multi_device_impl.hpp"

#include <algorithm>
#include <thread>

#include "base/clock.hpp"
#include "dpr/error.hpp"
#include "loss/image_loss_impl.hpp"
#include "renderer/renderer_impl.hpp"
#include "renderer/setter_checks.hpp"

namespace dpr {
namespace {

/// Chunks a batch falls into unless told otherwise, if it has as many views: enough for the devices to finish
/// together, few enough for a chunk to fill a device.
constexpr std::size_t k_chunks = 12;

/// A thread whose destructor waits for its end: std::jthread, which libc++ before 20 lacks.
struct Thread : std::thread {
  using std::thread::thread;
  Thread(Thread&&) = default;
  ~Thread() {
    if (joinable()) join();
  }
};

}  // namespace

OwnLoss OwnLoss::of(const LossOptions& options, std::span<const Image> targets) {
  OwnLoss own{options.weights,
              {options.has_alpha.begin(), options.has_alpha.end()},
              {options.masks.begin(), options.masks.end()},
              {targets.begin(), targets.end()},
              options.levels,
              {}};
  for (const AttributeTarget& target : options.attributes)
    own.attributes.push_back(
        {target.attribute, target.weights, {target.targets.begin(), target.targets.end()}});
  return own;
}

ImageLoss OwnLoss::make(const Device& device, const Chunk& chunk) const {
  const auto part = [&](const auto& all) {
    return all.empty() ? std::span(all) : std::span(all).subspan(chunk.first, chunk.size());
  };
  std::vector<AttributeTarget> of_views;
  for (const Attributes& of : attributes) of_views.push_back({of.attribute, of.weights, part(of.targets)});
  return {device,
          LossOptions{.weights = weights,
                      .has_alpha = part(has_alpha),
                      .masks = part(masks),
                      .levels = levels,
                      .attributes = of_views},
          part(targets)};
}

/// By the setters that check nothing: what was set is checked, but a scene's own camera, or the views of the
/// last chunk, need not suit a smoothing and lights that came with other views.
void MultiDeviceRenderer::Impl::catch_up(Worker& worker, std::span<const View> its_views,
                                         std::size_t first_view) {
  Renderer::Impl& renderer = impl_of(worker.renderer);
  if (worker.has.scene != now.scene) {
    Versions all = now;
    renderer.set_scene(scene);
    std::swap(worker.has, all);
  }
  if (worker.has.smoothing != now.smoothing || worker.has.lights != now.lights) {
    renderer.set_views(its_views, first_view, scene.smoothing, scene.lights);
    worker.has.smoothing = now.smoothing;
    worker.has.lights = now.lights;
  } else {
    renderer.set_views(its_views, first_view);
  }
  for (const auto& [at, version] : now.arrays) {
    if (worker.has.arrays[at] == version) continue;
    renderer.set(at, values_of(require_array(scene, at)));
    worker.has.arrays[at] = version;
  }
}

void MultiDeviceRenderer::Impl::require_views(const char* caller) const {
  if (views.empty()) throw InvalidArgument(caller, "no scene", "set_scene() first");
}

std::vector<Chunk> MultiDeviceRenderer::Impl::chunks_of(std::size_t count) const {
  const std::size_t size = chunk_views > 0 ? chunk_views : (count + k_chunks - 1) / k_chunks;
  const std::size_t most = most_views(scene, raster_of(scene));
  return make_chunks(count, std::clamp(size, std::size_t{1}, std::max(most, std::size_t{1})));
}

void MultiDeviceRenderer::Impl::for_each_chunk(const Batch& of, const Work& work) {
  ChunkDealer dealer(of.chunks, paces, lost);
  std::vector<std::exception_ptr> errors(of.chunks.size()), losses_of_devices(workers.size());
  const auto run = [&](std::size_t w) {
    while (const std::optional<std::size_t> c = dealer.take(w)) {
      const auto lose = [&] {
        losses_of_devices[w] = std::current_exception();
        dealer.lose(w, *c);
      };
      const auto start = Clock::now();
      try {
        render(workers[w], of, *c);
        work(workers[w], *c);
        dealer.finish(w, *c, seconds_since(start));
      } catch (const DeviceError&) {
        lose();
      } catch (const BuildError&) {
        lose();
      } catch (...) {
        errors[*c] = std::current_exception();
        dealer.give_up(w, *c);
      }
    }
  };
  const auto start = Clock::now();
  {
    std::vector<Thread> threads;
    try {
      for (std::size_t w = 1; w < workers.size(); ++w) threads.emplace_back(run, w);
    } catch (...) {  // no thread: those that run must not wait for those that never will
      for (std::size_t w = 0; w < workers.size(); ++w) dealer.withdraw(w);
      throw;
    }
    run(0);
  }
  dealer.finish_all(seconds_since(start));
  settle_losses(dealer, losses_of_devices);
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

void MultiDeviceRenderer::Impl::render(Worker& worker, const Batch& of, std::size_t chunk) {
  const Chunk part = of.views_of(chunk);
  catch_up(worker, std::span(views).subspan(part.first, part.size()), of.chunks[chunk].first);
  worker.renderer.forward();
  worker.views_rendered += part.size();
}

void MultiDeviceRenderer::Impl::settle_losses(const ChunkDealer& dealer,
                                              const std::vector<std::exception_ptr>& met) {
  if (!dealer.is_done()) {
    lost.assign(workers.size(), false);
    std::rethrow_exception(*std::ranges::find_if(met, [](const auto& error) { return error != nullptr; }));
  }
  for (std::size_t w = 0; w < workers.size(); ++w) {
    if (!met[w]) continue;
    lost[w] = true;
    try {
      std::rethrow_exception(met[w]);
    } catch (const Error& error) {
      notes.push_back(workers[w].renderer.device().info().name + ", device " + std::to_string(w) +
                      " of the list, is lost and the others do its work: " + error.what());
    }
  }
}

ImageLoss& MultiDeviceRenderer::Impl::loss_of(Worker& worker, const Batch& of, std::size_t chunk) const {
  if (worker.losses_of != losses) {
    worker.losses.clear();
    worker.losses_of = losses;
  }
  const Chunk part = of.views_of(chunk);
  const auto key = std::pair(part.first, part.last);
  auto known = worker.losses.find(key);
  if (known == worker.losses.end()) {
    std::erase_if(worker.losses, [&](const auto& other) {
      return other.first.first < part.last && part.first < other.first.second;
    });
    known = worker.losses.emplace(key, loss.make(worker.renderer.device(), part)).first;
  }
  impl_of(known->second).set_views_of_mean(of.chunks.back().last);
  return known->second;
}

MeshLoss& MultiDeviceRenderer::Impl::mesh_loss_of(Worker& worker) const {
  if (worker.mesh_loss_of != mesh_losses) {
    worker.mesh_loss.emplace(worker.renderer.device(), mesh_loss->weights, mesh_of(scene, mesh_loss->mesh));
    worker.mesh_loss_of = mesh_losses;
  }
  return *worker.mesh_loss;
}
}  // namespace dpr
