#include "solve/shape_checks.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/checks.hpp"
#include "loss/image_loss_impl.hpp"
#include "mesh/opacity.hpp"
#include "scene/triangles_in_view.hpp"
#include "solve/measured_images.hpp"
#include "solve/shape_space.hpp"

namespace dpr {
namespace {

/// Throws unless some view has a triangle of the initial mesh before its camera.
void require_in_view(const Mesh& mesh, const ShapeViews& views) {
  Scene scene;
  scene.width = views.width;
  scene.height = views.height;
  scene.meshes.push_back({mesh});
  for (const ShapeView& view : views.views) {
    scene.camera = view.camera;
    if (triangles_in_view(scene, 0).not_shown() < mesh.faces.size()) return;
  }
  throw InvalidArgument("initial mesh (shape)", "one that no image shows", "one that some image shows");
}

}  // namespace

bool compares_colors(const LossWeights& weights) {
  return std::ranges::any_of(image_losses(), [&](const ImageLossRow& loss) {
    return !loss.reads_alpha && weights.*loss.weight > 0;
  });
}

void check_shape_views(const ShapeViews& views) {
  if (views.views.empty()) throw InvalidArgument("views (shape)", "none", "at least one");
  if (views.width < 1 || views.height < 1) {
    throw InvalidArgument("size (shape)", checks::size(views.width, views.height), "at least 1x1");
  }
  for (std::size_t i = 0; i < views.views.size(); ++i) {
    const ShapeView& view = views.views[i];
    const Image &image = view.image, &mask = view.mask;
    const std::string name = checks::element("views", i);
    if (image.width != views.width || image.height != views.height) {
      throw InvalidArgument(checks::in("size of " + name, "shape"), checks::size(image.width, image.height),
                            checks::size(views.width, views.height));
    }
    checks::require_pixels(image, checks::in(name, "shape"));
    if (!mask.pixels.empty()) require_mask(mask, image, checks::in("mask of " + name, "shape"));
    validate(view.camera, name + ".camera");
  }
  for (const Measured kind : {Measured::depth, Measured::normal}) check_measured(views, kind);
  require_known_cameras(views, "shape");
  checks::require_finite(views.background, "background (shape)");
  if (views.initial) validate(*views.initial, "initial (shape)");
  if (views.initial) require_opaque(*views.initial, "initial mesh");
  if (views.initial) require_in_view(*views.initial, views);
  if (views.lights) validate(*views.lights);
  if (views.smoothing) validate(*views.smoothing);
}

void check_shape_options(const ShapeOptions& o, const ShapeViews& views) {
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  const auto not_negative = [](double x) { return x >= 0 && std::isfinite(x); };
  const unsigned most = static_cast<unsigned>(std::log2(std::min(views.width, views.height))) + 1;
  require(o.levels > 0 && o.levels <= most, "levels (shape)", o.levels,
          "at least 1, and a pixel a side at the coarsest");
  require(o.iterations <= std::numeric_limits<unsigned>::max() / o.levels, "iterations (shape)", o.iterations,
          "below 2^32 in all levels");
  require(o.batch > 0, "batch (shape)", o.batch, "at least 1");
  require(o.checkpoint_interval > 0, "checkpoint_interval (shape)", o.checkpoint_interval, "at least 1");
  require(positive(o.edge_pixels), "edge_pixels (shape)", o.edge_pixels, "a finite number above 0");
  require(positive(o.blur), "blur (shape)", o.blur, "a finite number above 0");
  require(positive(o.blur_end), "blur_end (shape)", o.blur_end, "a finite number above 0");
  const bool all_have_alpha = std::ranges::all_of(views.views, &ShapeView::has_alpha);
  if (!all_have_alpha && !compares_colors(o.loss)) {
    throw InvalidArgument("loss (shape)", "one of silhouettes alone, and a view without",
                          "one of colours too");
  }
  checks::require_enumerator(o.steps, ShapeSteps::direct, "steps (shape)");
  require(not_negative(o.lambda), "lambda (shape)", o.lambda, "a finite number, at least 0");
  require(positive(o.learning_rate), "learning_rate (shape)", o.learning_rate, "a finite number above 0");
  require(positive(o.learning_rate_end), "learning_rate_end (shape)", o.learning_rate_end,
          "a finite number above 0");
  require(not_negative(o.color_learning_rate), "color_learning_rate (shape)", o.color_learning_rate,
          "a finite number, at least 0");
  require(positive(o.camera_learning_rate), "camera_learning_rate (shape)", o.camera_learning_rate,
          "a finite number above 0");
  require(!o.refine_cameras || views.views.size() > 1, "views (shape)", views.views.size(),
          "at least two, to refine their cameras");
  require(not_negative(o.depth), "depth (shape)", o.depth, "a finite number, at least 0");
  require(not_negative(o.normal), "normal (shape)", o.normal, "a finite number, at least 0");
  require(not_negative(o.rigidity), "rigidity (shape)", o.rigidity, "a finite number, at least 0");
  require(o.explained > 0 && o.explained < 1, "explained (shape)", o.explained, "between 0 and 1");
  require(o.rigidity == 0 || o.remesh_interval == 0, "remesh_interval (shape)", o.remesh_interval,
          "0 beside a rigidity: it compares with the start, whose faces have to stay");
}

}  // namespace dpr
