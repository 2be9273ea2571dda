// The setters and calls of the renderer on several devices.
#include "dpr/multi_device.hpp"

#include <algorithm>
#include <utility>

#include "dpr/error.hpp"
#include "loss/image_loss_impl.hpp"
#include "loss/mesh_loss_impl.hpp"
#include "multi_device/multi_device_impl.hpp"
#include "renderer/setter_checks.hpp"
#include "scene/gradient_table.hpp"
#include "scene/scene_parts.hpp"
#include "scene/see_through.hpp"

namespace dpr {

MultiDeviceRenderer::MultiDeviceRenderer(std::vector<Device> devices) : impl_(std::make_unique<Impl>()) {
  check_devices(devices);
  for (const Device& device : devices) impl_->workers.emplace_back(device);
  impl_->paces.resize(devices.size());
  impl_->lost.assign(devices.size(), false);
}

MultiDeviceRenderer::~MultiDeviceRenderer() = default;
MultiDeviceRenderer::MultiDeviceRenderer(MultiDeviceRenderer&&) noexcept = default;
MultiDeviceRenderer& MultiDeviceRenderer::operator=(MultiDeviceRenderer&&) noexcept = default;

void MultiDeviceRenderer::set_scene(const Scene& scene) {
  validate(scene);
  require_scales(scene.camera, scene.smoothing, scene.lights.has_value());
  Impl& m = *impl_;
  Scene new_scene = scene;
  std::vector<View> only{own_view(scene)};
  Versions versions{.scene = m.now.scene + 1};
  std::swap(m.scene, new_scene);
  std::swap(m.views, only);
  std::swap(m.now, versions);
  m.mesh_loss.reset();
}

void MultiDeviceRenderer::set_views(std::span<const View> views) {
  Impl& m = *impl_;
  m.require_views("MultiDeviceRenderer::set_views");
  check_views(m.scene, views);
  std::vector<View> new_views(views.begin(), views.end());
  std::swap(m.views, new_views);
}

void MultiDeviceRenderer::set_chunk(std::size_t views) { impl_->chunk_views = views; }

void MultiDeviceRenderer::set_smoothing(const Smoothing& smoothing) {
  impl_->require_views("MultiDeviceRenderer::set_smoothing");
  validate(smoothing);
  for (const View& view : impl_->views)
    require_scales(view.camera, smoothing, impl_->scene.lights.has_value());
  if (is_see_through(impl_->scene)) require_sees_through(smoothing);
  impl_->scene.smoothing = smoothing;
  ++impl_->now.smoothing;
}

void MultiDeviceRenderer::set_array(const ArrayRef& array, const ArrayValues& values) {
  Impl& m = *impl_;
  m.require_views(("MultiDeviceRenderer::" + setter_of(array)).c_str());
  const HostArray held = require_array(m.scene, array, values);
  check_values(row_of(array.id).name, values);
  std::uint64_t& version = m.now.arrays[array];
  assign(held, values);
  ++version;
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
  const Impl::Batch all = m.all_views();
  m.for_each_chunk(all, [&](Impl::Worker& worker, std::size_t c) {
    for (std::size_t v = all.chunks[c].first; v < all.chunks[c].last; ++v)
      images[v] = worker.renderer.image(v - all.chunks[c].first);
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
  const Impl::Batch all = m.all_views();
  std::vector<SceneGradient> parts(all.chunks.size());
  m.for_each_chunk(all, [&](Impl::Worker& worker, std::size_t c) {
    parts[c] = worker.renderer.backward(grad_images.subspan(all.chunks[c].first, all.chunks[c].size()));
  });
  return sum_of(std::move(parts));
}

void MultiDeviceRenderer::set_loss(const LossOptions& options, std::span<const Image> targets) {
  impl_->require_views("MultiDeviceRenderer::set_loss");
  check_loss(options, targets);
  OwnLoss loss = OwnLoss::of(options, targets);
  std::swap(impl_->loss, loss);
  ++impl_->losses;
}

void MultiDeviceRenderer::set_loss(LossWeights weights, std::span<const Image> targets) {
  set_loss(LossOptions{.weights = weights}, targets);
}

void MultiDeviceRenderer::set_mesh_loss(const MeshLossWeights& weights, std::size_t mesh) {
  Impl& m = *impl_;
  m.require_views("MultiDeviceRenderer::set_mesh_loss");
  if (mesh >= m.scene.meshes.size()) {
    throw InvalidArgument("mesh (mesh loss)", std::to_string(mesh),
                          "below " + std::to_string(m.scene.meshes.size()));
  }
  if (!m.scene.gradients.positions) {
    throw InvalidArgument("mesh loss (MultiDeviceRenderer)", "a scene without gradients of positions",
                          "GradientRequest::positions");
  }
  check_mesh_loss(weights, mesh_of(m.scene, mesh));
  m.mesh_loss = {weights, mesh};
  ++m.mesh_losses;
}

MultiDeviceRenderer::Evaluation MultiDeviceRenderer::evaluate() { return evaluate(0, impl_->views.size()); }

MultiDeviceRenderer::Evaluation MultiDeviceRenderer::evaluate(std::size_t first, std::size_t count) {
  Impl& m = *impl_;
  m.require_views("MultiDeviceRenderer::evaluate");
  if (m.loss.targets.size() != m.views.size()) {
    throw InvalidArgument("targets (loss)", std::to_string(m.loss.targets.size()) + " images",
                          "one for each of the " + std::to_string(m.views.size()) + " views");
  }
  if (count == 0 || first > m.views.size() || count > m.views.size() - first) {
    throw InvalidArgument("views (MultiDeviceRenderer::evaluate)",
                          std::to_string(count) + " from " + std::to_string(first) + " on",
                          "at least one of the " + std::to_string(m.views.size()));
  }
  Evaluation result;
  result.per_view.resize(count);
  const Impl::Batch batch = m.batch(first, count);
  std::vector<SceneGradient> parts(batch.chunks.size());
  m.for_each_chunk(batch, [&](Impl::Worker& worker, std::size_t c) {
    ImageLoss& loss = m.loss_of(worker, batch, c);
    loss.evaluate(worker.renderer);
    std::ranges::copy(loss.per_view(),
                      result.per_view.begin() + static_cast<std::ptrdiff_t>(batch.chunks[c].first));
    if (c == 0 && m.mesh_loss) {
      MeshLoss& mesh_loss = m.mesh_loss_of(worker);
      result.mesh_loss = mesh_loss.evaluate(worker.renderer, m.mesh_loss->mesh);
      parts[c] = worker.renderer.backward(loss, mesh_loss);
    } else {
      parts[c] = worker.renderer.backward(loss);
    }
  });
  result.gradient = sum_of(std::move(parts));
  for (const double loss : result.per_view) result.loss += loss / static_cast<double>(count);
  return result;
}

std::vector<std::size_t> MultiDeviceRenderer::views_rendered() const {
  std::vector<std::size_t> counts;
  for (const Impl::Worker& worker : impl_->workers) counts.push_back(worker.views_rendered);
  return counts;
}

std::vector<std::string> MultiDeviceRenderer::take_notes() { return std::exchange(impl_->notes, {}); }

}  // namespace dpr
