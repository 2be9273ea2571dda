// The page that shows what the pose solver did.
#pragma once

#include <filesystem>
#include <optional>

#include "dpr/pose.hpp"

namespace dpr::cli {

/// One HTML file that refers to the pictures of write_pose_report() beside it and to nothing else: it opens
/// without a network. Throws IoError.
void write_pose_page(const std::filesystem::path& file, const PoseResult& result, bool has_plot,
                     const std::optional<glm::dmat3>& truth);

}  // namespace dpr::cli
