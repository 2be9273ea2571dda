#include "renderer/back_faces.hpp"

#include <algorithm>

namespace dpr {

BackFaces::BackFaces(std::vector<Solid> solids) : states_(solids.size()) {
  for (std::size_t m = 0; m < solids.size(); ++m) states_[m].solid = std::move(solids[m]);
}

void BackFaces::move(std::size_t mesh) noexcept { states_[mesh].is_measured = false; }

void BackFaces::forget(std::size_t mesh) noexcept {
  states_[mesh] = {std::move(states_[mesh].solid), /*is_measured*/ true};
}

namespace {

constexpr std::size_t k_many_faces = 1U << 16U;

}  // namespace

std::vector<int> BackFaces::windings_of(const Scene& scene, const Geometry& geometry,
                                        std::span<const glm::vec3> positions) const {
  std::vector<int> windings;
  const std::size_t views = positions.size() / geometry.position_count;
  for (std::size_t view = 0; view < views; ++view) {
    const std::span of_view = positions.subspan(view * geometry.position_count, geometry.position_count);
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      if (const auto source = scene.meshes[m].instance_of) {
        windings.push_back(windings[view * scene.meshes.size() + *source]);
        continue;
      }
      const std::vector<glm::uvec3>& all = scene.meshes[m].mesh.faces;
      const std::size_t count = all.size() / geometry.views_of_faces;
      const std::span faces(all.data() + (geometry.has_own_faces() ? view * count : 0), count);
      const Solid& solid = states_[geometry.has_own_faces() ? view : m].solid;
      const MeshRange& range = geometry.meshes[m];
      windings.push_back(count >= k_many_faces
                             ? 0
                             : solid.winding(of_view.subspan(range.first_position, range.vertices), faces));
    }
  }
  return windings;
}

void BackFaces::measure(const Scene& scene, const std::function<void(std::size_t mesh)>& measure_on_device) {
  for (std::size_t m = 0; m < states_.size(); ++m) {
    State& state = states_[m];
    if (state.is_measured || scene.meshes[m].instance_of) continue;
    const Mesh& mesh = scene.meshes[m].mesh;
    state.is_on_device = mesh.faces.size() >= k_many_faces && state.solid.is_one_part();
    if (state.is_on_device) measure_on_device(m);
    state.winding = state.is_on_device ? 1 : state.solid.winding(mesh.positions, mesh.faces);
    state.is_measured = true;
  }
}

bool BackFaces::are_on_device() const { return std::ranges::any_of(states_, &State::is_on_device); }

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

std::vector<float> BackFaces::hidden(const Scene& scene, std::span<const View> views, ClipPlanes& clip_planes,
                                     float depth_reach, std::span<const int> of_shapes) const {
  std::vector<float> hidden;
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      const int winding = of_shapes.empty() ? states_[scene.meshes[m].instance_of.value_or(m)].winding
                                            : of_shapes[v * scene.meshes.size() + m];
      hidden.push_back(winding == 0 ? 0.0F
                                    : hidden_of(winding, clip_planes.box_of(scene, v, m), views[v].camera,
                                                views[v].transforms[m], depth_reach));
    }
  }
  return hidden;
}

}  // namespace dpr
