// The auxiliary outputs of `dpr render --aov`.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dpr/aov.hpp"
#include "dpr/sampling_error.hpp"
#include "dpr/subdivision.hpp"

namespace dpr::cli {

class AovFiles {
 public:
  /// Throws InvalidArgument for a word that names none, and for uv of a scene without texture coordinates.
  AovFiles(const std::vector<std::string>& names, const std::string& output, const Scene& scene);

  /// Those that write() makes: OUT.NAME.exr for the output OUT.png.
  std::vector<std::filesystem::path> files() const;
  /// True for a NAME of these files.
  static bool is_name(std::string_view name);

  /// Writes them, from the last forward() of a renderer that draws `drawn`. Returns files(). Faces and barycentrics
  /// are the scene's.
  std::vector<std::string> write(Renderer& renderer, const Scene& scene, const SubdividedScene& drawn) const;
  /// A line on the standard error of the image, if the scene is sampled.
  void print_sampling_error(Renderer& renderer) const;

 private:
  std::string file_name(std::string_view name) const;
  const SamplingError& sampling_error(Renderer& renderer) const;

  std::string output_;
  std::vector<Aov> aovs_;
  bool standard_error_ = false, gradient_standard_error_ = false;
  mutable std::optional<SamplingError> sampling_error_;  // measured once
};

}  // namespace dpr::cli
