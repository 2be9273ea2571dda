// Hypotheses with which the search for a lost object begins.
#pragma once

#include <cstddef>
#include <vector>

#include "dpr/scene.hpp"
#include "solve/pose_space.hpp"

namespace dpr {

/// A pose, and poses about it: turned about each of the world's axes and, where the translation is looked for, shifted
/// along the image's.
std::vector<Hypothesis> hypotheses_about(const Pose& pose, const PoseSpace& space, const Scene& scene,
                                         bool solves_translation);

/// Some `rotations` in all, spread over all rotations at a place or, where the translation is looked for, at places
/// all over the image at the depth of that place too.
std::vector<Hypothesis> hypotheses_everywhere(const glm::dvec3& place, const PoseSpace& space,
                                              const Scene& scene, std::size_t rotations,
                                              bool solves_translation);

}  // namespace dpr
