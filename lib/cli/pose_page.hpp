// The page that shows what the pose solver did.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "cli/page.hpp"
#include "dpr/pose.hpp"

namespace dpr::cli {

/// The pictures that write_pose_report() left.
struct PosePictures {
  Picture target, start, end, difference;
  std::vector<Picture> frames;  ///< the start and iterations
  bool has_plot = false;
};

/// One HTML file that refers to the pictures beside it. Throws IoError.
void write_pose_page(const std::filesystem::path& file, const PageSource& source, const PoseResult& result,
                     const PosePictures& pictures, const std::optional<glm::dmat3>& truth);

}  // namespace dpr::cli
