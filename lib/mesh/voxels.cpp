// Solids on a grid: along each axis, the signed crossings of every column's ray with the surface are added
// up.
#include "dpr/voxels.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>

#include "base/checks.hpp"

namespace dpr {
namespace {

constexpr unsigned k_highest_resolution = 512;

/// Centres of the cells along one axis.
struct Axis {
  double low, cell;
  int count;

  double centre(int i) const { return low + (i + 0.5) * cell; }
  /// The first cell whose centre is not below x; 0 to count.
  int first_from(double x) const {
    const double guess = std::clamp((x - low) / cell - 0.5, -1.0, static_cast<double>(count));
    int i = std::max(static_cast<int>(guess) - 1, 0);
    while (i < count && centre(i) < x) ++i;
    return i;
  }
};

using Axes = std::array<Axis, 3>;

Axes make_axes(unsigned resolution, const Bounds& bounds) {
  Axes axes;
  for (int i = 0; i < 3; ++i) {
    const double low = bounds.low[i], high = bounds.high[i];
    axes[static_cast<std::size_t>(i)] = {low, (high - low) / resolution, static_cast<int>(resolution)};
  }
  return axes;
}

/// On which side of the line from p to q a point lies. Both faces at an edge get the same value, because its
/// ends are put in order first; a point on the line counts as displaced by (e, e^2), e -> 0.
struct Side {
  double value;
  int sign;
};

Side side_of(glm::dvec2 p, glm::dvec2 q, glm::dvec2 point) {
  const bool swapped = q.x < p.x || (q.x == p.x && q.y < p.y);
  if (swapped) std::swap(p, q);
  const glm::dvec2 along = q - p, to_point = point - p;
  const double value = along.x * to_point.y - along.y * to_point.x;
  const double decisive = value != 0 ? value : along.y != 0 ? -along.y : along.x;
  const int sign = decisive > 0 ? 1 : decisive < 0 ? -1 : 0;
  return swapped ? Side{-value, -sign} : Side{value, sign};
}

/// A triangle with the ray's axis last, so that rays go up z.
using Corners = std::array<glm::dvec3, 3>;

/// Sign of the crossing, and where it is.
struct Crossing {
  int sign;
  double z;
};

Crossing cross(const Corners& t, glm::dvec2 point) {
  const Side a = side_of(t[1], t[2], point), b = side_of(t[2], t[0], point), c = side_of(t[0], t[1], point);
  if (a.sign != b.sign || b.sign != c.sign) return {0, 0};
  const double area = a.value + b.value + c.value;
  const double z = area != 0 ? (a.value * t[0].z + b.value * t[1].z + c.value * t[2].z) / area : t[0].z;
  const auto [lowest, highest] = std::minmax({t[0].z, t[1].z, t[2].z});
  return {a.sign, std::clamp(z, lowest, highest)};
}

/// Winding numbers of the cells, or how many crossings lie below them, by rays up one axis.
class Columns {
 public:
  Columns(const Axes& axes, int up)
      : u_(axes[static_cast<std::size_t>((up + 1) % 3)]),
        v_(axes[static_cast<std::size_t>((up + 2) % 3)]),
        w_(axes[static_cast<std::size_t>(up)]),
        up_(up),
        steps_(static_cast<std::size_t>(u_.count) * static_cast<std::size_t>(v_.count) *
               static_cast<std::size_t>(w_.count + 1)) {}

  void add(const Mesh& mesh, const glm::uvec3& face, FillRule rule) {
    Corners t;
    for (int i = 0; i < 3; ++i) {
      const glm::dvec3 p(mesh.positions[face[i]]);
      t[static_cast<std::size_t>(i)] = {p[(up_ + 1) % 3], p[(up_ + 2) % 3], p[up_]};
    }
    const auto [u_low, u_high] = std::minmax({t[0].x, t[1].x, t[2].x});
    const auto [v_low, v_high] = std::minmax({t[0].y, t[1].y, t[2].y});
    // A centre on the surface counts as displaced upwards on every axis: lower borders are inside.
    for (int u = u_.first_from(u_low); u < u_.first_from(u_high); ++u) {
      for (int v = v_.first_from(v_low); v < v_.first_from(v_high); ++v) {
        const Crossing crossing = cross(t, {u_.centre(u), v_.centre(v)});
        if (crossing.sign == 0) continue;
        steps_[at(u, v, w_.first_from(crossing.z))] += rule == FillRule::nonzero ? crossing.sign : 1;
      }
    }
  }

