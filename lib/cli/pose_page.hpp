// The page that shows what the pose solver did.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cli/page.hpp"
#include "cli/pose_report.hpp"

namespace dpr::cli {

/// Pictures of a body's way.
struct BodyPictures {
  std::vector<Picture> frames;  ///< the start and iterations
  std::string plot;             ///< file; empty: none
  Plot curves;                  ///< what it shows
  std::vector<Picture>
      equals;  ///< some of the poses that explain the target equally well; empty: there is one
};

/// The pictures that write_pose_report() left.
struct PosePictures {
  Picture target, start, end, difference;
  std::vector<BodyPictures> bodies;
  Model model;  ///< the scene as it was found, and its camera
};

/// One HTML file that refers to the pictures beside it. Throws IoError.
void write_pose_page(const std::filesystem::path& file, const PageSource& source,
                     std::span<const FoundBody> found, const PosePictures& pictures,
                     const std::optional<glm::dmat3>& truth);

}  // namespace dpr::cli
