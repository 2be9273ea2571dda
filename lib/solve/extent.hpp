// The part of an image that shows something.
#pragma once

#include <glm/glm.hpp>
#include <optional>

#include "dpr/image.hpp"
#include "dpr/pose.hpp"

namespace dpr {

/// Bounding box of the pixels whose first channel is above half of the largest; none where all are 0.
std::optional<PoseBox> extent(const Image& weights);

/// Bounding box of what differs from a background of one colour by more than the picture's noise, without specks; none
/// where nothing does.
std::optional<PoseBox> extent_before(const Image& target, const glm::vec3& background);

}  // namespace dpr
