// Rigid motions of several meshes.
#include "solve/pose_body.hpp"

#include "solve/polar.hpp"

namespace dpr {

PoseBody::PoseBody(const Scene& scene, std::span<const std::size_t> meshes) {
  for (const Instance& instance : scene.meshes) transforms_.push_back(instance.transform);
  const std::size_t first = meshes.empty() ? 0 : meshes.front();
  const glm::dmat4 transform(transforms_[first]);
  const Polar polar = polar_decomposition(glm::dmat3(transform));
  pose_ = {polar.rotation, glm::dvec3(transform[3])};
  parts_.push_back({first, polar.stretch, glm::dvec3(0)});
  const glm::dmat3 to_body = glm::transpose(pose_.rotation);
  for (std::size_t i = 1; i < meshes.size(); ++i) {
    const glm::dmat4 other(transforms_[meshes[i]]);
    parts_.push_back(
        {meshes[i], to_body * glm::dmat3(other), to_body * (glm::dvec3(other[3]) - pose_.translation)});
  }
}

namespace {

glm::mat4 part_transform(const BodyPart& part, const Pose& pose) {
  return affine(pose.rotation * part.linear, pose.translation + pose.rotation * part.offset);
}

}  // namespace

std::vector<glm::mat4> PoseBody::transforms(const Pose& pose) const {
  std::vector<glm::mat4> result = transforms_;
  for (const BodyPart& part : parts_) result[part.mesh] = part_transform(part, pose);
  return result;
}

void PoseBody::place(Scene& scene, const Pose& pose) const {
  for (const BodyPart& part : parts_) scene.meshes[part.mesh].transform = part_transform(part, pose);
}

std::vector<PoseGradient> PoseBody::turning(const Pose& pose, const glm::dvec3& axis) const {
  std::vector<PoseGradient> result(transforms_.size());
  for (const BodyPart& part : parts_)
    result[part.mesh] = {axis, glm::cross(axis, pose.rotation * part.offset)};
  return result;
}

std::vector<PoseGradient> PoseBody::shifting(const glm::dvec3& shift) const {
  std::vector<PoseGradient> result(transforms_.size());
  for (const BodyPart& part : parts_) result[part.mesh].translation = shift;
  return result;
}

PoseGradient PoseBody::gradient(const Pose& pose, std::span<const PoseGradient> transforms) const {
  PoseGradient sum;
  for (const BodyPart& part : parts_) {
    const PoseGradient& own = transforms[part.mesh];
    sum.rotation += own.rotation + glm::cross(pose.rotation * part.offset, own.translation);
    sum.translation += own.translation;
  }
  return sum;
}

std::vector<glm::dvec3> PoseBody::points(const Scene& scene) const {
  std::vector<glm::dvec3> result;
  for (const BodyPart& part : parts_) {
    for (const glm::vec3& p : mesh_of(scene, part.mesh).positions)
      result.push_back(part.linear * glm::dvec3(p) + part.offset);
  }
  return result;
}

}  // namespace dpr
