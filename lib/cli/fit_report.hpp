// Report of the shape solver: numbers, pictures and plots.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "cli/json.hpp"
#include "cli/page.hpp"
#include "dpr/shape.hpp"

namespace dpr::cli {

/// Watches a solver: shows how far it is, and hands on the mesh at a few iterations.
class FitObserver {
 public:
  FitObserver(unsigned iterations, bool quiet, ShapeSolver::Callback keep = {});

  /// The callback for ShapeSolver::solve(). It must not outlive the observer.
  ShapeSolver::Callback callback();

 private:
  unsigned iterations_;
  bool quiet_;
  ShapeSolver::Callback keep_;
};

/// A mesh as the rigid renderer shows it; without lights, its colours as they are.
std::vector<Image> render_rigidly(const Device& device, const Mesh& mesh, const std::vector<Camera>& cameras,
                                  int width, int height, glm::vec3 background = glm::vec3(0),
                                  const std::optional<Lights>& lights = {});

/// Difference of a shape from its views' measurements, where it is seen: means of absolute differences of
/// depths, world units, and of normals' components. None: no view has measured them, or nothing is seen.
struct MeasuredDifferences {
  std::optional<double> depth, normal;
};

/// The texture that a shape was given in the place of its colours.
struct ShapeTexture {
  int side = 0;           ///< texels
  double difference = 0;  ///< mean squared, of colours
};

/// The report's folder. The pictures of iterations are written while the solver works: an interrupted run
/// leaves them, and a run that goes on from its checkpoint shows them too.
class FitReport {
 public:
  /// Makes the folder if need be. Throws IoError. The first of the devices renders, or where it is lost the
  /// next; where all are, what is called throws DeviceError.
  FitReport(std::filesystem::path folder, std::vector<Device> devices, const ShapeViews& views,
            std::vector<std::string> names);

  /// Writes iterations/N.png: the mesh as the first camera sees it. Throws IoError.
  void keep(unsigned iteration, const Mesh& mesh) const;
  /// Writes targets, results, differences, the same of the images that are explained worst, turntable and plot (all
  /// PNG), fit.json with the history, and index.html that shows them. All meshes are rendered rigidly. `texture`: of
  /// the result's mesh. Throws IoError.
  void write(const PageSource& source, const ShapeResult& result, const std::optional<ShapeTexture>& texture,
             bool quiet) const;

 private:
  /// Returns the result of `work` on the first device that is not lost.
  template <class Work>
  auto on_any_device(const Work& on) const;
  std::vector<Image> render(const Mesh& mesh, const std::vector<Camera>& cameras) const;
  MeasuredDifferences measured_differences(const Mesh& mesh) const;
  std::vector<Picture> frames(const ShapeResult& result) const;
  /// Target, shape and difference of each of these views; files begin with the prefix.
  std::vector<std::vector<Picture>> compare_views(const ShapeResult& result,
                                                  const std::vector<std::size_t>& views,
                                                  const std::string& prefix) const;

  std::filesystem::path folder_;
  std::vector<Device> devices_;
  const ShapeViews& views_;
  std::vector<std::string> names_;  // of the images
};

}  // namespace dpr::cli
