// The benchmark workloads by name: the published program's scenes and settings, and the library's own.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dpr/renderer.hpp"
#include "dpr/scene.hpp"

namespace dpr::bench {

/// One row of the results: a scene rendered one way.
struct Workload {
  std::string name;    ///< "sphere256"
  std::string preset;  ///< "gaussian" or "softras": the priors
  Scene scene;
  std::vector<View> views;  ///< one, or a batch
};

/// The names that make_workloads knows, small scenes first.
std::vector<std::string_view> workload_names();

/// Every way in which a workload is measured: estimators, samples, priors, compositions. Throws
/// InvalidArgument for an unknown name.
std::vector<Workload> make_workloads(std::string_view name);

}  // namespace dpr::bench
