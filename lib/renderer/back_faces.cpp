#include "renderer/back_faces.hpp"

namespace dpr {

BackFaces::BackFaces(std::vector<Solid> solids) : states_(solids.size()) {
  for (std::size_t m = 0; m < solids.size(); ++m) states_[m].solid = std::move(solids[m]);
}

void BackFaces::move(std::size_t mesh) noexcept { states_[mesh].is_measured = false; }

void BackFaces::forget(std::size_t mesh) noexcept {
  move(mesh);
  states_[mesh].is_measured = true;
  states_[mesh].winding = 0;
}

void BackFaces::measure(State& state, const Mesh& mesh) {
  state.is_measured = true;
  state.winding = state.solid.winding(mesh.positions, mesh.faces);
}

float BackFaces::hidden_of(int winding, const BoxCorners& box, const Camera& camera, const glm::mat4& model,
                           float depth_reach) {
  constexpr double k_least_thickness = 10;  // of the noise's reach
  const DepthRange range = depth_range(box, camera, model);
  const double thickness = (range.furthest - range.nearest) /
                           (static_cast<double>(camera.zfar) - static_cast<double>(camera.znear));
  if (!is_beyond_near_plane(range, camera) ||
      !(thickness > k_least_thickness * static_cast<double>(depth_reach)))
    return 0;
  const double determinant = glm::determinant(glm::dmat3(glm::dmat4(camera.view) * glm::dmat4(model)));
  if (determinant == 0) return 0;
  return determinant * winding > 0 ? -1.0F : 1.0F;
}

std::vector<float> BackFaces::hidden(const Scene& scene, std::span<const View> views, NearPlane& near_plane,
                                     float depth_reach) {
  for (std::size_t m = 0; m < states_.size(); ++m) {
    if (!states_[m].is_measured && !scene.meshes[m].instance_of) measure(states_[m], scene.meshes[m].mesh);
  }
  std::vector<float> hidden;
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::size_t m = 0; m < states_.size(); ++m) {
      const int winding = states_[scene.meshes[m].instance_of.value_or(m)].winding;
      hidden.push_back(winding == 0 ? 0.0F
                                    : hidden_of(winding, near_plane.box_of(scene, v, m), views[v].camera,
                                                views[v].transforms[m], depth_reach));
    }
  }
  return hidden;
}

}  // namespace dpr
