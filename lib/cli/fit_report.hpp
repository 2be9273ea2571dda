// What the shape solver did, as numbers, pictures and plots.
#pragma once

#include <filesystem>
#include <vector>

#include "cli/json.hpp"
#include "dpr/shape.hpp"

namespace dpr::cli {

/// Watches a solver: shows how far it is, and keeps the mesh at a few iterations for the report.
class FitObserver {
 public:
  FitObserver(unsigned iterations, bool quiet, bool keeps_meshes);

  /// For ShapeSolver::solve(). Must not outlive the observer.
  ShapeSolver::Callback callback();
  const std::vector<Mesh>& kept() const { return kept_; }

 private:
  unsigned iterations_;
  bool quiet_, keeps_meshes_;
  std::vector<Mesh> kept_;
};

/// A mesh as the rigid renderer shows it.
std::vector<Image> render_rigidly(const Device& device, const Mesh& mesh, const std::vector<Camera>& cameras,
                                  int width, int height, glm::vec3 background = glm::vec3(0));

/// Writes targets, results, turntable, iterations and plot (all PNG), fit.json with the history, and
/// index.html that shows them, into a folder, which is made if need be. All is rendered rigidly. Throws
/// IoError.
void write_fit_report(const std::filesystem::path& folder, const Device& device, const ShapeViews& views,
                      const ShapeResult& result, const std::vector<Mesh>& kept, bool quiet);

}  // namespace dpr::cli
