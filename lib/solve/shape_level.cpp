#include "solve/shape_level.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "scene/gradient_table.hpp"
#include "solve/resample.hpp"
#include "solve/shape_space.hpp"

namespace dpr {
namespace {

int side(int pixels, const ShapeOptions& options, unsigned level) {
  return std::max(static_cast<int>(std::lround(pixels / pixel_scale(options, level))), 1);
}

}  // namespace

double pixel_scale(const ShapeOptions& options, unsigned level) {
  return std::ldexp(1.0, static_cast<int>(options.levels - 1 - level));
}

ShapeLevel::ShapeLevel(const ShapeViews& all, const ShapeOptions& options, unsigned level)
    : width(side(all.width, options, level)), height(side(all.height, options, level)) {
  const std::size_t count = (all.views.size() + options.batch - 1) / options.batch;
  for (std::size_t batch = 0; batch < count; ++batch) {
    starts.push_back(order.size());
    for (std::size_t i = batch; i < all.views.size(); i += count) order.push_back(i);
  }
  starts.push_back(order.size());
  for (const std::size_t i : order) {
    const Camera& camera = all.views[i].camera;
    views.push_back({resample(camera, all.width, all.height, width, height), {glm::mat4(1.0F)}});
  }
}

void ShapeLevel::set_cameras(std::span<const ShapeState::MovedCamera> cameras) {
  for (std::size_t i = 0; !cameras.empty() && i < order.size(); ++i)
    views[i].camera.view = glm::mat4(cameras[order[i]].view);
}

std::pair<std::size_t, std::size_t> ShapeLevel::batch(unsigned iteration) const {
  const std::size_t b = iteration % (starts.size() - 1);
  return {starts[b], starts[b + 1] - starts[b]};
}

Scene scene_of_level(const ShapeViews& all, const ShapeLevel& level, Mesh mesh, const Smoothing& smoothing) {
  Scene scene;
  scene.width = level.width;
  scene.height = level.height;
  scene.background = all.background;
  scene.camera = level.views.front().camera;
  scene.meshes.push_back({std::move(mesh)});
  scene.lights = all.lights;
  scene.smoothing = smoothing;
  scene.gradients = no_gradients();
  return scene;
}

ShapeTargets::ShapeTargets(const ShapeViews& all, const ShapeOptions& options, const ShapeLevel& level)
    : weights(options.loss) {
  const auto has_mask = [](const ShapeView& view) { return !view.mask.pixels.empty(); };
  const bool any_mask = std::ranges::any_of(all.views, has_mask);
  for (const std::size_t i : level.order) {
    const ShapeView& view = all.views[i];
    images.push_back(resample(view.image, level.width, level.height));
    has_alpha.push_back(view.has_alpha ? 1 : 0);
    if (!any_mask) continue;
    masks.push_back(has_mask(view) ? resample(view.mask, level.width, level.height)
                                   : Image(level.width, level.height, glm::vec4(1)));
  }
  const auto add = [&](Attribute attribute, float weight, Image ShapeView::*image, std::vector<Image>& list) {
    if (weight == 0 || (all.views.front().*image).pixels.empty()) return;
    for (const std::size_t i : level.order)
      list.push_back(resample_weighted(all.views[i].*image, level.width, level.height));
    attributes.push_back({attribute, {.l1 = weight}, list});
  };
  add(Attribute::depth, options.depth / static_cast<float>(common_view(all).radius), &ShapeView::depth,
      depths);
  add(Attribute::normal, options.normal, &ShapeView::normal, normals);
}

}  // namespace dpr
