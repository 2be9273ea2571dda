#include "solve/shape_cameras.hpp"

#include <array>

#include "dpr/optimizer.hpp"
#include "dpr/pose.hpp"

namespace dpr {
namespace {

/// The matrix turned about a point, of its own coordinates, then moved.
glm::dmat4 moved(const glm::dmat4& view, const glm::dvec3& about, const glm::dvec3& turn,
                 const glm::dvec3& shift) {
  const glm::dmat3 rotation = rotation_from_vector(turn);
  glm::dmat4 result(rotation * glm::dmat3(view));
  result[3] = glm::dvec4(about + rotation * (glm::dvec3(view[3]) - about) + shift, 1.0);
  return result;
}

}  // namespace

std::vector<ShapeState::MovedCamera> unmoved_cameras(const ShapeViews& views) {
  std::vector<ShapeState::MovedCamera> cameras;
  for (const ShapeView& view : views.views) cameras.push_back({glm::dmat4(view.camera.view), {}});
  return cameras;
}

std::vector<Camera> moved_cameras(const ShapeViews& views, std::span<const ShapeState::MovedCamera> cameras) {
  std::vector<Camera> result;
  for (const ShapeView& view : views.views) result.push_back(view.camera);
  for (std::size_t i = 0; i < cameras.size(); ++i) result[i].view = glm::mat4(cameras[i].view);
  return result;
}

void move_cameras(std::span<const ViewGradient> gradients, std::span<const std::size_t> which,
                  const CommonView& common, double learning_rate,
                  std::vector<ShapeState::MovedCamera>& cameras) {
  Optimizer optimizer(OptimizerOptions{.learning_rate = learning_rate});
  for (std::size_t i = 0; i < which.size(); ++i) {
    ShapeState::MovedCamera& camera = cameras[which[i]];
    const PoseGradient& grad = gradients[i].camera.view;
    const glm::dvec3 about(camera.view * glm::dvec4(common.centre, 1.0));
    const glm::dvec3 by_turn =
        grad.rotation + glm::cross(glm::dvec3(camera.view[3]) - about, grad.translation);
    const glm::dvec3 by_shift = common.radius * grad.translation;
    optimizer.set_state(camera.steps);
    const auto step =
        optimizer.step(std::array{by_turn.x, by_turn.y, by_turn.z, by_shift.x, by_shift.y, by_shift.z});
    camera.view = moved(camera.view, about, {step[0], step[1], step[2]},
                        common.radius * glm::dvec3(step[3], step[4], step[5]));
    camera.steps = optimizer.state();
  }
}

void anchor(const ShapeViews& views, const CommonView& common, std::vector<ShapeState::MovedCamera>& cameras,
            std::span<double> positions) {
  const auto count = static_cast<double>(cameras.size());
  glm::dvec3 turn(0.0), shift(0.0);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    // A moved camera sees a point where its own one sees motion * point.
    const glm::dmat4 motion = glm::inverse(glm::dmat4(views.views[i].camera.view)) * cameras[i].view;
    turn += vector_from_rotation(glm::dmat3(motion)) / count;
    shift += (glm::dvec3(motion * glm::dvec4(common.centre, 1.0)) - common.centre) / count;
  }
  const glm::dmat4 motion = moved(glm::dmat4(1.0), common.centre, turn, shift);
  for (ShapeState::MovedCamera& camera : cameras) camera.view = camera.view * glm::inverse(motion);
  for (std::size_t i = 0; i < positions.size(); i += 3) {
    const glm::dvec4 place = motion * glm::dvec4(positions[i], positions[i + 1], positions[i + 2], 1.0);
    for (int k = 0; k < 3; ++k) positions[i + static_cast<std::size_t>(k)] = place[k];
  }
}

}  // namespace dpr
