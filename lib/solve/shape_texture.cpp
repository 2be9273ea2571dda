// The texture of a shape whose views are known, by simultaneous iterative reconstruction (SIRT, Gilbert 1972): images
// are linear in the texels, and each texel goes by the mean of what the pixels that show it lack.
#include <algorithm>
#include <cmath>
#include <vector>

#include "dpr/multi_device.hpp"
#include "dpr/shape.hpp"
#include "mesh/opacity.hpp"
#include "mesh/texture_atlas.hpp"
#include "solve/shape_checks.hpp"
#include "solve/shape_level.hpp"
#include "solve/shape_space.hpp"

namespace dpr {
namespace {

/// What pixels lack at a texel, and how much of them shows it.
struct Lack {
  glm::dvec3 sum{0.0}, weight{0.0};

  Lack operator+(const Lack& other) const { return {sum + other.sum, weight + other.weight}; }
  Lack operator-(const Lack& other) const { return {sum - other.sum, weight - other.weight}; }
};

/// The texels of a triangle: rows that are shorter by one each.
class TriangleTexels {
 public:
  explicit TriangleTexels(int side) : side_(side), values_(static_cast<std::size_t>(side * side)) {}

  Lack& at(int x, int y) { return values_[static_cast<std::size_t>(y * side_ + x)]; }

  /// Sums over boxes that reach `radius` texels to either side along rows, then along columns.
  void blur(int radius) {
    std::vector<Lack> sums(static_cast<std::size_t>(side_) + 1);
    const auto blur_line = [&](int line, bool is_row) {
      const int count = side_ - line;
      const auto value = [&](int i) -> Lack& { return is_row ? at(i, line) : at(line, i); };
      for (int i = 0; i < count; ++i)
        sums[static_cast<std::size_t>(i) + 1] = sums[static_cast<std::size_t>(i)] + value(i);
      for (int i = 0; i < count; ++i) {
        value(i) = sums[static_cast<std::size_t>(std::min(i + radius + 1, count))] -
                   sums[static_cast<std::size_t>(std::max(i - radius, 0))];
      }
    };
    for (const bool is_row : {true, false}) {
      for (int line = 0; line < side_; ++line) blur_line(line, is_row);
    }
  }

 private:
  int side_;
  std::vector<Lack> values_;
};

/// Radii, in texels, of two boxes in turn that are as wide as a pixel, by face.
std::vector<int> pixel_radii(const Mesh& mesh, const TextureAtlas& atlas, double pixel) {
  constexpr double k_deviation = 0.5;  // pixels
  std::vector<int> radii;
  for (const glm::uvec3& f : mesh.faces) {
    const glm::dvec3 a = mesh.positions[f.x], b = mesh.positions[f.y], c = mesh.positions[f.z];
    const double leg = std::sqrt(glm::length(glm::cross(b - a, c - a)));  // of a right triangle of that area
    const double texels = std::min(k_deviation * pixel * atlas.leg() / leg, double(atlas.leg()));
    radii.push_back(leg > 0 ? static_cast<int>(std::lround((std::sqrt(6 * texels * texels + 1) - 1) / 2))
                            : 0);
  }
  return radii;
}

/// The view without the pixels at the silhouette's border: the background, and what lies beyond the edge, is mixed in.
ShapeView without_border(ShapeView view) {
  constexpr float k_opaque = 0.999F;
  if (!view.has_alpha) return view;
  const Image& image = view.image;
  Image mask = view.mask.pixels.empty() ? Image(image.width, image.height, glm::vec4(1)) : view.mask;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const auto alpha = [&](int u, int v) {
        return image
            .pixels[static_cast<std::size_t>(std::clamp(v, 0, image.height - 1) * image.width +
                                             std::clamp(u, 0, image.width - 1))]
            .a;
      };
      float least = 1;
      for (int v = -1; v <= 1; ++v) {
        for (int u = -1; u <= 1; ++u) least = std::min(least, alpha(x + u, y + v));
      }
      if (least < k_opaque) mask.pixels[static_cast<std::size_t>(y * image.width + x)] = glm::vec4(0);
    }
  }
  const bool is_thin =
      std::ranges::all_of(mask.pixels, [](const glm::vec4& pixel) { return !(pixel.x > 0); });
  if (!is_thin) view.mask = std::move(mask);
  return view;
}

