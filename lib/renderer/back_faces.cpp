#include "renderer/back_faces.hpp"

#include <algorithm>
#include <limits>

#include "mesh/bounding_box.hpp"

namespace dpr {

BackFaces::BackFaces(std::vector<Solid> solids, bool are_placed) : states_(solids.size()) {
  for (std::size_t m = 0; m < solids.size(); ++m) {
    states_[m].solid = std::move(solids[m]);
    states_[m].may_have_parted = !are_placed;
  }
}

void BackFaces::move(std::size_t mesh) noexcept {
  states_[mesh].may_have_parted = true;
  states_[mesh].is_measured = false;
}

void BackFaces::measure(State& state, const Mesh& mesh) {
  state.is_measured = true;
  const bool is_closed =
      state.solid.is_closed() && (state.solid.is_closed_by_indices() || !state.may_have_parted);
  state.winding = is_closed ? state.solid.winding(mesh.positions, mesh.faces) : 0;
  if (state.winding == 0) return;
  const Bounds box = bounding_box(mesh.positions);
  state.corners.clear();
  for (unsigned corner = 0; corner < 8; ++corner) {
    state.corners.emplace_back((corner & 1U) != 0 ? box.high.x : box.low.x,
                               (corner & 2U) != 0 ? box.high.y : box.low.y,
                               (corner & 4U) != 0 ? box.high.z : box.low.z);
  }
}

float BackFaces::hidden_of(const State& state, const Camera& camera, const glm::mat4& model,
                           float depth_reach) {
  constexpr double k_rounding = 1e-5, k_least_thickness = 10;  // of the depth; of the noise's reach
  if (state.winding == 0) return 0;
  const glm::dmat4 to_view = glm::dmat4(camera.view) * glm::dmat4(model);
  double nearest = std::numeric_limits<double>::infinity(), furthest = -nearest;
  for (const glm::dvec3& corner : state.corners) {
    const double depth = -(to_view * glm::dvec4(corner, 1)).z;
    nearest = std::min(nearest, depth);
    furthest = std::max(furthest, depth);
  }
  const double thickness =
      (furthest - nearest) / (static_cast<double>(camera.zfar) - static_cast<double>(camera.znear));
  const bool is_in_front = nearest > static_cast<double>(camera.znear) + k_rounding * furthest;
  if (!is_in_front || !(thickness > k_least_thickness * static_cast<double>(depth_reach))) return 0;
  const double determinant = glm::determinant(glm::dmat3(to_view));
  if (determinant == 0) return 0;
  return determinant * state.winding > 0 ? -1.0F : 1.0F;
}

std::vector<float> BackFaces::hidden(const Scene& scene, std::span<const View> views, float depth_reach) {
  for (std::size_t m = 0; m < states_.size(); ++m) {
    if (!states_[m].is_measured) measure(states_[m], scene.meshes[m].mesh);
  }
  std::vector<float> hidden;
  for (const View& view : views) {
    for (std::size_t m = 0; m < states_.size(); ++m)
      hidden.push_back(hidden_of(states_[m], view.camera, view.transforms[m], depth_reach));
  }
  return hidden;
}

}  // namespace dpr