  /// One vote for every cell inside.
  void vote(FillRule rule, const VoxelGrid& grid, std::vector<std::uint8_t>& votes) const {
    for (int u = 0; u < u_.count; ++u) {
      for (int v = 0; v < v_.count; ++v) {
        int sum = 0;
        for (int w = 0; w < w_.count; ++w) {
          sum += steps_[at(u, v, w)];
          if (rule == FillRule::nonzero ? sum != 0 : sum % 2 != 0) ++votes[cell(grid, u, v, w)];
        }
      }
    }
  }

 private:
  std::size_t at(int u, int v, int w) const {
    return (static_cast<std::size_t>(u) * static_cast<std::size_t>(v_.count) + static_cast<std::size_t>(v)) *
               static_cast<std::size_t>(w_.count + 1) +
           static_cast<std::size_t>(w);
  }

  std::size_t cell(const VoxelGrid& grid, int u, int v, int w) const {
    std::array<unsigned, 3> p{};
    p[static_cast<std::size_t>((up_ + 1) % 3)] = static_cast<unsigned>(u);
    p[static_cast<std::size_t>((up_ + 2) % 3)] = static_cast<unsigned>(v);
    p[static_cast<std::size_t>(up_)] = static_cast<unsigned>(w);
    return grid.index(p[0], p[1], p[2]);
  }

  Axis u_, v_, w_;
  int up_;
  std::vector<int> steps_;  // [u][v][w + 1]: by how much the sum changes on the way into a cell
};

void check(unsigned resolution, const Bounds& bounds) {
  if (resolution < 1 || resolution > k_highest_resolution) {
    throw InvalidArgument("resolution (voxels)", std::to_string(resolution),
                          "1 to " + std::to_string(k_highest_resolution));
  }
  checks::require_finite(bounds.low, "bounds.low (voxels)");
  checks::require_finite(bounds.high, "bounds.high (voxels)");
  if (glm::any(glm::lessThanEqual(bounds.high, bounds.low))) {
    throw InvalidArgument("bounds (voxels)", checks::text(bounds.low) + " to " + checks::text(bounds.high),
                          "a low corner below the high one on every axis");
  }
}

}  // namespace

std::size_t VoxelGrid::count() const { return std::accumulate(cells.begin(), cells.end(), std::size_t{0}); }

VoxelGrid voxelize(const Mesh& mesh, unsigned resolution, const Bounds& bounds, FillRule rule) {
  validate(mesh);
  check(resolution, bounds);
  constexpr std::uint8_t k_majority = 2;
  const Axes axes = make_axes(resolution, bounds);
  VoxelGrid grid{resolution, bounds, {}};
  grid.cells.assign(std::size_t{resolution} * resolution * resolution, 0);
  for (int up = 0; up < 3; ++up) {
    Columns columns(axes, up);
    for (const glm::uvec3& face : mesh.faces) columns.add(mesh, face, rule);
    columns.vote(rule, grid, grid.cells);
  }
  for (std::uint8_t& cell : grid.cells) cell = cell >= k_majority ? 1 : 0;
  return grid;
}

double iou(const VoxelGrid& a, const VoxelGrid& b) {
  if (a.resolution != b.resolution || a.cells.size() != b.cells.size()) {
    throw InvalidArgument("resolution (iou)", std::to_string(b.resolution), std::to_string(a.resolution));
  }
  if (a.bounds.low != b.bounds.low || a.bounds.high != b.bounds.high) {
    throw InvalidArgument("bounds (iou)", checks::text(b.bounds.low) + " to " + checks::text(b.bounds.high),
                          checks::text(a.bounds.low) + " to " + checks::text(a.bounds.high));
  }
  std::size_t both = 0, either = 0;
  for (std::size_t i = 0; i < a.cells.size(); ++i) {
    both += a.cells[i] & b.cells[i];
    either += a.cells[i] | b.cells[i];
  }
  return either == 0 ? 1.0 : static_cast<double>(both) / static_cast<double>(either);
}

}  // namespace dpr
