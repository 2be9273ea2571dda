#include "dpr/clip_space.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/checks.hpp"
#include "dpr/error.hpp"

namespace dpr {
namespace {

constexpr double k_flat_depths = 1e-4, k_fit_rounding = 1e-4, k_least_near_of_w = 1e-6, k_least_divisor = 1e-30;
constexpr float k_orthographic_shift = 2, k_orthographic_near = 1, k_orthographic_far = 3.5F;

/// What a shape's used vertices say of its camera.
struct ShapeDepths {
  double least = HUGE_VAL, most = -HUGE_VAL, near = 0;  // of w; where OpenGL's near plane cuts it
  double a = 0, b = 0;                                  // z = a w + b
  bool is_affine = true;

  bool is_clipped() const { return least < near; }
  double scale() const { return 1 / std::max(is_clipped() ? near : least, k_least_divisor); }
  /// Growing w must not bring surfaces nearer by z / w, which drops by `fall` from the nearest to the furthest.
  bool suits_pinhole() const {
    const double fall = b * (scale() - 1 / most);
    const bool is_flat = most - least <= k_flat_depths * std::abs(most);
    return most <= 0 || (is_affine && fall <= k_fit_rounding && !is_flat);
  }
};

ShapeDepths depths_of(std::span<const glm::vec4> shape, const std::vector<bool>& used) {
  ShapeDepths d;
  double count = 0, mean_w = 0, mean_z = 0;
  const auto for_each = [&](const auto& visit) {
    for (std::size_t i = 0; i < shape.size(); ++i)
      if (used[i]) visit(double{shape[i].z}, double{shape[i].w});
  };
  for_each([&](double z, double w) {
    d.least = std::min(d.least, w);
    d.most = std::max(d.most, w);
    ++count;
    mean_w += w;
    mean_z += z;
  });
  mean_w /= count;
  mean_z /= count;
  double spread = 0, product = 0;
  for_each([&](double z, double w) {
    spread += (w - mean_w) * (w - mean_w);
    product += (w - mean_w) * (z - mean_z);
  });
  d.a = product / std::max(spread, 1e-300);
  d.b = mean_z - d.a * mean_w;
  double largest_z = 0, largest_w = 0;
  for_each([&](double z, double w) {
    largest_z = std::max(largest_z, std::abs(z));
    largest_w = std::max(largest_w, std::abs(w));
  });
  for_each([&](double z, double w) {
    d.is_affine = d.is_affine && std::abs(z - d.a * w - d.b) <= k_fit_rounding * (largest_z + largest_w);
  });
  // z = -w.
  if (d.a > -1) d.near = -d.b / std::max(d.a + 1, k_least_divisor);
  d.near = std::max(d.near, k_least_near_of_w * std::abs(d.most));
  return d;
}

}  // namespace

ClipSpace::ClipSpace(std::span<const glm::vec4> positions, std::size_t shapes,
                     std::span<const glm::uvec3> faces, int width, int height)
    : scales_(shapes, 1.0F), aspect_(static_cast<float>(width) / static_cast<float>(height)) {
  if (std::min(width, height) < 1 || std::max(width, height) > checks::k_largest_side)
    throw InvalidArgument("size (ClipSpace)", checks::size(width, height),
                          "1 to " + std::to_string(checks::k_largest_side) + " pixels a side");
  if (shapes == 0 || positions.empty() || positions.size() % shapes != 0)
    throw InvalidArgument("positions (ClipSpace)", std::to_string(positions.size()),
                          "as many of each of " + std::to_string(shapes) + " shapes, one at least");
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const glm::vec4& p = positions[i];
    if (!std::isfinite(p.x + p.y + p.z + p.w))
      throw InvalidArgument(checks::element("positions", i) + " (ClipSpace)", "a number that is not finite",
                            "finite numbers");
  }
  const std::size_t of_shape = positions.size() / shapes;
  used_.assign(of_shape, faces.empty());
  for (const glm::uvec3& face : faces) {
    for (int corner = 0; corner < 3; ++corner) {
      if (face[corner] >= of_shape)
        throw InvalidArgument("faces (ClipSpace)", std::to_string(face[corner]),
                              "below " + std::to_string(of_shape));
      used_[face[corner]] = true;
    }
  }
  bool suit_pinhole = true, are_in_front = true;
  std::vector<ShapeDepths> all;
  for (std::size_t shape = 0; shape < shapes; ++shape) {
    const ShapeDepths& d = all.emplace_back(depths_of(positions.subspan(shape * of_shape, of_shape), used_));
    suit_pinhole = suit_pinhole && d.suits_pinhole();
    are_in_front = are_in_front && d.least > k_least_near_of_w * std::abs(d.most);
  }
  if (!suit_pinhole && !are_in_front) {
    throw InvalidArgument(
        "positions (ClipSpace)",
        "some behind the camera (w <= 0), and z that is no affine function of w that orders depths",
        "those of one projection matrix a shape, or all in front of the camera");
  }
  if (!suit_pinhole) {
    camera_.orthographic_height = 2.0F;
    camera_.znear = k_orthographic_near;
    camera_.zfar = k_orthographic_far;
    return;
  }
  bool some_are_clipped = false;
  double furthest = 0;
  for (std::size_t shape = 0; shape < shapes; ++shape) {
    some_are_clipped = some_are_clipped || all[shape].is_clipped();
    furthest = std::max(furthest, all[shape].scale() * all[shape].most);
    scales_[shape] = static_cast<float>(all[shape].scale());
  }
  const float across = static_cast<float>(width) / 2, down = static_cast<float>(height) / 2;
  camera_.intrinsics = Intrinsics{across, down, across, down};
  camera_.znear = some_are_clipped ? 1.0F : 0.999F;
  camera_.zfar = static_cast<float>(std::max(1.01 * furthest, 2.0));
}

void ClipSpace::require_size(std::size_t count, const char* name) const {
  const std::size_t expected = scales_.size() * used_.size();
  if (count != expected)
    throw InvalidArgument(std::string(name) + " (ClipSpace)", std::to_string(count),
                          std::to_string(expected));
}

std::vector<glm::vec3> ClipSpace::vertices(std::span<const glm::vec4> positions) const {
  require_size(positions.size(), "positions");
  std::vector<glm::vec3> found;
  found.reserve(positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const glm::vec4& p = positions[i];
    if (is_perspective()) {
      found.push_back(scales_[i / used_.size()] * glm::vec3(p.x, p.y, -p.w));
    } else {
      const glm::vec3 ndc = used_[i % used_.size()] ? glm::vec3(p) / p.w : glm::vec3(0);
      found.emplace_back(aspect_ * ndc.x, ndc.y, -ndc.z - k_orthographic_shift);
    }
  }
  return found;
}

std::vector<glm::vec4> ClipSpace::gradient(std::span<const glm::vec4> positions,
                                           std::span<const glm::vec3> grad_vertices) const {
  require_size(positions.size(), "positions");
  require_size(grad_vertices.size(), "grad_vertices");
  std::vector<glm::vec4> found;
  found.reserve(positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const glm::vec4& p = positions[i];
    const glm::vec3& g = grad_vertices[i];
    if (is_perspective()) {
      found.push_back(scales_[i / used_.size()] * glm::vec4(g.x, g.y, 0, -g.z));
    } else if (used_[i % used_.size()]) {
      const glm::vec3 of_ndc(aspect_ * g.x, g.y, -g.z);
      found.emplace_back(of_ndc / p.w, -glm::dot(of_ndc, glm::vec3(p)) / (p.w * p.w));
    } else {
      found.emplace_back(0);
    }
  }
  return found;
}

}  // namespace dpr
