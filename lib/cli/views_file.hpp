// Views files as the commands write them.
#pragma once

#include <filesystem>
#include <string_view>

#include "dpr/shape.hpp"

namespace dpr::cli {

/// A views file that was read.
struct ViewsText {
  std::filesystem::path file;
  std::string_view text;
};

/// Writes a views file that says what another does, of the same images, with the cameras of `views`, whose size may be
/// another. Throws IoError.
void write_views(const std::filesystem::path& file, const ViewsText& from, const ShapeViews& views);

}  // namespace dpr::cli
