// The ways in which the pose experiments solve their problems.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dpr/pose.hpp"
#include "experiments/pose/problems.hpp"

namespace dpr::bench {

/// - default: what users get: least squares, robust where the set hides or clutters something; it searches
/// where the
///   initial rotation is uniform
/// - softras, paper_gaussian, paper_cauchy: the published protocol with these presets: 800 iterations of Adam
/// with a
///   learning rate of 5e-2, the adaptive schedule, samples from 8 to 128, one descent; the best pose is the
///   answer
/// - exact, joint: the same protocol with the exact Gaussian estimator, in the barrier and the joint
/// composition
/// - anneal: this library's descent: annealed smoothing, joint composition, restarts
std::vector<std::string_view> pose_method_names();

/// Throws InvalidArgument for an unknown name, and for a set that the method has no answer to.
PoseResult solve_problem(std::string_view method, const Device& device, const Scene& scene,
                         const PoseProblemSet& set, const PoseProblem& problem, const Image& target,
                         bool smoke);

}  // namespace dpr::bench
