// The ways in which the pose experiments solve their problems.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dpr/pose.hpp"
#include "experiments/pose/problems.hpp"

namespace dpr::bench {

/// A method by name, and where a figure varies the published protocol, how.
struct PoseMethod {
  std::string name = "default";
  std::optional<std::uint32_t> samples = {};  ///< to begin with; left out: 8
  std::optional<float> sigma = {}, gamma = {};  ///< to begin with
  VarianceReduction variance_reduction = VarianceReduction::rigid;
  bool adaptive = true;  ///< the smoothing shrinks, and the samples double
};

struct MethodName {
  std::string_view name, description;
};

/// All methods.
std::vector<MethodName> pose_method_names();

/// Name and variation as a part of a file's name.
std::string label(const PoseMethod& method);

/// Solves one problem. The published protocol's noise depends on the set's seed. Throws InvalidArgument for
/// an unknown name, and for a translation with a method that only turns.
PoseResult solve_problem(const PoseMethod& method, const Device& device, const Scene& scene,
                         const PoseProblemSet& set, const PoseProblem& problem, const Image& target,
                         bool smoke);

}  // namespace dpr::bench
