// The benchmark workloads by name: the published program's scenes and settings, the library's own, and
// sweeps.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dpr/renderer.hpp"
#include "dpr/scene.hpp"

namespace dpr::bench {

/// What a step of a descent changes before it renders.
enum class Moves { shape, camera };

/// One way in which a workload is rendered.
struct Variant {
  /// "gaussian" and "softras": the priors; "default": what Smoothing{} says; "pixel", with a blur of four
  /// pixels; "pixel-sharp" and "sharp": noise of the pixel and of the triangles of half a pixel, which comes
  /// nearest to a z-buffer with antialiased silhouettes.
  std::string preset;
  Smoothing smoothing;
  Moves moves = Moves::shape;  ///< shape: positions and vertex colours
};

/// A scene, its views, and every way in which it is measured: estimators, samples, priors, compositions.
struct Workload {
  std::string name;  ///< "sphere256"
  Scene scene;
  std::vector<View> views;  ///< one, or a batch
  std::vector<Variant> variants;
};

/// The names of the fixed workloads, small scenes first, and of the sweeps: of one thing, all else fixed.
std::vector<std::string_view> workload_names();
std::vector<std::string_view> sweep_names();

/// A workload's description, one line.
std::string_view describe(std::string_view name);

/// Throws InvalidArgument for a name that is none of them.
void require_workload(std::string_view name);

/// The scenes of a name: one, or those of a sweep. Throws InvalidArgument for an unknown name.
std::vector<Workload> make_workloads(std::string_view name);

}  // namespace dpr::bench
