// State of a shape solver between two iterations, in memory and on disk.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "dpr/optimizer.hpp"
#include "dpr/shape.hpp"

namespace dpr {

struct ShapeState {
  /// State of an adaptive smoothing: its present scales, and the average sensitivity.
  struct Adaptive {
    float sigma = 0, gamma = 0;
    std::uint32_t samples = 0;
    double average = 0;
  };

  /// A camera that moves along with the shape.
  struct MovedCamera {
    glm::dmat4 view{1.0};  ///< world to camera
    OptimizerState steps;
  };

  unsigned iteration = 0;  ///< the next one
  std::vector<glm::uvec3> faces;
  std::vector<double> positions, colors;  ///< [vertex][3]
  OptimizerState position_steps, color_steps;
  Adaptive adaptive;
  std::vector<MovedCamera> cameras;  ///< [view] in the order of ShapeViews; empty where they stay
  std::vector<ShapeIteration> history;

  /// In single precision, as it is rendered.
  Mesh mesh() const;
};

/// A number that differs, with all likelihood, where views or options do.
std::uint64_t fingerprint(const ShapeViews& views, const Mesh& start, const ShapeOptions& options);

/// A file of that content, CBOR, with what makes damage show.
std::string checkpoint_bytes(std::string_view content, std::uint64_t fingerprint);

/// All or nothing. Throws IoError.
void write_checkpoint(const std::filesystem::path& file, const ShapeState& state, std::uint64_t fingerprint);

/// A file keeps of the history's smoothings what changes; `finest` is the rest. Throws IoError where the file
/// is no checkpoint or damaged, or has not so many moved cameras, InvalidArgument where its fingerprint is another.
ShapeState read_checkpoint(const std::filesystem::path& file, std::uint64_t fingerprint,
                           const Smoothing& finest, std::size_t cameras = 0);

}  // namespace dpr
