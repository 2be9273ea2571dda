// Poses about the object's middle.
#include "solve/pose_pivot.hpp"

#include "mesh/bounding_box.hpp"
#include "solve/pose_body.hpp"
#include "solve/pose_scatter.hpp"

namespace dpr {

namespace {

/// Middle of the body's bounding box, object space of its first part.
glm::vec3 middle_of(const Scene& scene, const PoseBody& body) {
  const glm::mat4 to_first = glm::inverse(scene.meshes[body.first().mesh].transform);
  std::vector<glm::vec3> points = mesh_of(scene, body.first().mesh).positions;
  for (const BodyPart& part : std::span(body.parts()).subspan(1)) {
    const glm::mat4 transform = to_first * scene.meshes[part.mesh].transform;
    for (const glm::vec3& p : mesh_of(scene, part.mesh).positions)
      points.emplace_back(transform * glm::vec4(p, 1));
  }
  return center(bounding_box(points));
}

}  // namespace

PosePivot::PosePivot(const Scene& scene, const PoseOptions& options) : scene_(scene) {
  if (!options.solve_translation) return;
  const PoseBody body(scene, options.meshes);
  const glm::vec3 middle = middle_of(scene, body);
  if (middle == glm::vec3(0)) return;
  arm_ = body.first().linear * glm::dvec3(middle);
  // Wherever the mesh stands, the origin moves within it, and it stays.
  const Mesh& mesh = mesh_of(scene_, body.first().mesh);
  for (std::size_t i = 0; i < scene_.meshes.size(); ++i) {
    glm::mat4& transform = scene_.meshes[i].transform;
    if (&mesh_of(scene_, i) == &mesh) transform[3] = transform * glm::vec4(middle, 1);
  }
  const Instance& first = scene_.meshes[body.first().mesh];
  for (glm::vec3& p : scene_.meshes[first.instance_of.value_or(body.first().mesh)].mesh.positions)
    p -= middle;
}

void PosePivot::to_origin(const Pose& pose, std::vector<double>& covariance) const {
  if (!covariance.empty() && arm_ != glm::dvec3(0)) move_pivot(-(pose.rotation * arm_), covariance);
}

}  // namespace dpr