std::vector<glm::dvec3> texel_gradient(const MultiDeviceRenderer::Evaluation& found) {
  const std::vector<glm::vec3>& gradient = found.gradient.meshes.front().textures.front();
  return {gradient.begin(), gradient.end()};
}

}  // namespace

Mesh find_texture(std::vector<Device> devices, const ShapeViews& all, const Mesh& mesh, int side,
                  const std::function<bool(unsigned iteration, double loss)>& callback) {
  constexpr std::size_t k_views_at_once = 24;
  constexpr double k_rounding = 1e-6;   // of the largest weight
  constexpr double k_relaxation = 0.3;  // whole steps fit noise and errors of the shape before ten are done
  MultiDeviceRenderer renderer(std::move(devices));
  check_shape_views(all);
  validate(mesh, "mesh (texture)");
  require_opaque(mesh, "mesh to texture");
  ShapeViews views = all;
  std::ranges::transform(all.views, views.views.begin(), without_border);
  ShapeOptions options;
  options.levels = 1;
  options.loss = LossWeights::only(LossKind::mse);
  options.depth = options.normal = 0;
  const ShapeLevel level(views, options, 0);
  const ShapeTargets targets(views, options, level);
  Scene scene = scene_of_level(views, level, with_atlas(mesh, side), finest_smoothing(views, options));
  scene.gradients.texture = true;
  renderer.set_chunk(k_views_at_once);
  renderer.set_scene(scene);
  renderer.set_views(level.views);
  renderer.set_loss(targets.loss(), targets.images);

  Mesh& textured = scene.meshes.front().mesh;
  std::vector<glm::vec3>& texels = textured.textures.front().texels;
  const auto gradient_of = [&](float value) {
    renderer.set_texels(0, 0, std::vector(texels.size(), glm::vec3(value)));
    return texel_gradient(renderer.evaluate());
  };
  // The loss is quadratic in the texels: its slopes at 1 and 0 differ by what all texels together weigh.
  std::vector<glm::dvec3> weights = gradient_of(1);
  const std::vector<glm::dvec3> at_black = gradient_of(0);
  for (std::size_t k = 0; k < weights.size(); ++k) weights[k] -= at_black[k];
  double least = 0;  // less is rounding
  for (const glm::dvec3& weight : weights)
    least = std::max({least, k_rounding * weight.x, k_rounding * weight.y, k_rounding * weight.z});
  const TextureAtlas atlas(mesh.faces.size(), side);
  const std::vector<int> radii = pixel_radii(mesh, atlas, common_view(views).pixel);
  for (unsigned i = 0; i < k_texture_iterations; ++i) {
    renderer.set_texels(0, 0, texels);
    const MultiDeviceRenderer::Evaluation found = renderer.evaluate();
    if (callback && !callback(i, found.loss)) break;
    const std::vector<glm::dvec3> gradient = texel_gradient(found);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      TriangleTexels lack(atlas.leg() + 3);
      atlas.for_texels(f, [&](std::size_t texel, const glm::ivec2& at) {
        lack.at(at.x, at.y) = {-gradient[texel], glm::max(weights[texel], glm::dvec3(0))};
      });
      for (int pass = 0; pass < 2; ++pass) lack.blur(radii[f]);
      atlas.for_texels(f, [&](std::size_t texel, const glm::ivec2& at) {
        const Lack& sum = lack.at(at.x, at.y);
        for (int c = 0; c < 3; ++c) {
          if (!(sum.weight[c] > least)) continue;
          const double step = k_relaxation * sum.sum[c] / sum.weight[c];
          texels[texel][c] = std::clamp(texels[texel][c] + static_cast<float>(step), 0.0F, 1.0F);
        }
      });
    }
  }
  return std::move(textured);
}

}  // namespace dpr
